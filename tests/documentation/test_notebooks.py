"""The notebooks run, and store what they show now."""

import re

import pytest

from documentation.notebooks import NOTEBOOKS, read, run


def shown(notebook):
    """Return the texts of all outputs, without processor times."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ())]
    texts = ["".join(output.get("text") or output["data"]["text/plain"]) for output in outputs]
    return [re.sub(r"\d+(\.\d+)? s\\b", "# s", text) for text in texts]


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_shows_what_it_stores(path, tmp_path):
    stored = read(path)
    assert shown(run(stored, tmp_path)) == shown(stored), "run: python -m tests.documentation.notebooks"


def test_there_are_two_notebooks_with_tables_and_maps():
    assert [path.stem for path in NOTEBOOKS] == ["evaluate-footprints", "own-detector"]
    for path in NOTEBOOKS:
        outputs = [output for cell in read(path)["cells"] for output in cell.get("outputs", ())]
        pages = ["".join(output.get("data", {}).get("text/html", ())) for output in outputs]
        assert any("<svg" in page for page in pages)
        assert any("<table" in page for page in pages)
