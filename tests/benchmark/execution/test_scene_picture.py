"""The picture that a worker takes of a scene."""

import io

import numpy as np
import pytest
from PIL import Image as Bitmap

from roofbench.benchmark.execution.scene_picture import ScenePicture, scene_picture
from roofbench.scenes.builtin import hamlet
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid, Image
from roofbench.scenes.scene import Scene


def colours(picture):
    with Bitmap.open(io.BytesIO(picture.content)) as bitmap:
        return np.asarray(bitmap.convert("RGB")).astype(int)


def test_covers_the_extent_even_when_the_orthoimage_is_larger():
    grid = Grid(0.0, 100.0, 0.5, 200, 200)
    values = np.zeros((3, 200, 200), dtype=np.uint8)
    values[0, :, :100] = 255  # red in the west
    values[2, :, 100:] = 255  # blue in the east
    scene = Scene("two halves", (40.0, 40.0, 60.0, 50.0), image=Image(values, ("red", "green", "blue"), grid))
    picture = scene_picture(scene)
    assert (picture.width, picture.height) == (100, 50)
    seen = colours(picture)
    assert seen[25, 20, 0] > 200
    assert seen[25, 20, 2] < 60
    assert seen[25, 80, 2] > 200


def test_shows_heights_where_there_is_no_image():
    x, y = (axis.ravel() + 0.25 for axis in np.meshgrid(np.arange(0, 40, 0.5), np.arange(0, 40, 0.5)))
    house = (abs(x - 20) < 5) & (abs(y - 20) < 5)
    points = PointCloud(x=x, y=y, z=np.where(house, 108.0, 100.0))
    dem = Elevation(np.full((5, 5), 100, dtype=np.float32), Grid(0.0, 40.0, 8.0, 5, 5))
    picture = scene_picture(Scene("house", (0, 0, 40, 40), points=points, dem=dem))
    assert "height above ground" in picture.shows
    seen = colours(picture).sum(axis=-1)
    middle = seen.shape[0] // 2
    assert seen[middle, middle] < seen[5, 5] - 100


def test_a_scene_without_image_and_points_has_no_picture():
    assert scene_picture(Scene("empty", (0, 0, 10, 10))) is None
    far = PointCloud(x=np.array([50.0]), y=np.array([50.0]), z=np.array([1.0]))
    assert scene_picture(Scene("points beside it", (0, 0, 10, 10), points=far)) is None


def test_is_read_back_with_its_caption_and_made_smaller():
    picture = scene_picture(hamlet(1))
    again = ScenePicture.read(picture.content)
    assert again == picture
    small = again.at_most(120)
    assert max(small.width, small.height) == 120
    assert small.shows == picture.shows
    assert len(small.content) < len(picture.content)


@pytest.mark.parametrize("box", [(0, 0, 40, 40), (-20, -20, 20, 20)])
def test_a_part_is_square_and_may_reach_over_the_border(box):
    part = scene_picture(hamlet(1)).cut(box, 80)
    assert (part.width, part.height) == (80, 80)
