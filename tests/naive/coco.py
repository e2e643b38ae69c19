"""Average precision and recall as COCO's evaluation computes them, in plain loops (Lin et al. 2014).

Image by image and threshold by threshold each detection, by falling score, takes the last of the free references with
the largest IoU; a detection that takes none but reaches the threshold with an ignore region does not count. There is no
limit of 100 detections an image.
"""

from itertools import groupby

THRESHOLDS = [0.50 + 0.05 * k for k in range(10)]


def matched(ious, scores, region, threshold):
    """Return for the detections of one image, by falling score: (score, true positive), without the ignored ones.

    `ious[d]` maps references to IoU, `region[d]` is the largest IoU with an ignore region.
    """
    free, found = set().union(*ious), []
    for d in sorted(range(len(ious)), key=lambda d: -scores[d]):
        least, best = threshold - 1e-9, None
        for r in sorted(free & ious[d].keys()):
            if ious[d][r] >= least:
                least, best = ious[d][r], r
        if best is not None:
            free.remove(best)
        elif region[d] >= threshold - 1e-9:
            continue
        found.append((scores[d], best is not None))
    return found


def precision_and_recall(images, references, threshold):
    """Return AP and recall; `images` are (ious, scores, region), `references` is their number in all images."""
    every = sorted((one for image in images for one in matched(*image, threshold)), key=lambda one: -one[0])
    points, found, number = [], 0, 0
    for _, step in groupby(every, key=lambda one: one[0]):
        for _, hit in step:
            number, found = number + 1, found + hit
        points.append((found / references, found / number))
    total = 0.0
    for place in range(101):
        # The product, as COCO has it, may lie a rounding above the recall that it stands for.
        total += max((precision for recall, precision in points if recall >= place * 0.01), default=0.0)
    return total / 101, found / references


def evaluated(images, references):
    """Return AP, AP at 0.5, AP at 0.75 and AR."""
    every = [precision_and_recall(images, references, threshold) for threshold in THRESHOLDS]
    precisions, recalls = zip(*every, strict=True)
    return sum(precisions) / 10, precisions[0], precisions[5], sum(recalls) / 10
