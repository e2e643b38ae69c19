import dataclasses

import numpy as np
import pytest

from roofbench.scenes.geodata.las_files import read_points, write_points
from roofbench.scenes.geodata.points import PointCloud


def cloud(n, *, seed=0):
    rng = np.random.default_rng(seed)
    x, y, z = (np.round(rng.uniform(0, 5, n), 2) for _ in range(3))
    return PointCloud(x + 6e5, y + 5e6, z, return_number=rng.integers(1, 4, n).astype(np.uint8))


@pytest.mark.parametrize("n", [0, 1, 3000, 30_000])
def test_repeats_are_the_points_that_equal_an_earlier_one(n):
    own = cloud(n)
    rows = list(zip(own.x, own.y, own.z, own.return_number, strict=True))
    twice = own.take(np.concatenate([np.arange(n), np.arange(0, n, 7), np.arange(0, n, 7)]))
    seen, expected = set(), []
    for row in zip(twice.x, twice.y, twice.z, twice.return_number, strict=True):
        expected.append(row in seen)
        seen.add(row)
    assert twice.repeats().tolist() == expected
    assert len(twice.distinct()) == len(set(rows))
    assert own.distinct() is own or len(set(rows)) < n


def test_points_in_one_place_that_differ_otherwise_are_no_repeats():
    one = PointCloud(np.zeros(2), np.zeros(2), np.zeros(2), colour=np.zeros((2, 3), dtype=np.uint16))
    assert one.repeats().tolist() == [False, True]
    assert not dataclasses.replace(one, return_number=np.array([1, 2], dtype=np.uint8)).repeats().any()
    assert not dataclasses.replace(one, colour=np.eye(2, 3, dtype=np.uint16)).repeats().any()


def test_copies_of_a_point_in_files_of_other_sources_are_repeats():
    one = PointCloud(np.zeros(2), np.zeros(2), np.zeros(2), source=np.array([4, 9], dtype=np.uint16))
    assert one.repeats().tolist() == [False, True]
    assert one.distinct().source.tolist() == [4]


def test_sources_are_written_and_read_where_a_cloud_has_several(tmp_path):
    several = dataclasses.replace(cloud(300), source=np.arange(300, dtype=np.uint16) // 100 + 4000)
    write_points(several, tmp_path / "a.laz")
    assert read_points(tmp_path / "a.laz").source.tolist() == several.source.tolist()
    write_points(several.take(slice(0, 100)), tmp_path / "b.laz")
    assert read_points(tmp_path / "b.laz").source is None
    both = read_points([tmp_path / "b.laz", tmp_path / "a.laz"])
    assert np.unique(both.source).tolist() == [4000, 4001, 4002]
