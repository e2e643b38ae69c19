"""Direction of gradients, entropy on the scale of the image, and pixels that are interpolated."""

import numpy as np
import pytest
from builders.line_scenes import rectangle
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import contains_xy

from roofbench.detectors.lines.entropy import coarse_entropy, local_entropy
from roofbench.detectors.lines.entropy_scale import entropy_scale
from roofbench.detectors.lines.orientation import clipped_measures, directions, gradient_sums, score_candidates
from roofbench.detectors.lines.rasters import refined
from roofbench.scenes.geodata.raster import Grid, Image

SIDE = 120


def box(degrees, length=60.0, width=40.0):
    angle = np.radians(degrees)
    return np.array(
        [[SIDE / 2, SIDE / 2, np.cos(angle), np.sin(angle), -length / 2, length / 2, -width / 2, width / 2]]
    )


def roof(degrees):
    x, y = np.meshgrid(np.arange(SIDE) + 0.5, np.arange(SIDE) + 0.5)
    return np.where(contains_xy(rectangle(SIDE / 2, SIDE / 2, 50, 30, degrees), x, y), 170, 80).astype(np.uint8)


def naive_directions(grey, box, gsd):
    """Sum over every cell whose centre is in the box, by angles."""
    import cv2

    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 0.35 / gsd)
    dx, dy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]] + 0.5 - SIDE / 2
    u, v = x * box[2] + y * box[3], -x * box[3] + y * box[2]
    inside = (u >= box[4]) & (u < box[5]) & (v >= box[6]) & (v < box[7])
    length, angle = np.hypot(dx, dy)[inside], np.arctan2(dy, dx)[inside]
    turn = angle - np.arctan2(box[3], box[2])
    total = length.sum()
    return (length * np.cos(4 * turn)).sum() / total, abs((length * np.exp(4j * angle)).sum()) / total


@pytest.mark.parametrize("degrees", [0, 17, 45, 80])
def test_directions_are_those_of_the_definition(degrees):
    grey, gsd = roof(degrees + 5), 0.25
    found = directions(gradient_sums(grey, gsd), box(degrees))[0]
    np.testing.assert_allclose(found, naive_directions(grey, box(degrees)[0], gsd), atol=0.01)


@pytest.mark.parametrize("degrees", [0, 30, 45])
def test_edges_along_the_sides_are_aligned_and_turned_ones_only_concentrated(degrees):
    gradients = gradient_sums(roof(degrees), 0.25)
    along, turned = directions(gradients, np.concatenate([box(degrees), box(degrees + 45)]))
    assert along[0] > 0.6
    assert turned[0] < -0.5
    np.testing.assert_allclose(along[1], turned[1], atol=0.2)


def test_noise_has_no_direction_and_a_uniform_area_none_at_all():
    noise = np.random.default_rng(1).integers(0, 255, (SIDE, SIDE)).astype(np.uint8)
    assert np.abs(directions(gradient_sums(noise, 0.25), box(20))).max() < 0.15
    assert directions(gradient_sums(np.full_like(noise, 90), 0.25), box(20)).tolist() == [[0.0, 0.0]]


@settings(max_examples=15, deadline=None)
@given(st.floats(0, 90), st.floats(0.2, 4.0))
def test_directions_do_not_depend_on_the_contrast(degrees, factor):
    grey = roof(25)
    scaled = np.clip(20 + (grey - 80.0) * factor * 0.5, 0, 255).astype(np.uint8)
    found = [directions(gradient_sums(image, 0.25), box(degrees)) for image in (grey, scaled)]
    np.testing.assert_allclose(found[0], found[1], atol=0.03)


def scored(directed=(0.1, 0.2), entropy=0.5, green=0.5, smooth=0.4, independent=150.0):
    return score_candidates(np.array([directed]), *np.array([[entropy], [green], [smooth], [independent]]))


def test_more_direction_and_smoothness_and_less_entropy_and_green_raise_the_score():
    for change in ({"directed": (0.3, 0.2)}, {"directed": (0.1, 0.4)}, {"entropy": 0}, {"green": 0}, {"smooth": 0.9}):
        better = scored(**change)
        assert better.score[0] > scored().score[0]
        assert better.buildings[0] == (better.score[0] > 0)
    assert scored(smooth=np.nan).score[0] == pytest.approx(scored(smooth=0.5).score[0])


def test_a_house_is_kept_and_a_crown_dropped_where_the_image_says_nothing():
    assert scored(directed=(0.05, 0.1), entropy=0.2, green=0.2, smooth=0.9).buildings[0]
    assert not scored(directed=(0.05, 0.1), entropy=0.2, green=0.2, smooth=0.1).buildings[0]


