"""Plain outlines: read from WKB as shapely reads them; those that are clearly simple are valid."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.scenes.geodata.simple_rings import clearly_simple, plain_outlines


def rings(rng, count):
    """Random rings, of which many cross, touch or repeat themselves, near and far from the origin."""
    polygons = []
    for k in range(count):
        corners = int(rng.integers(3, 12))
        centre = rng.uniform(-6e6, 6e6, 2) if k % 2 else rng.uniform(0, 10, 2)
        if k % 3 == 0:
            points = rng.integers(0, 5, (corners, 2)).astype(float)
        elif k % 3 == 1:
            points = rng.uniform(0, 10, (corners, 2))
        else:
            angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
            points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(3, 10, (corners, 1))
        polygons.append(shapely.Polygon(points + centre))
    return np.array(polygons)


def parts(wkb):
    return np.cumsum([0, *map(len, wkb)]), np.frombuffer(b"".join(wkb), dtype=np.uint8)


def test_clearly_simple_rings_are_valid_and_measured_as_geos_does():
    polygons = rings(np.random.default_rng(3), 3000)
    found = plain_outlines(*parts(shapely.to_wkb(polygons)))
    valid = shapely.is_valid(polygons)
    assert valid[found.rows].all()
    # Those that are left to GEOS: corners on integers that touch, or straight ones.
    assert len(found.rows) > 0.95 * valid.sum()
    assert found.areas.tolist() == shapely.area(polygons[found.rows]).tolist()
    assert found.points.tolist() == shapely.get_coordinates(polygons[found.rows]).tolist()
    assert np.diff(found.start).tolist() == shapely.get_num_coordinates(polygons[found.rows]).tolist()


def test_only_plain_outlines_are_read():
    square = shapely.box(0, 0, 2, 2)
    geometries = [
        square,
        shapely.MultiPolygon([square]),
        square - shapely.box(0.5, 0.5, 1, 1),
        shapely.MultiPolygon([square, shapely.box(4, 4, 5, 5)]),
        shapely.force_3d(square, 1.0),
        shapely.Point(0, 0),
        shapely.Polygon(),
        shapely.Polygon([(0, 0), (2e9, 0), (0, 2e9)]),
        shapely.Point(0, 0).buffer(1, quad_segs=40),
    ]
    unknown = bytearray(shapely.to_wkb(square))
    unknown[21:29] = np.float64(np.nan).tobytes()
    wkb = [*shapely.to_wkb(geometries), shapely.to_wkb(square, byte_order=0), bytes(unknown), b""]
    assert plain_outlines(*parts(wkb)).rows.tolist() == [0, 1]


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0), (2, 0), (2, 0), (2, 2), (0, 0)],  # a repeated corner
        [(0, 0), (4, 0), (2, 0), (2, 2), (0, 0)],  # an edge that runs back
        [(0, 0), (4, 0), (4, 4), (2, 0), (0, 4), (0, 0)],  # a corner on an edge
        [(0, 0), (4, 0), (4, 4), (2, 1e-12), (0, 4), (0, 0)],  # nearly so
    ],
)
def test_whatever_is_doubtful_is_left_to_geos(points):
    far = np.add(np.array(points, dtype=float), [5e5, 5.8e6])
    assert clearly_simple(np.array([0, len(far)]), far).tolist() == [False]


def test_large_sets_are_repaired_as_small_ones(monkeypatch):
    polygons = rings(np.random.default_rng(5), 500)
    expected = rb.Footprints.of(polygons)
    monkeypatch.setattr("roofbench.scenes.geodata.polygon_repair._CHUNK", 10)
    monkeypatch.setattr("roofbench.scenes.geodata.polygon_repair._MANY", 100)
    found = rb.Footprints.of(polygons)
    assert found.repairs == expected.repairs
    assert shapely.equals_exact(found.polygons, expected.polygons).all()
