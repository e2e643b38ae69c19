"""Hooks of MkDocs: the pages outside ``docs/`` and the notebooks become pages of the site.

README, CHANGELOG and CONTRIBUTING stand in the root of the repository, where hosts of repositories show them. Links to
other files of the repository have no target on the site; their text remains.
"""

import json
import re
from pathlib import Path
from posixpath import dirname, normpath, relpath

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[2]

#: Pages in the root of the repository, and their names on the site.
PAGES = {"README.md": "index.md", "CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}

_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
_BLOCK = re.compile(r"(^```.*?^```[^\n]*$)", re.MULTILINE | re.DOTALL)


def on_files(files, config):
    """Add the pages of the root, and a page for each notebook."""
    for name, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text(encoding="utf-8")))
    for notebook in [file for file in files if file.src_uri.endswith(".ipynb")]:
        text = as_page(json.loads(Path(notebook.abs_src_path).read_text(encoding="utf-8")))
        files.append(File.generated(config, notebook.src_uri.replace(".ipynb", ".md"), content=text))
    return files


def on_page_markdown(markdown, page, config, files):
    """Let links lead to pages of the site."""
    source = {page: name for name, page in PAGES.items()}.get(page.file.src_uri, f"docs/{page.file.src_uri}")

    def link(match):
        mark, text, target = match.groups()
        if re.match(r"[a-z]+:|#", target):
            return match[0]
        path, _, anchor = target.partition("#")
        path = normpath(f"{dirname(source)}/{path}" if dirname(source) else path)
        path = PAGES.get(path, path.removeprefix("docs/") if path.startswith("docs/") else None)
        if path is None:
            return text
        path = re.sub(r"\.ipynb$", ".md", path)
        return f"{mark}[{text}]({relpath(path, dirname(page.file.src_uri) or '.')}{'#' + anchor if anchor else ''})"

    pieces = _BLOCK.split(markdown)
    return "".join(piece if number % 2 else _LINK.sub(link, piece) for number, piece in enumerate(pieces))


def as_page(notebook):
    """Return a notebook as Markdown with its stored outputs."""
    parts = []
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```py\n{source}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {})
            if "text/html" in data:
                # Blank lines would end the HTML block.
                html = "".join(line for line in data["text/html"] if line.strip())
                parts.append(f'<div class="output">\n{html}\n</div>')
            else:
                parts.append(f"```text\n{''.join(output.get('text') or data['text/plain']).rstrip()}\n```")
    return "\n\n".join(parts) + "\n"