def test_the_gradient_of_interpolated_pixels_is_taken_at_their_own_scale():
    """An image of nearest points 1 m apart: its ragged edges have more of the roof's direction at a scale of 1 m."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(0)
    places = rng.uniform(0, SIDE, (SIDE**2 // 16, 2))
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    nearest = cKDTree(places).query(np.stack([x.ravel(), y.ravel()], axis=1))[1]
    colours = roof(25)[places[:, 1].astype(int), places[:, 0].astype(int)]
    grey = colours[nearest].reshape(SIDE, SIDE)
    fixed, own = (directions(gradient_sums(grey, 0.25, own_pixel=pixel), box(25))[0] for pixel in (0.0, 1.0))
    assert own[0] > fixed[0] + 0.1


@pytest.mark.parametrize("pixel", [0.0, 0.5, 1.0])
def test_the_concentration_of_noise_in_units_of_chance_is_the_same_at_every_scale_and_size(pixel):
    rng, found = np.random.default_rng(7), []
    for _ in range(12):
        gradients = gradient_sums(rng.integers(0, 255, (SIDE, SIDE)).astype(np.uint8), 0.25, own_pixel=pixel)
        for length, width in ((40, 24), (80, 60)):
            boxes = np.concatenate([box(degrees, length, width) for degrees in (0, 40)])
            independent = gradients.independent(np.full(len(boxes), length * width / 16))
            found.append(directions(gradients, boxes)[:, 1] ** 2 * independent)
    # White noise is correlated over less than crowns, whose units these are.
    assert 0.2 < np.mean(found) < 0.7


def test_the_same_directions_say_more_in_a_large_or_fine_candidate():
    directed, others = np.array([[0.1, 0.1]] * 2), np.array([[0.0], [0.0], [0.2]])
    few, many = (clipped_measures(directed[:1], *others, np.array([count])) for count in (25.0, 100.0))
    assert (few[0], few[1]) == (pytest.approx(0.5), pytest.approx(0.5))
    assert (many[0], many[1]) == (pytest.approx(1.0), pytest.approx(1.0))
    assert few[2:] == many[2:]


def textured(gsd, seed=2):
    """Smooth ground in the west, a smooth roof in the middle and rough green in the east, both standing."""
    rng = np.random.default_rng(seed)
    grey = 100 + rng.normal(0, 2, (200, 300))
    grey[:, 200:] += rng.normal(0, 30, (200, 100))
    standing, green = np.zeros((200, 300), np.uint8), np.zeros((200, 300), np.int32)
    standing[:, 100:], green[:, 200:] = 1, 100
    return np.clip(grey, 0, 255).astype(np.uint8), np.pad(np.cumsum(green, axis=1), ((0, 0), (1, 0))), standing


def test_ground_has_scaled_entropy_zero_foliage_one_and_a_roof_none_whatever_was_done_to_the_image():
    import cv2

    grey, vegetation, standing = textured(0.25)
    for image in (grey, cv2.GaussianBlur(grey, (0, 0), 1.5), np.clip(grey * 1.8 - 60.0, 0, 255).astype(np.uint8)):
        entropy = local_entropy(image)
        scale = entropy_scale(entropy, vegetation.astype(np.int32), standing, threshold=48.0, gsd=0.25)
        means = np.array([entropy[:, columns].mean() for columns in (slice(10, 90), slice(110, 190), slice(210, 290))])
        np.testing.assert_allclose(scale.scaled(means), [0, 0, 1], atol=0.15)
        assert scale.absolute(1.0) == scale.ground + scale.step


def test_without_foliage_the_step_is_that_of_undisturbed_images():
    grey, vegetation, standing = textured(0.25)
    none = np.zeros_like(vegetation, dtype=np.int32)
    scale = entropy_scale(local_entropy(grey), none, standing, threshold=48.0, gsd=0.25)
    assert scale.step == 30.0


def test_the_entropy_of_repeated_pixels_is_that_of_the_coarse_image():
    coarse = np.random.default_rng(3).integers(0, 200, (30, 41)).astype(np.uint8)
    fine = coarse.repeat(5, axis=0).repeat(5, axis=1)
    expected = local_entropy(coarse).repeat(5, axis=0).repeat(5, axis=1)
    np.testing.assert_array_equal(coarse_entropy(fine, 0.05, largest=0.25), expected)
    np.testing.assert_array_equal(coarse_entropy(coarse, 0.3, largest=0.25), local_entropy(coarse))
    assert coarse_entropy(fine[:, :-3], 0.05, largest=0.25).shape == (150, 202)


def test_coarse_pixels_are_divided_and_fine_ones_kept():
    values = np.random.default_rng(4).integers(0, 255, (3, 6, 8)).astype(np.uint8)
    image = Image(values, ("red", "green", "blue"), Grid(10, 20, 0.5, 6, 8), np.eye(6, 8) > 0)
    fine = refined(image, 0.2)
    assert (fine.grid.gsd, fine.grid.extent) == (pytest.approx(0.5 / 3), image.grid.extent)
    np.testing.assert_array_equal(fine.values[:, 1::3, 1::3], values)
    np.testing.assert_array_equal(fine.valid[1::3, 1::3], image.valid)
    assert refined(image, 0.5) is image
