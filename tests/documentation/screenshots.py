"""Pictures of what people look at: the report (desktop, dark, phone, print), a notebook, and a terminal of 80 columns.

``python -m tests.documentation.screenshots REPORT.html SITE FOLDER`` needs Chromium with its driver, and pdftoppm. The
text of the terminal is read from standard input. REPORT is a report of roofbench, SITE the folder of ``mkdocs build``.
"""

from __future__ import annotations

import base64
import io
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
LIGHT = [{"name": "prefers-color-scheme", "value": "light"}]
sys.path.insert(0, str(ROOT / "tests"))


def save(picture: bytes, file: Path) -> None:
    """Write a PNG with 256 colours; the octree keeps rare colours, such as that of a single false alarm."""
    reduced = Image.open(io.BytesIO(picture)).convert("RGB").quantize(256, method=Image.Quantize.FASTOCTREE)
    reduced.save(file, optimize=True)


def shoot(driver: Any, page: str, file: Path, *, width: int, height: int, media: Mapping[str, str]) -> None:
    """Photograph a page at a size, with media features such as ``prefers-color-scheme``."""
    phone = {"width": width, "height": height, "deviceScaleFactor": 2 if width < 500 else 1, "mobile": width < 500}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", phone)
    features = [{"name": name, "value": value} for name, value in media.items() if name != "type"]
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media.get("type", ""), "features": features})
    driver.get(page)
    driver.implicitly_wait(1)
    save(base64.b64decode(driver.get_screenshot_as_base64()), file)


def shoot_object(driver: Any, page: str, file: Path, *, scene: str, detector: str) -> None:
    """Photograph the map of a report with a reference chosen that was merged with another one."""
    from selenium.webdriver.support.ui import Select

    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": LIGHT})
    size = {"width": 1400, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.get(page)
    Select(driver.find_element("id", "scene")).select_by_visible_text(scene)
    for box in driver.find_elements("css selector", "#detectors label"):
        switch = box.find_element("css selector", "input")
        if switch.is_selected() != box.text.startswith(detector):
            switch.click()
    detail = driver.find_element("id", "detail")
    for _ in range(50):
        driver.find_element("id", "next-error").click()
        if "merged" in detail.text:
            break
    driver.find_element("id", "zoom-fit").click()
    driver.execute_script("document.getElementById('viewer').scrollIntoView()")
    save(driver.find_element("id", "viewer").screenshot_as_png, file)


def terminal(text: str) -> str:
    """Return a page that looks like a terminal of 80 columns."""
    return (
        "<meta charset='utf-8'><body style='margin:0;background:#1e1e1e;color:#e8e8e8'>"
        f"<pre style='font:15px/1.25 monospace;padding:14px;margin:0'>{escape(text)}</pre>"
    )


def main(report: str, site: str, folder: str) -> None:
    """Write the pictures into a folder."""
    from harness.browser import chromium

    report_page = Path(report).resolve().as_uri()
    light, dark = ({"prefers-color-scheme": scheme} for scheme in ("light", "dark"))
    target = Path(folder)
    with tempfile.TemporaryDirectory() as profile, chromium(profile) as driver:
        shoot(driver, report_page, target / "report.png", width=1400, height=1000, media=light)
        shoot(driver, report_page, target / "report-dark.png", width=1400, height=1000, media=dark)
        shoot(driver, report_page, target / "report-phone.png", width=390, height=844, media=dark)
        notebook = (Path(site).resolve() / "notebooks" / "evaluate-footprints.html").as_uri()
        shoot(driver, notebook, target / "notebook.png", width=1300, height=1000, media=light)
        shoot_object(driver, report_page, target / "report-object.png", scene="knox-small-1", detector="mpp")
        printed = terminal(sys.stdin.read())
        page = Path(profile) / "terminal.html"
        page.write_text(printed, encoding="utf-8")
        lines = printed.count("\n") + 1
        shoot(driver, page.as_uri(), target / "terminal.png", width=760, height=19 * lines + 28, media=light)
        driver.get(report_page)
        document = driver.execute_cdp_cmd("Page.printToPDF", {"paperWidth": 8.27, "paperHeight": 11.69})["data"]
        (Path(profile) / "print.pdf").write_bytes(base64.b64decode(document))
        command = ["pdftoppm", "-png", "-r", "80", "-f", "1", "-l", "1", "-singlefile", f"{profile}/print.pdf"]
        subprocess.run([*command, f"{profile}/print"], check=True)
        save((Path(profile) / "print.png").read_bytes(), target / "report-print.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
