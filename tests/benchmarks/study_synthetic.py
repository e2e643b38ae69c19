"""Pictures and difficulty curves of docs/synthetic.md.

``python tests/benchmarks/study_synthetic.py pictures FOLDER`` draws every preset; ``... curves [PRESET]`` prints how
the plain detector fares as one knob is turned, over ten seeds.
"""

import io
import sys
from pathlib import Path

from PIL import Image as Bitmap

import roofbench as rb
from roofbench.reports.scene_map import scene_figure

PICTURES = (
    ("fairfield", {}),
    ("fairfield-3", {}),
    ("fairfield-3-small", {}),
    ("moonee-ponds", {}),
    ("moonee-ponds-small", {"green_roof_share": 0.4}),
    ("knox", {}),
    ("knox-small", {}),
    ("toronto-a", {}),
    ("vaihingen-a", {}),
    ("vaihingen-a-small", {}),
)
AXES = {
    "tree_density": (0, 20, 40, 80),
    "slope": (0, 5, 10, 20),
    "point_spacing": (0.35, 0.5, 1.0, 1.5),
    "registration_shift": (0.0, 0.5, 1.0, 2.0),
}


def draw(folder, preset, parameters, width=1400, colours=256):
    figure = scene_figure(rb.make_scene(preset, seed=1, **parameters), dpi=110)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    bitmap = Bitmap.open(buffer).convert("RGB")
    # A palette of few colours keeps a photograph small enough for a repository.
    path = Path(folder) / f"synthetic-{preset}.png"
    while True:
        small = bitmap.resize((width, round(bitmap.height * width / bitmap.width)), Bitmap.Resampling.LANCZOS)
        small.quantize(colours, kmeans=2, dither=Bitmap.Dither.NONE).save(path, optimize=True)
        if path.stat().st_size < 290_000:
            return path
        width = int(width * 0.9)


def curves(preset, detector="ndsm", seeds=range(10)):
    for axis, values in AXES.items():
        row = []
        for value in values:
            found = []
            for seed in seeds:
                scene = rb.make_scene(preset, seed=seed, **{axis: value})
                found.append(rb.evaluate(rb.detect(scene, detector), scene.reference))
            row.append((rb.pool(found).object.quality, rb.pool(found).pixel.quality))
        print(
            f"| {axis} {', '.join(f'{v:g}' for v in values)} | "
            + " | ".join(", ".join(f"{100 * pair[k]:.1f}" for pair in row) for k in (0, 1))
            + " |",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1] == "pictures":
        for preset, parameters in PICTURES:
            print(draw(sys.argv[2], preset, parameters), flush=True)
    else:
        curves(*(sys.argv[2:] or ["knox-small"]))
