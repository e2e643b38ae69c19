"""Write the generated pages of ``docs/reference``: all indices, the command line and the Python API.

``python -m tests.documentation.reference`` writes them; a test compares them with the code.
"""

from __future__ import annotations

from pathlib import Path

from . import api, command_line, indices

__all__ = ["generated"]

ROOT = Path(__file__).resolve().parents[2]


def generated() -> dict[str, str]:
    """Return the text of every generated file by its path below ``docs``."""
    return {
        "reference/indices.md": indices.page(),
        "reference/cli.md": command_line.page(),
        "reference/api.md": api.page(),
        **{f"images/{name}": text for name, text in indices.drawings().items()},
    }


if __name__ == "__main__":
    for name, text in generated().items():
        (ROOT / "docs" / name).write_text(text, encoding="utf-8")
