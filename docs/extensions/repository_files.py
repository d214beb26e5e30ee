"""Links to files of the repository that are no page of the site, and pages that are files outside ``docs``.

A page may consist of a file elsewhere: a block ``{include} FILE`` is replaced by that file. A link to a file that is
a page, or is included by one, leads to this page; a link to a folder leads to the page that has its name; any other
file is copied into the site. Links and images count from the file in which they stand.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from urllib.parse import unquote

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

INCLUDE = re.compile(r"^```\{include\} (\S+)\n```$", re.MULTILINE)
_BLOCK = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(?P<start>\[(?:[^\[\]]|\[[^\]]*\])*\]\()(?P<target>[^)\s]+)\)")


def included_files(docs: Path) -> dict[Path, Path]:
    """Page of every file that a page includes."""
    pages: dict[Path, Path] = {}
    for page in sorted(docs.rglob("*.md")):
        for name in INCLUDE.findall(page.read_text(encoding="utf-8")):
            pages[(page.parent / name).resolve()] = page
    return pages


def rewritten(text: str, file: Path, page: Path, docs: Path) -> str:
    """Text of a file on a page, with its links as the site needs them.

    Parameters
    ----------
    text : str
    file : Path
        Where the text stands.
    page : Path
        Where it is shown.
    docs : Path
        Folder of all pages.
    """
    pages = included_files(docs)

    def of_link(link: re.Match[str]) -> str:
        return f"{link['start']}{target_on_site(link['target'], file, page, docs, pages)})"

    parts = _BLOCK.split(text)  # prose, code, prose ...
    return "".join(part if k % 2 else _LINK.sub(of_link, part) for k, part in enumerate(parts))


def target_on_site(target: str, file: Path, page: Path, docs: Path, pages: dict[Path, Path]) -> str:
    """Target of a link on a page."""
    path, mark, anchor = target.partition("#")
    if re.match(r"[a-z]+:", target) or not path:
        return target
    found = (file.parent / unquote(path)).resolve()
    if found.is_dir():
        found = next((each for each in (found.with_suffix(".md"), found / "README.md") if each.exists()), found)
    if not found.is_file():
        raise ExtensionError(f"{file}: the link {target} leads to no file and no page")
    shown = pages.get(found, found)
    relative = Path(os.path.relpath(shown, page.parent)).as_posix()
    is_page = shown.suffix == ".md" and shown.is_relative_to(docs)
    return relative + mark + anchor if is_page or shown.suffix in (".png", ".svg", ".gif") else f"path:{relative}"


def _read(app: Sphinx, docname: str, source: list[str]) -> None:
    page = Path(app.env.doc2path(docname))
    if page.suffix != ".md":
        return
    docs = Path(app.srcdir)

    def included(block: re.Match[str]) -> str:
        file = (page.parent / block[1]).resolve()
        app.env.note_dependency(str(file))
        return rewritten(file.read_text(encoding="utf-8"), file, page, docs)

    own = INCLUDE.split(source[0])
    blocks = list(INCLUDE.finditer(source[0]))
    texts = [rewritten(text, page, page, docs) for text in own[::2]]
    source[0] = texts[0] + "".join(included(block) + text for block, text in zip(blocks, texts[1:], strict=True))


def setup(app: Sphinx) -> dict[str, bool]:
    """Rewrite every page as it is read."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
