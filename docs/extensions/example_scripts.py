"""A block ``{scripts} FOLDER`` becomes the scripts of a folder, each below a heading."""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

BLOCK = re.compile(r"^```\{scripts\} (\S+)\n```$", re.MULTILINE)


def _shown(page: Path, folder: str) -> str:
    scripts = sorted((page.parent / folder).glob("*.py"))
    return "\n\n".join(
        f"## {script.name}\n\n```{{literalinclude}} {folder}/{script.name}\n:language: python\n```"
        for script in scripts
    )


def _read(app: Sphinx, docname: str, source: list[str]) -> None:
    page = Path(app.env.doc2path(docname))
    if page.suffix == ".md":
        source[0] = BLOCK.sub(lambda block: _shown(page, block[1]), source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Expand the blocks as pages are read."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
