"""Slow, obvious oracles of patches of cells and of what is assigned to them and lowered around them."""

from collections import Counter

import numpy as np

SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))


def inside(shape, r, c):
    return 0 <= r < shape[0] and 0 <= c < shape[1]


def around(shape, r, c):
    """The eight neighbours of a cell, itself, or those of them that the grid has."""
    return [(i, j) for i in range(r - 1, r + 2) for j in range(c - 1, c + 2) if inside(shape, i, j)]


def label_patches(height, mask, step):
    labels, count = np.zeros(mask.shape, np.int32), 0
    for start in np.argwhere(mask):
        if labels[tuple(start)]:
            continue
        count += 1
        labels[tuple(start)] = count
        stack = [tuple(start)]
        while stack:
            r, c = stack.pop()
            for down, right in SIDES:
                i, j = r + down, c + right
                if not inside(mask.shape, i, j) or not mask[i, j] or labels[i, j]:
                    continue
                if abs(int(height[i, j]) - int(height[r, c])) <= step:
                    labels[i, j] = count
                    stack.append((i, j))
    return labels, count


def rims(patches, height, state, roof, fall):
    """Counts of cells, of the rim and of the roof on it that lies low enough, each by label."""
    cells, length, low = Counter(), Counter(), Counter()
    for r, c in np.argwhere(patches):
        label = patches[r, c]
        cells[label] += 1
        for down, right in SIDES:
            i, j = r + down, c + right
            if not inside(patches.shape, i, j):
                length[label] += 1
            elif patches[i, j] != label and state[i, j] > 0:
                length[label] += 1
                low[label] += bool(roof[i, j]) and height[r, c] - height[i, j] >= fall
    return cells, length, low


def assign_rough_cells(height, state, labels, high, rounds=8):
    """Height and labels after all rounds; ties go to the neighbour that comes first."""
    for _ in range(rounds):
        new_height, new_labels = height.copy(), labels.copy()
        for r in range(1, labels.shape[0] - 1):
            for c in range(1, labels.shape[1] - 1):
                if labels[r, c] or state[r, c] != high:
                    continue
                known = [cell for cell in around(labels.shape, r, c) if labels[cell]]
                if len(known) >= 5:
                    best = min(known, key=lambda cell: abs(int(height[cell]) - int(height[r, c])))
                    new_height[r, c], new_labels[r, c] = height[best], labels[best]
        height, labels = new_height, new_labels
    return height, labels


def lowered(height, labels, chosen, above, ledge=30):
    """Heights after the chosen cells took the level beside them, ring by ring."""
    height, waiting = height.copy(), chosen.copy()
    roof = (labels > 0) | chosen

    def level(r, c):
        levels = [
            int(height[cell])
            for cell in around(labels.shape, r, c)
            if roof[cell] and not waiting[cell] and 0 <= height[cell] <= height[r, c] + above
        ]
        alike = [[other for other in levels if abs(other - one) <= ledge] for one in levels]
        best = min(alike, key=lambda group: (-len(group), sum(group)), default=None)
        return None if best is None else sum(best) // len(best)

    ring = {(r, c) for r, c in np.argwhere(waiting).tolist() if level(r, c) is not None}
    while ring:
        found = {cell: level(*cell) for cell in ring}
        for cell, low in found.items():
            height[cell] = height[cell] if low is None else low
            waiting[cell] = False
        ring = {other for cell in ring for other in around(labels.shape, *cell) if waiting[other]}
    return height
