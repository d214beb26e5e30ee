"""Docstrings and help texts as they were meant, where reStructuredText or napoleon would read them otherwise."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.ext import autosummary

_COLON = "\ue000"  # of private use


def _hide_colon(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep napoleon from taking what stands before the colon in a property's summary for its type."""
    if what == "property" and lines:
        lines[0] = lines[0].replace(": ", f"{_COLON} ")


def _show_colon(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = [line.replace(_COLON, ":") for line in lines]


def _write_dashes(app: Sphinx, doctree: nodes.document) -> None:
    """Two hyphens, which Sphinx and napoleon put behind types, are a dash; those of options are not touched."""
    for content in doctree.findall(addnodes.desc_content):
        for text in list(content.findall(nodes.Text)):
            if " -- " in text and not isinstance(text.parent, nodes.literal):
                text.parent.replace(text, nodes.Text(text.replace(" -- ", " \N{EN DASH} ")))


def _escape(app: Sphinx, ctx: Any, lines: list[str]) -> None:
    """Help texts are plain text: a star in them begins no emphasis."""
    lines[:] = [line.replace("*", r"\*") for line in lines]


def _show_as_printed(app: Sphinx, ctx: Any, lines: list[str]) -> None:
    """Examples and exit statuses at the end of a help text keep their columns."""
    if any(line.strip() for line in lines):
        lines[:] = ["::", "", *(f"   {line.removeprefix('| ')}" for line in lines), ""]


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect before and after napoleon, whose priority is 500, and to sphinx-click."""
    app.connect("autodoc-process-docstring", _hide_colon, priority=400)
    app.connect("autodoc-process-docstring", _show_colon, priority=600)
    app.connect("doctree-read", _write_dashes)
    autosummary.WELL_KNOWN_ABBREVIATIONS += ("eq.",)  # which end no summary
    for event in ("description", "options", "arguments"):
        app.connect(f"sphinx-click-process-{event}", _escape)
    app.connect("sphinx-click-process-epilog", _show_as_printed)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
