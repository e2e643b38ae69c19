"""Pictures and difficulty curves of docs/results/synthetic.md.

``python tests/performance/study_synthetic.py pictures FOLDER [PRESET ...]`` draws presets; ``... curves FILE.png``
prints and plots the quality of the plain detector along one parameter, over ten seeds; ``... presets`` on each preset.
"""

import io
import sys
from pathlib import Path

import matplotlib.pyplot as plt
from PIL import Image as Bitmap

import roofbench as rb
from roofbench.reports.scene_map import scene_figure
from roofbench.scenes.synthetic import SceneParameters, preset_names

PICTURES = (
    ("fairfield", {}),
    ("fairfield-1", {}),
    ("fairfield-2", {}),
    ("fairfield-3", {}),
    ("fairfield-3-small", {}),
    ("moonee-ponds", {}),
    ("moonee-ponds-small", {"green_roof_share": 0.4}),
    ("knox", {}),
    ("knox-small", {}),
    ("toronto-a", {}),
    ("toronto-b", {}),
    ("vaihingen-a", {}),
    ("vaihingen-b", {}),
    ("vaihingen-a-small", {"garage_rows": 0.2}),
)
# Where an axis shows: on knox-small trees stand at roof height and a first pulse does not pierce them; elsewhere they
# do not hide what slope, spacing and registration do.
AXES = {
    "tree_density": ("knox-small", (0, 20, 40, 80, 160)),
    "slope": ("fairfield-1", (0, 5, 10, 15, 20)),
    "point_spacing": ("moonee-ponds-small", (0.35, 0.5, 0.7, 1.0, 1.5)),
    "registration_shift": ("fairfield-1", (0.0, 0.5, 1.0, 1.5, 2.0)),
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


def quality(preset, detector, seeds, **parameters):
    """Return object and area quality, pooled over seeds, percent."""
    found = []
    for seed in seeds:
        scene = rb.make_scene(preset, seed=seed, **parameters)
        found.append(rb.evaluate(rb.detect(scene, detector), scene.reference))
    pooled = rb.pool(found)
    return 100 * pooled.object.quality, 100 * pooled.pixel.quality


def curves(picture, detector="ndsm", seeds=range(10)):
    figure, panels = plt.subplots(1, len(AXES), figsize=(13, 3.2), sharey=True, layout="constrained")
    print("| axis | preset | values | object quality | area quality |\n|---|---|---|---|---|")
    for (axis, (preset, values)), panel in zip(AXES.items(), panels, strict=True):
        rows = [quality(preset, detector, seeds, **{axis: value}) for value in values]
        columns = [", ".join(f"{number:.1f}" for number in column) for column in zip(*rows, strict=True)]
        print(f"| `{axis}` | `{preset}` | {', '.join(f'{v:g}' for v in values)} | {' | '.join(columns)} |", flush=True)
        rule = SceneParameters.parameters()[axis]
        for column, label, style in zip(zip(*rows, strict=True), ("objects", "area"), ("o--", "o-"), strict=True):
            panel.plot(values, column, style, color="tab:grey" if label == "objects" else "tab:blue", label=label)
        panel.set(xlabel=f"{axis.replace('_', ' ')} ({rule.unit})", title=preset, ylim=(0, 100))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel(f"quality of {detector}, %")
    panels[0].legend()
    figure.savefig(picture, dpi=110)


def presets(detector="ndsm"):
    print("| preset | object quality | area quality |\n|---|---|---|")
    for name in preset_names():
        pair = quality(name, detector, range(10) if name.endswith("-small") else range(1, 2))
        print(f"| `{name}` | {pair[0]:.1f} | {pair[1]:.1f} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "pictures":
        wanted = [pair for pair in PICTURES if not sys.argv[3:] or pair[0] in sys.argv[3:]]
        for preset, parameters in wanted:
            print(draw(sys.argv[2], preset, parameters), flush=True)
    elif sys.argv[1] == "curves":
        curves(sys.argv[2])
    else:
        presets()
