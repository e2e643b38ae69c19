"""Rows of houses wall to wall, trees in the gaps between them, and pulses of a single return."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.scenes.synthetic.presets import preset
from roofbench.scenes.synthetic.solids import Body
from roofbench.scenes.synthetic.world import make_world

EXACT = {"reference_error": 0.0, "digitised": "ground"}


def houses(scene):
    """Union of the parts of each building, buildings in order."""
    polygons, ids = scene.reference.polygons, scene.reference.building_ids
    return np.array([shapely.union_all(polygons[ids == one]) for one in np.unique(ids)])


@pytest.mark.parametrize("name", ["rows-small", "old-town-small"])
def test_most_houses_share_a_wall_with_a_neighbour_and_none_overlap(name):
    found = houses(rb.make_scene(name, seed=2))
    one, two = shapely.STRtree(found).query(found, predicate="dwithin", distance=0.05)
    pairs = one < two
    walls = shapely.length(
        shapely.intersection(shapely.buffer(found[one[pairs]], 0.05), shapely.boundary(found[two[pairs]]))
    )
    assert shapely.area(shapely.intersection(found[one[pairs]], found[two[pairs]])).max() < 0.1
    assert np.median(walls) > 6
    assert len(np.unique(np.concatenate([one[pairs], two[pairs]]))) > 0.8 * len(found)


def steps(variety):
    """Differences in eaves of neighbouring houses of rows."""
    recipe = preset("rows-small", row_variety=variety, row_share=1.0, slope=0.0, undulation=0.0, buildings=30)
    solids = make_world(recipe, 3).solids
    main = solids.body == Body.BUILDING
    first = np.unique(solids.owner[main], return_index=True)[1]
    eaves, place = solids.eave[main][first], solids.rectangle[main][first, :2]
    distance = np.hypot(*np.diff(place, axis=0).T)
    return np.abs(np.diff(eaves))[distance < 8]


def test_without_variety_no_eaves_step_and_with_it_most_do():
    assert (steps(0.0) < 0.01).all()
    assert (steps(1.0) > 0.01).mean() > 0.9
    assert 0.2 < (steps(0.5) > 0.01).mean() < 0.8


def test_gap_trees_stand_between_buildings_and_change_no_building():
    plain, planted = (make_world(preset("rows-small", gap_trees=share), 1) for share in (0.0, 1.0))
    np.testing.assert_array_equal(plain.solids.rectangle, planted.solids.rectangle)
    scene = rb.make_scene("rows-small", seed=1)
    found = houses(scene)
    x, y = planted.trees.x + scene.extent[0], planted.trees.y + scene.extent[1]
    moved = ~np.isin(np.round(planted.trees.x, 6), np.round(plain.trees.x, 6))
    assert moved.sum() >= 3
    near = np.sort(shapely.distance(shapely.points(x, y)[moved, None], found[None, :]), axis=1)[:, :2]
    assert np.median(near[:, 1]) < 3.1
    reaches = planted.trees.radius[moved] > near[:, 1]
    assert reaches.any()


def test_a_single_return_scanner_writes_one_of_one():
    single, first = (rb.make_scene("old-town-small", seed=1, pulse=pulse).points for pulse in ("single", "first"))
    assert (single.return_number == 1).all()
    assert (single.number_of_returns == 1).all()
    np.testing.assert_array_equal(single.z, first.z)


def test_a_row_is_the_same_whatever_stands_elsewhere():
    few, many = (rb.make_scene("rows-small", seed=4, buildings=count) for count in (12, 30))
    np.testing.assert_array_equal(few.reference.polygons[:8], many.reference.polygons[:8])


ROW = {"row_share": 1.0, "row_gables": 0.0, "outbuildings": 0.0, "slope": 4.0, "buildings": 30}


def outline(rectangle):
    x, y, angle, length, width = rectangle
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    ends = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return shapely.Polygon([(x, y) + a * length / 2 * along + b * width / 2 * across for a, b in ends])


@pytest.mark.parametrize(("kind", "deep"), [("row_chimneys", (0.7, 1.6)), ("row_parapets", (6.0, 11.0))])
def test_chimneys_and_parapets_stand_on_party_walls_above_both_roofs(kind, deep):
    plain, made = (make_world(preset("rows-small", **ROW, **{kind: share}), 3).solids for share in (0.0, 1.0))
    houses_, ridges = (values[made.body == Body.BUILDING] for values in (made.rectangle, made.ridge))
    np.testing.assert_array_equal(houses_, plain.rectangle[plain.body == Body.BUILDING])
    new = ~(made.rectangle[:, None] == plain.rectangle).all(axis=2).any(axis=1)
    assert new.sum() > 15
    outlines = np.array([outline(one) for one in houses_])
    for place, top in zip(made.rectangle[new], made.ridge[new], strict=True):
        own = outline(place)
        near = np.flatnonzero(shapely.dwithin(own, outlines, 0.01))
        assert len(near) == 2
        common = shapely.area(shapely.intersection(own, outlines[near]))
        assert common.min() > 0.3 * common.max()
        assert 0.29 < top - ridges[near].max() < 1.01
        assert deep[0] <= place[3:].max() <= deep[1]


def test_houses_beside_a_wall_with_a_chimney_have_no_other():
    bricks = [
        (make_world(preset("rows-small", **ROW, row_chimneys=share), 3).solids.rectangle[:, 3:] == (0.7, 0.55))
        for share in (0.0, 1.0)
    ]
    assert [one.all(axis=1).sum() > 5 for one in bricks] == [True, False]


@pytest.mark.parametrize("seed", [3, 5, 8])
def test_ten_houses_with_annexes_are_a_row(seed):
    town = preset("rows-small", row_share=1.0, outbuildings=2.0, row_house_width=4.0, buildings=30)
    solids = make_world(town, seed).solids
    assert len(np.unique(solids.owner[solids.body == Body.BUILDING])) == 30


def directions(house):
    """Directions of the sides of an outline, degrees."""
    x, y = np.diff(shapely.get_coordinates(house), axis=0).T
    return np.degrees(np.arctan2(y, x)) % 180


@pytest.mark.parametrize("gables", [0.0, 1.0])
@pytest.mark.parametrize("skew", [-30.0, 15.0])
def test_a_skew_turns_party_walls_but_neither_fronts_nor_areas(gables, skew):
    more = ROW | {"row_gables": gables, "row_variety": 0.0, "winding": 0.0, "orientation_spread": 0.0}
    plain, oblique = (rb.make_scene("rows-small", seed=3, row_skew=value, **more, **EXACT) for value in (0.0, skew))
    areas = [shapely.area(scene.reference.polygons) for scene in (plain, oblique)]
    assert len(areas[1]) == len(areas[0])
    # At the border of the scene other houses may be left out.
    assert np.abs(areas[1][:, None] - areas[0]).min(axis=1).max() < 0.05
    plain_sides, sides = (
        np.stack([directions(house) for house in scene.reference.polygons]) for scene in (plain, oblique)
    )
    street = np.median(plain_sides.min(axis=1))
    along = np.abs((sides - street + 45) % 90 - 45) < 0.1
    assert (along.sum(axis=1) == 2).all()
    np.testing.assert_allclose(np.abs((sides[~along] - street + 45) % 90 - 45), abs(skew), atol=0.2)
    # Houses still stand wall to wall and none overlap.
    one, two = shapely.STRtree(oblique.reference.polygons).query(oblique.reference.polygons, predicate="overlaps")
    common = shapely.area(shapely.intersection(oblique.reference.polygons[one], oblique.reference.polygons[two]))
    assert common.max(initial=0) < 0.1


@pytest.mark.parametrize("gables", [0.0, 1.0])
def test_points_on_oblique_houses_lie_inside_their_outlines(gables):
    more = ROW | {"row_gables": gables, "row_variety": 0.0, "tree_density": 0.0, "gap_trees": 0.0, "clutter": 0.0}
    scene = rb.make_scene("rows-small", seed=3, row_skew=30.0, horizontal_noise=0.0, **more, **EXACT)
    points = scene.points
    high = points.z - scene.dem.sample(points.x, points.y) > 3.0
    united = shapely.union_all(scene.reference.polygons)
    inside = shapely.contains_xy(shapely.buffer(united, 0.1), points.x, points.y)
    assert inside[high].mean() > 0.97
    within = shapely.contains_xy(shapely.buffer(united, -0.3), points.x, points.y)
    assert high[within].mean() > 0.97
