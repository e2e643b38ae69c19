"""The site of the documentation builds without a warning, and reads and searches without a network."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from harness.browser import chromium

ROOT = Path(__file__).resolve().parents[2]
pytest.importorskip("material", reason="the extra [test] brings mkdocs-material")
#: What a browser loads by itself: stylesheets, scripts, pictures, fonts. Links of the text are none of these.
LOADED = re.compile(r"""<(?:link|script|img|iframe|source)\b[^>]*?(?:href|src)=["']?(https?:|//)[^"'> ]*""")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Build it as CI and a writer do: broken links and anchors are errors (`strict` in mkdocs.yml)."""
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "-q", "-f", str(ROOT / "mkdocs.yml"), "-d", str(folder)],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )
    assert built.returncode == 0, built.stderr
    return folder


def test_every_page_and_picture_is_on_the_site(site):
    pages = {path.relative_to(ROOT / "docs").with_suffix(".html") for path in ROOT.glob("docs/**/*.md")}
    assert [str(page) for page in pages if not (site / page).exists()] == []
    assert (site / "index.html").exists()
    assert (site / "changelog.html").exists()


def test_the_site_loads_nothing_from_elsewhere(site):
    pages = [path.read_text(encoding="utf-8") for path in site.rglob("*.html")]
    assert len(pages) > 20
    assert [found[0] for page in pages for found in LOADED.finditer(page)] == []
    styles = [path.read_text(encoding="utf-8") for path in site.rglob("*.css")]
    assert [found[0] for style in styles for found in re.finditer(r"url\(\s*[\"']?(https?:|//)", style)] == []


def test_the_site_is_searched_when_it_is_opened_as_files(site, tmp_path):
    with chromium(tmp_path) as driver:
        driver.get((site / "index.html").as_uri() + "?q=cross-lap")
        from selenium.webdriver.support.ui import WebDriverWait

        found = WebDriverWait(driver, 30).until(
            lambda page: page.find_elements("css selector", ".md-search-result__item a")
        )
        assert any("glossary" in link.get_attribute("href") for link in found)
        assert [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE"] == []
