import pytest
import shapely
from matplotlib.figure import Figure

from roofbench.reports.map_elements import add_scale_bar, polygon_paths


@pytest.mark.parametrize(
    ("width", "unit", "label", "length"),
    [(300.0, 1.0, "50 m", 50.0), (2000.0, 0.1, "20 m", 200.0), (90_000.0, 1.0, "10 km", 10_000.0)],
)
def test_the_bar_is_as_long_as_it_says(width, unit, label, length):
    axes = Figure().add_subplot()
    axes.set_xlim(0, width)
    axes.set_ylim(500, 0)  # rows run downwards
    add_scale_bar(axes, unit=unit)
    (bar,) = axes.patches
    (text,) = axes.texts
    assert text.get_text() == label
    assert bar.get_width() == pytest.approx(length)
    assert bar.get_x() + bar.get_width() < width / 2
    assert 0 < bar.get_y() < 500


def test_a_path_keeps_holes_and_parts_and_leaves_out_the_empty():
    square = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 2, 2))
    two = shapely.union_all([square, shapely.box(9, 9, 10, 10)])
    one, both = polygon_paths([square, shapely.Polygon(), two])
    assert (one.codes == one.MOVETO).sum() == 2
    assert (both.codes == both.MOVETO).sum() == 3
    # Shell and hole run opposite ways, so that the hole stays open under the non-zero rule too.
    turns = [shapely.LinearRing(ring).is_ccw for ring in (one.vertices[:5], one.vertices[5:])]
    assert turns[0] != turns[1]
