import numpy as np
import pytest
from builders import small_scenes
from harness.command_line import run

import roofbench as rb
from roofbench.reports.scene_map import scene_figure


def titles(scene):
    return [axes.get_title() for axes in scene_figure(scene).axes if axes.get_title()]


def test_a_full_scene_has_three_panels():
    image, height, reference = titles(small_scenes.scene())
    assert image == "Orthoimage, 0.5 m (red, green, blue)"
    assert height.startswith("Height above ground, shaded")
    assert reference == "Reference: 2 footprints, 1 building"


def test_without_an_image_the_intensity_is_drawn():
    assert titles(small_scenes.scene(image=None))[0].startswith("Laser intensity")


@pytest.mark.parametrize("lacking", ["points", "dem", "reference", "area"])
def test_what_is_lacking_is_left_out(lacking):
    assert len(titles(small_scenes.scene(**{lacking: None}))) == (3 if lacking in ("dem", "area") else 2)


def test_height_is_drawn_where_the_building_is():
    """The brightest part of the height panel is the roof, not its mirror image."""
    figure = scene_figure(small_scenes.scene(points=small_scenes.cloud(20_000)))
    panel = next(axes for axes in figure.axes if axes.get_title().startswith("Height"))
    picture = panel.images[0]
    colours = np.asarray(picture.get_array())
    xmin, xmax, ymin, ymax = picture.get_extent()
    rows, columns = np.nonzero(colours[..., 0] > 0.5)
    x = xmin + (columns + 0.5) / colours.shape[1] * (xmax - xmin) - small_scenes.WEST
    y = ymax - (rows + 0.5) / colours.shape[0] * (ymax - ymin) - small_scenes.SOUTH
    assert np.median(x) == pytest.approx(15, abs=1)
    assert np.median(y) == pytest.approx(17.5, abs=1)


def test_the_command_writes_a_picture(tmp_path):
    rb.save_scene(small_scenes.scene(), tmp_path / "small")
    picture = tmp_path / "small.png"
    code, out, _ = run("scenes", "show", tmp_path / "small", "-o", picture, "--dpi", 50)
    assert (code, out) == (0, f"{picture}\n")
    assert picture.read_bytes().startswith(b"\x89PNG")
    code, _, err = run("scenes", "show", tmp_path / "small", "-o", tmp_path / "small.gif")
    assert code == 2
    assert "small.gif: unknown file ending '.gif'" in err
