"""What notebooks show: escaped, self-contained and small, and a short line in a terminal."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.reports.svg_map import crowded_window
from roofbench.scenes.builtin import hamlet

HOSTILE = '<script>alert("1")</script>'
SQUARES = shapely.box([0, 20, 40], [0, 0, 0], [10, 30, 50], [10, 10, 10])


@dataclass(frozen=True, kw_only=True)
class Hostile(rb.Detector):
    """<script>alert("doc")</script>"""

    name = "<script>"
    text: str = rb.parameter("", doc=HOSTILE)

    def detect(self, scene, rng):
        return rb.Footprints.empty()


@pytest.fixture(scope="module")
def shown():
    found = rb.Footprints.of(SQUARES[:2], crs="EPSG:28992", source=HOSTILE, attributes={HOSTILE: [1, 2]})
    scene = hamlet(1)
    named = rb.Scene(HOSTILE, scene.extent, facts={"source": HOSTILE}, points=scene.points, reference=scene.reference)
    evaluation = rb.evaluate(found, SQUARES)
    return {
        "footprints": found,
        "nothing": rb.Footprints.empty(),
        "evaluation": evaluation,
        "pooled": rb.pool([evaluation, evaluation]),
        "all": rb.evaluate(found, SQUARES, evaluator="all"),
        "verdicts": evaluation.verdicts,
        "pair": rb.compare(found, SQUARES, SQUARES),
        "scene": named,
        "detector": rb.make_detector("ndsm", height=3),
        "hostile": Hostile(text=HOSTILE),
        "evaluator": rb.make_evaluator(),
        "board": rb.run([named], ["ndsm"]),
    }


def test_views_are_escaped_self_contained_and_small(shown):
    for name, value in shown.items():
        text = value._repr_html_()
        assert "<script" not in text, name
        assert not [word for word in ("src=", "@import", "url(") if word in text], name
        assert text.replace("http://www.w3.org/2000/svg", "").count("http") == 0, name
        assert 100 < len(text) < 100_000, name
        ET.fromstring(f"<view>{text.replace('<br>', '')}</view>")


def test_views_show_what_a_person_wants_to_see(shown):
    view = {name: value._repr_html_() for name, value in shown.items()}
    assert "<svg" in view["footprints"]
    assert "EPSG:28992" in view["footprints"]
    for word in ("<svg", "TP: detected building", "FN: missed reference", "completeness", "66.67 %"):
        assert word in view["evaluation"]
    assert "<svg" not in view["pooled"]
    assert "rutzinger" in view["all"]
    assert "only B finds it" in view["pair"]
    assert "data:image/webp;base64," in view["scene"]
    assert "<b>3 m</b>" in view["detector"]
    assert "least height above ground" in view["detector"]
    assert "Q_l" in view["board"] or "quality" in view["board"]


def test_a_line_in_a_terminal_is_short(shown):
    for name in ("footprints", "evaluation", "verdicts", "pair", "scene", "detector", "board"):
        assert len(repr(shown[name])) < 200, name
    assert repr(shown["evaluation"]).startswith("<Evaluation threshold-free: Q_l 0.667, C_m 0.667, C_r 1")
    assert repr(shown["verdicts"]) == "<Verdicts 2 detections (2 TP), 3 references (2 TP, 1 FN)>"
    assert repr(shown["pair"]) == "<PairedComparison by threshold-free: 2 both, 1 only B>"


def test_a_city_is_shown_by_its_most_crowded_part():
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    city = rb.Footprints.of(shapely.box(20 * x.ravel(), 20 * y.ravel(), 20 * x.ravel() + 9, 20 * y.ravel() + 9))
    window = crowded_window(city.polygons)
    assert 1900 < shapely.intersects(city.polygons, shapely.box(*window)).sum() < 2200
    text = city._repr_html_()
    assert "the most crowded part of 3,600 outlines" in text
    assert len(text) < 100_000
    assert crowded_window(city.polygons[:2000]) is None
