"""Options of commands below the headings of ``--help``."""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx


def _group(app: Sphinx, ctx: Any, lines: list[str]) -> None:
    """Put the paragraphs of sphinx-click, one per option, in the order of the help, with its headings."""
    if not hasattr(ctx.command, "grouped_options"):
        return
    visible = [p for p in ctx.command.params if p.param_type_name == "option" and not p.hidden]
    paragraphs: list[list[str]] = []
    for line in lines:
        if line.startswith(".. option::"):
            paragraphs.append([])
        paragraphs[-1].append(line)
    written = dict(zip((param.name for param in visible), paragraphs, strict=True))
    ordered: list[str] = []
    for heading, options in ctx.command.grouped_options(ctx).items():
        texts = [written[option.name] for option in options if option.name in written]
        if texts:
            ordered += [f".. rubric:: {heading}", "", *(line for text in texts for line in text)]
    lines[:] = ordered


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to sphinx-click."""
    app.connect("sphinx-click-process-options", _group)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
