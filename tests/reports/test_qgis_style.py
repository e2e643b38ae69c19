"""GeoPackages of verdicts carry a style for QGIS: coloured by verdict, labelled by reason on large scales."""

import os
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path
from xml.etree import ElementTree

import pytest
import shapely

import roofbench as rb
from roofbench.reports.qgis_style import Category, qgis_style
from roofbench.reports.verdict_layers import write_pair, write_verdicts
from roofbench.reports.verdict_style import ROLE_STYLE

SQUARES = shapely.box([0, 20, 40], [0, 0, 0], [10, 30, 50], [10, 10, 10])
FOUND = rb.Footprints.of([*SQUARES[:2], shapely.box(70, 0, 80, 10)], crs="EPSG:25832")
REFERENCE = rb.Footprints.of(SQUARES, crs="EPSG:25832")


def styles_of(path):
    """Return layer to parsed style, as QGIS finds them."""
    with closing(sqlite3.connect(path)) as connection:
        rows = connection.execute(
            "SELECT f_table_name, styleQML FROM layer_styles JOIN gpkg_geometry_columns ON table_name = f_table_name "
            "AND column_name = f_geometry_column WHERE useAsDefault = 1"
        ).fetchall()
    return {layer: ElementTree.fromstring(text.partition("\n")[2]) for layer, text in rows}


@pytest.fixture
def verdicts(tmp_path):
    write_verdicts(rb.evaluate(FOUND, REFERENCE).verdicts, tmp_path / "verdicts.gpkg")
    return tmp_path / "verdicts.gpkg"


def test_each_layer_is_coloured_by_verdict_and_labelled_by_reason(verdicts):
    styles = styles_of(verdicts)
    assert set(styles) == {"detections", "references"}
    renderer = styles["detections"].find("renderer-v2")
    assert renderer.get("attr") == "verdict"
    colours = {}
    for category in renderer.iter("category"):
        symbol = renderer.find(f"symbols/symbol[@name='{category.get('symbol')}']")
        colours[category.get("value")] = symbol.find(".//prop[@k='outline_color']").get("v")
    red, green, blue = (int(ROLE_STYLE["correct"].colour[place : place + 2], 16) for place in (1, 3, 5))
    assert colours["TP"] == f"{red},{green},{blue},255"
    assert {"TP", "FP", "MD"} <= set(colours)
    assert styles["references"].find("labeling/settings/text-style").get("fieldName") == "reason"
    assert styles["references"].find("labeling/settings/rendering").get("scaleVisibility") == "1"


def test_a_comparison_is_coloured_by_fate(tmp_path):
    write_pair(rb.compare(FOUND, REFERENCE, REFERENCE), tmp_path / "pair.gpkg")
    styles = styles_of(tmp_path / "pair.gpkg")
    assert set(styles) == {"references", "detections_a", "detections_b"}
    values = [category.get("value") for category in styles["references"].iter("category")]
    assert values == ["both", "only A", "only B", "neither", "left out"]


def test_the_file_is_read_as_before_and_equal_content_gives_equal_bytes(verdicts, tmp_path):
    assert len(rb.read_footprints(f"{verdicts}|layername=references")) == 3
    with pytest.raises(rb.RoofbenchError, match=r"has 2 layers \(detections, references\)"):
        rb.read_footprints(verdicts)
    write_verdicts(rb.evaluate(FOUND, REFERENCE).verdicts, tmp_path / "again.gpkg")
    assert verdicts.read_bytes() == (tmp_path / "again.gpkg").read_bytes()


def test_words_of_an_evaluator_are_escaped():
    text = qgis_style("verdict", [Category('<"&', "<b>", "#000000", 0.5)], label="reason")
    category = ElementTree.fromstring(text.partition("\n")[2]).find(".//category")
    assert (category.get("value"), category.get("label")) == ('<"&', "<b>")


RENDER = """
import sys
from qgis.core import QgsApplication, QgsVectorLayer
app = QgsApplication([], False)
app.initQgis()
for name in ("detections", "references"):
    layer = QgsVectorLayer(f"{sys.argv[1]}|layername={name}", name, "ogr")
    assert layer.isValid()
    settings = layer.labeling().settings()
    renderer = layer.renderer()
    words = type(renderer).__name__, renderer.classAttribute(), settings.fieldName, settings.minimumScale
    print(*words, flush=True)
"""


def test_qgis_uses_the_style_when_it_opens_the_file(verdicts):
    """Skipped where no QGIS is installed for the Python of the system."""
    python = Path("/usr/bin/python3")
    environment = {"PATH": os.environ["PATH"], "QT_QPA_PLATFORM": "offscreen"}
    if (
        not python.exists()
        or subprocess.run([python, "-c", "import qgis.core"], env=environment, capture_output=True).returncode
    ):
        pytest.skip("needs QGIS")
    done = subprocess.run([python, "-c", RENDER, verdicts], env=environment, capture_output=True, text=True)
    assert done.stdout.splitlines() == ["QgsCategorizedSymbolRenderer verdict reason 1500.0"] * 2, done.stderr
