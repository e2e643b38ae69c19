"""The reference holds every building-like rectangle and nothing else; detectors learn nothing of it."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.scenes.synthetic.presets import preset
from roofbench.scenes.synthetic.solids import Body
from roofbench.scenes.synthetic.world import make_world

PRESETS = ("fairfield-3-small", "moonee-ponds-small", "knox-small", "toronto-a-small", "vaihingen-a-small")


@pytest.fixture(scope="module", params=PRESETS)
def pair(request):
    return make_world(preset(request.param), 2), rb.make_scene(request.param, seed=2)


def test_everything_in_the_reference_is_large_and_high_enough(pair):
    _, scene = pair
    assert scene.reference.areas.min() >= 10 - 1e-2
    assert scene.reference.attributes["height"].min() >= 2.5


def test_every_building_part_is_in_the_reference_or_within_another_part(pair):
    world, scene = pair
    solids = world.solids
    outlines = shapely.union_all(scene.reference.polygons)
    shapely.prepare(outlines)
    xmin, ymin = scene.extent[:2]
    for row in np.flatnonzero((solids.body == Body.BUILDING) & (solids.areas >= 10) & (solids.heights >= 2.5)):
        assert outlines.buffer(0.01).contains(
            shapely.Point(xmin + solids.rectangle[row, 0], ymin + solids.rectangle[row, 1])
        )


def test_clutter_stays_below_what_the_reference_holds(pair):
    world, _ = pair
    solids = world.solids
    other = ~np.isin(solids.body, (Body.BUILDING, Body.ROOF_STRUCTURE, Body.HEDGE))
    assert not np.any(other & (solids.heights >= 2.5) & (solids.areas >= 10))
    hedge = solids.body == Body.HEDGE
    assert not np.any(hedge & (solids.rectangle[:, 4] > 1.5))


def test_references_are_rectangles_inside_the_extent(pair):
    _, scene = pair
    index, corners = scene.reference.quadrilaterals
    assert len(index) == len(scene.reference)
    edges = np.roll(corners, -1, axis=1) - corners
    assert np.abs((edges * np.roll(edges, -1, axis=1)).sum(axis=-1)).max() < 0.1
    # Digitised in the image, a roof at its border leans out by some decimetres.
    assert shapely.box(*scene.extent).buffer(1).contains(shapely.union_all(scene.reference.polygons))


def overlaps_of_two_buildings(reference):
    polygons, building = reference.polygons, reference.building_ids
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    area = shapely.area(shapely.intersection(polygons[first], polygons[second]))
    return area[building[first] != building[second]]


def test_parts_of_one_building_overlap_and_those_of_two_do_not(pair):
    _, scene = pair
    polygons, building = scene.reference.polygons, scene.reference.building_ids
    assert not np.any(overlaps_of_two_buildings(scene.reference) > 1e-6)
    for number in np.unique(building):
        parts = polygons[building == number]
        assert shapely.union_all(parts).geom_type == "Polygon", "a building is in one piece"


@pytest.mark.parametrize("name", ["knox", "vaihingen-a"])
def test_where_streets_wind_buildings_of_two_streets_do_not_meet(name):
    for seed in (2, 3):
        assert not np.any(
            overlaps_of_two_buildings(rb.make_scene(name, seed=seed, digitised="ground").reference) > 1e-6
        )


def test_houses_have_one_to_four_rectangles():
    """I, L and T, U, and C shapes, as the paper of 2010 counts them (section 4.1)."""
    parts = np.bincount(rb.make_scene("moonee-ponds", seed=1).reference.building_codes)
    assert set(np.unique(parts)) == {1, 2, 3, 4}
    assert (parts > 1).mean() > 0.25
    aligned = [np.bincount(rb.make_scene("fairfield", seed=s).reference.building_codes) for s in range(3)]
    assert set(np.unique(np.concatenate(aligned))) == {1, 2, 3, 4}


def test_rows_of_garages_are_long_low_and_flat():
    plain, rows = (rb.make_scene("vaihingen-a-small", seed=1, garage_rows=share).reference for share in (0.0, 1.0))
    assert plain.attributes["height"].max() > 4
    assert rows.attributes["height"].max() < 3
    index, corners = rows.quadrilaterals
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1)
    assert len(index) == len(rows) == preset("vaihingen-a-small").buildings
    assert (sides.max(axis=1) > 12).all()
    assert (sides.min(axis=1) < 7).all()


@pytest.mark.parametrize("buildings", range(5, 12))
def test_a_number_of_rectangles_is_exact_whatever_shape_comes_last(buildings):
    """The last building has fewer wings where need be, and is still in one piece."""
    recipe = {"counted": "rectangles", "plain_plans": 0.1, "bands": "none"}
    before = rb.make_scene("fairfield-1", seed=1, **recipe, buildings=buildings - 1).reference
    reference = rb.make_scene("fairfield-1", seed=1, **recipe, buildings=buildings).reference
    assert len(reference) == buildings
    assert set(shapely.to_wkt(before.polygons)) < set(shapely.to_wkt(reference.polygons))
    last = reference.polygons[reference.building_codes == reference.building_codes.max()]
    assert shapely.union_all(last).geom_type == "Polygon"


def test_a_digitising_error_moves_corners_by_as_much():
    plain, wrong = (rb.make_scene("vaihingen-a-small", seed=1, reference_error=e).reference for e in (0.0, 0.4))
    moved = shapely.get_coordinates(wrong.polygons) - shapely.get_coordinates(plain.polygons)
    assert float(moved.std()) == pytest.approx(0.4, rel=0.3)


def test_detectors_get_neither_classes_nor_reference_nor_recipe(pair):
    _, scene = pair
    seen = scene.for_detection()
    assert seen.points.classification is None
    assert seen.reference is None
    assert seen.area is None
    assert seen.facts == {}


def test_roof_points_do_not_lie_on_exact_planes():
    world = make_world(preset("fairfield-small"), 1)
    cloud = rb.make_scene("fairfield-small", seed=1).points
    xmin, ymin = 320000.0, 5810000.0
    hits = 0
    for planes, base in zip(world.solids.planes[:8], world.solids.base[:8], strict=True):
        roof = planes[4:][planes[4:, 2] > 0]
        local = np.stack([cloud.x - xmin, cloud.y - ymin, cloud.z], -1)
        inside = (local @ planes[:4, :3].T < planes[:4, 3] - 0.5).all(axis=1) & (local[:, 2] > base + 2)
        if inside.sum() > 30:
            residual = np.abs(local[inside] @ roof[:, :3].T - roof[:, 3]).min(axis=1)
            assert residual.std() > 0.02
            hits += 1
    assert hits >= 2


def test_walls_are_not_aligned_with_the_image():
    reference = rb.make_scene("fairfield", seed=1, bands="none").reference
    corners = reference.quadrilaterals[1]
    edge = corners[:, 1] - corners[:, 0]
    turn = np.degrees(np.arctan2(edge[:, 1], edge[:, 0])) % 90
    assert np.minimum(turn, 90 - turn).min() > 0.05
    assert turn.std() > 0.5


def test_image_values_of_roofs_overlap_with_those_of_everything_else():
    """No grey value or colour is used for roofs alone."""
    scene = rb.make_scene("fairfield-3-small", seed=4)
    image = scene.image
    rows, columns = np.indices(image.grid.shape)
    x, y = image.grid.to_world(rows + 0.5, columns + 0.5)
    roof = shapely.contains_xy(shapely.union_all(scene.reference.polygons).buffer(-1), x, y)
    codes = (image.values // 16).astype(int)
    keys = codes[0] * 256 + codes[1] * 16 + codes[2]
    on, off = np.bincount(keys[roof], minlength=4096), np.bincount(keys[~roof], minlength=4096)
    assert on[off == 0].sum() < 0.02 * on.sum()


def test_green_roofs_look_green_but_not_like_trees():
    plain, green = (
        rb.make_scene("moonee-ponds-small", seed=1, tree_density=0, green_roof_share=share) for share in (0.0, 1.0)
    )

    def greenness(scene):
        image = scene.image
        rows, columns = np.indices(image.grid.shape)
        x, y = image.grid.to_world(rows + 0.5, columns + 0.5)
        roof = shapely.contains_xy(shapely.union_all(scene.reference.polygons).buffer(-2), x, y)
        red, vegetation = image.band("red")[roof], image.band("green")[roof]
        return float(np.median((vegetation - red) / (vegetation + red)))

    assert greenness(plain) < 0
    assert greenness(green) > 0.05
