"""Pictures of steps: every layer and series is drawn, with legend, units and scale bar, and a folder holds them all."""

import numpy as np
import pytest
import shapely
from matplotlib.collections import LineCollection, PathCollection
from PIL import Image as Bitmap

from roofbench.core.errors import InputError, OutputError
from roofbench.detectors.steps import (
    Axis,
    Bars,
    Category,
    ChartPanel,
    ClassRaster,
    ColourRaster,
    Curve,
    LineLayer,
    MapPanel,
    MarkerLayer,
    OutlineLayer,
    ReliefRaster,
    Role,
    Scale,
    Step,
    TextLayer,
    ValueRaster,
)
from roofbench.reports.steps.step_colours import ROLE_COLOURS
from roofbench.reports.steps.step_figure import step_figure
from roofbench.reports.steps.step_folder import check_step_folder, write_steps

EXTENT = (1000.0, 2000.0, 1040.0, 2030.0)
HEIGHT = Scale(label="height", unit="m", low=0, high=10)
SQUARES = shapely.box([1001, 1020], [2001, 2010], [1009, 1030], [2009, 2020])
LINES = np.array([[[1001.0, 2001.0], [1020.0, 2010.0]], [[1030.0, 2020.0], [1035.0, 2029.0]]])


def a_map(*layers, **options):
    return MapPanel(extent=EXTENT, layers=layers, **options)


def texts(figure):
    """Return every text of a figure's legends and axes."""
    found = []
    for axes in figure.axes:
        found += [text.get_text() for text in axes.texts] + [axes.get_title(), axes.get_xlabel(), axes.get_ylabel()]
        found += [] if axes.get_legend() is None else [text.get_text() for text in axes.get_legend().get_texts()]
    return found


def test_a_map_has_scale_bar_legend_with_counts_and_a_colour_bar_with_its_unit():
    values = np.arange(12.0).reshape(3, 4)
    values[0, 0] = np.nan
    layers = (
        ValueRaster(values, EXTENT, HEIGHT, missing="no point"),
        OutlineLayer(SQUARES, "footprint", Role.RESULT),
        LineLayer(LINES, "short line", Role.REMOVED, marked=True),
        MarkerLayer(LINES[:, 0], "kept", Role.INPUT, "diamond"),
        TextLayer(LINES[:, 1], ("12", "$x")),
    )
    figure = step_figure(Step("all", "All.", (a_map(*layers),)))
    found = texts(figure)
    assert {"5 m", "no point", "footprint (2)", "short line (2)", "kept (2)", "12", "$x"} <= set(found)
    assert {"height, m", "east, m", "north, m"} <= set(found)
    axes = figure.axes[0]
    assert (axes.get_xlim(), axes.get_ylim()) == ((1000, 1040), (2000, 2030))


