"""The report as a browser shows it."""

import json
import re
from dataclasses import replace
from functools import cache

import pytest
from builders.report_builder import make_report
from harness.browser import chromium

from roofbench.benchmark.analysis.results import UnsuccessfulRun
from roofbench.reports.html_report import html_report

HOSTILE = (
    "<script>window.harmed = true</script>",
    """"><img src=x onerror="window.harmed=true">'&amp;\n${window.harmed=true} $x^2$ </script><!-- \\ {{ 7*7 }}""",
)
LONG = "long " + "x" * 5000


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@cache
def page_of(labels=("first", "second"), scenes=("hamlet-1", "hamlet-2"), title="A report"):
    return html_report(make_report(labels, scenes, title))


@pytest.fixture
def show(driver, tmp_path):
    def opened(html):
        driver.get_log("browser"), driver.get_log("performance")  # what came before
        page = tmp_path / "report.html"
        page.write_text(html, encoding="utf-8")
        driver.get(page.as_uri())
        return driver

    return opened


def requested(driver):
    """Return what the page asked for, but for itself, data within it, and the browser's own start page."""
    messages = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    return [url for url in urls if not url.startswith(("file:", "data:", "chrome:"))]


def names(driver):
    rows = driver.find_elements("css selector", "table.board tbody tr")
    return [row.find_element("css selector", ".name").text for row in rows if row.is_displayed()]


def shapes(driver, place=0):
    found = driver.execute_script(
        "return [...document.querySelectorAll(`[data-overlay='${arguments[0]}'] path.shape`)]"
        ".filter((path) => path.getClientRects().length && getComputedStyle(path.parentNode).display !== 'none')"
        ".map((path) => path.dataset.verdict)",
        place,
    )
    return sorted(found)


def click_on(driver, verdict):
    driver.execute_script(
        """
        const path = document.querySelector(`path.shape[data-verdict='${arguments[0]}']`);
        const box = path.getBoundingClientRect();
        const where = { clientX: box.x + box.width / 2, clientY: box.y + box.height / 2, pointerId: 1, bubbles: true };
        path.dispatchEvent(new PointerEvent("pointerdown", where));
        path.dispatchEvent(new PointerEvent("pointerup", where));
        """,
        verdict,
    )


def test_no_console_message_and_no_request(show):
    driver = show(page_of())
    assert driver.get_log("browser") == []
    assert requested(driver) == []
    assert driver.execute_script("return performance.getEntriesByType('resource').length") == 0


def test_the_policy_stops_what_a_page_must_not_do(show):
    driver = show(page_of())
    driver.execute_script(
        "const s = document.createElement('script'); s.textContent = 'window.harmed = 1'; document.body.append(s)"
    )
    driver.execute_script("const i = new Image(); i.src = 'https://example.org/x.png'; document.body.append(i)")
    assert driver.execute_script("return window.harmed") is None
    assert all("Content Security Policy" in entry["message"] for entry in driver.get_log("browser"))


def test_a_click_on_a_column_sorts_by_it(show):
    driver = show(page_of())
    assert names(driver) == ["first", "second"]
    head = next(h for h in driver.find_elements("css selector", "table.board th") if h.text.startswith("CPU"))
    head.find_element("css selector", "button").click()
    assert names(driver) == ["second", "first"]
    assert head.get_attribute("aria-sort") == "ascending"
    head.find_element("css selector", "button").click()
    assert names(driver) == ["first", "second"]


def test_pooled_and_mean_are_switched(show):
    driver = show(page_of())
    driver.find_element("css selector", "button[value='mean']").click()
    rows = [row for row in driver.find_elements("css selector", "table.board tbody tr") if row.is_displayed()]
    assert [row.get_attribute("data-pooling") for row in rows] == ["mean", "mean"]


def test_a_click_on_a_false_alarm_shows_why(show):
    driver = show(page_of())
    click_on(driver, "FP")
    detail = driver.find_element("id", "detail").text
    assert "false alarm: overlaps no reference" in detail
    assert "48.0 m²" in detail
    click_on(driver, "TP")
    detail = driver.find_element("id", "detail").text
    assert re.search(r"found reference \d+, shifted 0\.6 m", detail)
    assert "IoU" in detail
    assert "centre distance\n0.58 m" in detail


