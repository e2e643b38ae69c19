import pytest
from matplotlib.figure import Figure

from roofbench.detectors.scale_bar import add_scale_bar


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