def test_row_0_of_a_raster_is_drawn_in_the_north():
    classes = np.array([[1, 1], [0, 0]])
    layer = ClassRaster(classes, EXTENT, (Category("", Role.BACKGROUND), Category("roof", Role.SOLID)))
    figure = step_figure(Step("mask", "Mask.", (a_map(layer),)))
    (image,) = figure.axes[0].images
    assert image.get_extent() == [1000, 1040, 2000, 2030]
    assert image.origin == "upper"
    assert np.asarray(image.get_array())[0, 0].max() < 0.5 < np.asarray(image.get_array())[1, 0].min()
    assert "roof" in texts(figure)
    assert "" not in [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


def test_the_lit_side_of_a_relief_faces_north_west():
    heights = np.full((30, 40), np.nan)
    heights[10:20, 10:20] = 5.0
    figure = step_figure(Step("relief", "Relief.", (a_map(ReliefRaster(heights, EXTENT)),)))
    shown = np.asarray(figure.axes[0].images[0].get_array())
    assert shown[10, 15] > shown[15, 15] > shown[20, 15]
    assert shown[15, 10] > shown[15, 15] > shown[15, 20]


def test_an_orthoimage_below_other_layers_is_light_and_grey():
    colours = np.zeros((3, 4, 3))
    colours[..., 0] = 1.0
    panels = tuple(a_map(ColourRaster(colours, EXTENT, faint=faint)) for faint in (False, True))
    figure = step_figure(Step("image", "Image.", panels, columns=2))
    plain, faint = (np.asarray(axes.images[0].get_array()) for axes in figure.axes)
    assert np.array_equal(plain, colours)
    assert faint.min() > 0.5
    assert np.ptp(faint, axis=-1).max() == 0


def test_lines_are_coloured_by_their_values():
    scale = Scale(label="mean vote", low=0, high=1, kind="diverging")
    layer = LineLayer(LINES, "line", Role.RESULT, values=np.array([0.1, 0.9]), scale=scale)
    figure = step_figure(Step("votes", "Votes.", (a_map(layer),)))
    (lines,) = [each for each in figure.axes[0].collections if isinstance(each, LineCollection)]
    figure.draw_without_rendering()
    assert len({tuple(colour) for colour in lines.get_colors()}) == 2
    assert "mean vote" in texts(figure)


def test_panels_of_one_scale_share_a_colour_bar_and_ends_are_words():
    scale = Scale(label="likeness", low=-1, high=1, kind="diverging", ends=("roof", "undecided", "tree"))
    values = np.zeros((2, 2))
    figure = step_figure(
        Step("cues", "Cues.", (a_map(ValueRaster(values, EXTENT, scale), title="one"),) * 3, columns=2)
    )
    bars = [axes for axes in figure.axes if axes.get_ylabel() == "likeness"]
    assert len(bars) == 1
    assert [label.get_text() for label in bars[0].get_yticklabels()] == ["roof", "undecided", "tree"]


def test_a_chart_has_units_curves_and_bars():
    x = np.arange(1.0, 12.0)
    share = ChartPanel(
        x=Axis(label="proposals"),
        y=Axis(label="accepted", unit="%", logarithmic=True),
        series=tuple(Curve(x, x / (20 + k), f"move {k}") for k in range(8)),
    )
    histogram = ChartPanel(
        x=Axis(label="direction", ticks={1: "one", 5: "five"}),
        y=Axis(label="length", unit="m"),
        series=(Bars(x, x, 0.8, Role.RESULT, mean=6.0),),
        title="a candidate",
    )
    figure = step_figure(Step("charts", "Charts.", (share, histogram)))
    curves, bars = figure.axes
    assert {"proposals", "accepted, %", "direction", "length, m", "a candidate"} <= set(texts(figure))
    assert curves.get_yscale() == "log"
    assert len({(line.get_color(), line.get_linestyle()) for line in curves.lines}) == 8
    assert [label.get_text() for label in bars.get_xticklabels()] == ["one", "five"]
    assert len(bars.patches) == len(x)
    assert bars.lines[0].get_ydata()[0] == 6.0


def test_holes_of_outlines_are_drawn():
    ring = shapely.box(1001, 2001, 1030, 2029).difference(shapely.box(1010, 2010, 1020, 2020))
    figure = step_figure(Step("ring", "Ring.", (a_map(OutlineLayer(np.array([ring]), "ring", Role.RESULT)),)))
    (drawn,) = [each for each in figure.axes[0].collections if isinstance(each, PathCollection)]
    assert len(drawn.get_paths()[0].vertices) == 10


def test_a_step_without_panels_says_so():
    figure = step_figure(Step("none", "None.", ()))
    assert [text.get_text() for text in figure.texts] == ["nothing to show"]


def test_every_role_has_a_colour_of_its_own():
    assert set(ROLE_COLOURS) == set(Role)
    assert len(set(ROLE_COLOURS.values())) == len(Role)


def test_a_name_that_is_no_file_name_is_refused():
    with pytest.raises(InputError, match="not fit for a file name"):
        Step("../away", "Away.", ())


def test_a_folder_holds_numbered_pictures_and_their_captions(tmp_path):
    folder = tmp_path / "steps"
    mask = ClassRaster(np.eye(2, dtype=bool), EXTENT, (Category("", Role.BACKGROUND), Category("", Role.SOLID)))
    steps = [Step("first", "One.", (a_map(mask),)), Step("second", "Two.", ())]
    check_step_folder(folder, overwrite=False)
    assert write_steps(steps, folder, title="ndsm on delft") == 2
    assert sorted(path.name for path in folder.iterdir()) == ["01-first.png", "02-second.png", "README.md"]
    assert (folder / "README.md").read_text() == "# ndsm on delft\n\n- `01-first.png`: One.\n- `02-second.png`: Two.\n"
    with Bitmap.open(folder / "01-first.png") as picture:
        assert min(picture.size) > 300
    with pytest.raises(OutputError):
        check_step_folder(folder, overwrite=False)
    check_step_folder(folder, overwrite=True)
    assert write_steps(steps[:1], folder, title="again", overwrite=True) == 1
    assert not (folder / "02-second.png").exists()


def test_nothing_is_written_when_a_step_fails(tmp_path):
    def failing():
        yield Step("first", "One.", ())
        raise RuntimeError("the detector failed")

    with pytest.raises(RuntimeError):
        write_steps(failing(), tmp_path / "steps", title="ndsm on delft")
    assert not (tmp_path / "steps").exists()