def test_switching_detectors_and_verdicts_changes_the_map(show):
    driver = show(page_of())
    assert "FP" in shapes(driver, 0)
    assert shapes(driver, 1) == []
    boxes = driver.find_elements("css selector", "#detectors input")
    boxes[0].click()
    boxes[1].click()
    assert shapes(driver, 0) == []
    assert {"TP", "MD", "FN"} == set(shapes(driver, 1))
    driver.find_element("css selector", "#verdicts input[data-verdict='FN']").click()
    assert {"TP", "MD"} == set(shapes(driver, 1))


def test_zooming_moving_and_stepping_through_errors(show):
    driver = show(page_of())
    box = "return document.querySelector('#frame svg').getAttribute('viewBox')"
    before = driver.execute_script(box)
    driver.find_element("id", "zoom-in").click()
    zoomed = driver.execute_script(box)
    assert float(zoomed.split()[2]) < float(before.split()[2])
    driver.find_element("id", "zoom-fit").click()
    assert driver.execute_script(box) == before
    driver.execute_script(
        "document.querySelector('#frame svg').dispatchEvent(new WheelEvent('wheel', "
        "{ deltaY: -120, clientX: 300, clientY: 600, cancelable: true }))"
    )
    assert driver.execute_script(box) != before
    driver.find_element("id", "next-error").click()
    first = driver.find_element("id", "detail").text
    driver.find_element("id", "next-error").click()
    assert driver.find_element("id", "detail").text != first


def test_the_gallery_leads_to_the_map(show):
    driver = show(page_of())
    driver.find_element("css selector", "button.worst").click()
    assert "false alarm" in driver.find_element("id", "detail").text


def test_another_scene_is_shown(show):
    driver = show(page_of())
    driver.find_element("css selector", "button.open[value='1']").click()
    assert driver.find_element("id", "scene").get_attribute("value") == "1"
    assert driver.get_log("browser") == []


def test_dark_and_light(show):
    driver = show(page_of())
    colour = "return getComputedStyle(document.body).backgroundColor"
    before = driver.execute_script(colour)
    driver.find_element("id", "theme").click()
    assert driver.execute_script(colour) != before


@pytest.mark.parametrize("width", [390, 1400])
@pytest.mark.parametrize("labels", [("first", "second"), (*HOSTILE,), (LONG, LONG.upper())])
def test_the_page_is_as_wide_as_the_screen(show, driver, width, labels):
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500},
    )
    show(page_of(labels=labels))
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_hostile_names_do_no_harm(show):
    driver = show(page_of(labels=HOSTILE, scenes=(*reversed(HOSTILE),), title=HOSTILE[1]))
    click_on(driver, "FP")
    assert driver.execute_script("return window.harmed") is None
    assert driver.get_log("browser") == []
    assert requested(driver) == []
    # \n in HTML text is white space; the rest is shown as it is.
    shown = driver.find_element("css selector", "h1").get_attribute("textContent")
    assert shown == HOSTILE[1]
    assert driver.find_element("css selector", "#detectors .text").get_attribute("textContent") == HOSTILE[0]
    assert HOSTILE[0] in driver.find_element("id", "detail").text


def test_links_and_drawings_in_names_and_reasons_do_no_harm(show):
    link, drawing = "javascript:window.harmed=true", """'><svg onload="window.harmed=true"></svg></script>"""
    report = make_report(labels=(link, drawing), scenes=(drawing, link), title=link)
    failure = UnsuccessfulRun(
        status="failed", label=link, scene=drawing, seed=0, reason=f"{drawing} {HOSTILE[0]}", command=link
    )
    driver = show(html_report(replace(report, boards=(replace(report.boards[0], unsuccessful=(failure,)),))))
    click_on(driver, "FP")
    assert driver.execute_script("return window.harmed") is None
    assert driver.get_log("browser") == []
    assert requested(driver) == []
    assert not driver.find_elements("css selector", "[onload], [href^='javascript:'], [src^='javascript:']")
    assert failure.reason in driver.find_element("id", "unsuccessful").get_attribute("textContent")


def test_a_report_without_scenes_has_no_map(show):
    parts = ("scenes", "errors", "sizes", "sensitivities", "costs")
    driver = show(html_report(replace(make_report(), matrix={}, comparison=None, **dict.fromkeys(parts, ()))))
    assert driver.get_log("browser") == []
    assert not driver.find_elements("id", "frame")
