"""Equations as drawings within the page, by Matplotlib: no script, no font and no address from elsewhere.

Matplotlib knows most of LaTeX's mathematics, but no matrices. An equation that it does not know is a warning.
"""

from __future__ import annotations

import re
from html import escape
from typing import Any

import matplotlib as mpl
import numpy as np
from docutils import nodes
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath
from sphinx.application import Sphinx
from sphinx.util import logging

_LOGGER = logging.getLogger(__name__)
_SIZE = 100.0  # points of the drawing, the size in which Matplotlib has glyphs
_EM = 84.0  # of these are an em of the text around, whose letters are larger for their size
_DRAWN = {0: "", 1: "M", 2: "L", 3: "Q", 4: "C", 79: "Z"}  # Matplotlib's codes of paths, in SVG's
_POINTS = {2: 1, 1: 1, 3: 2, 4: 3, 79: 1}
_OTHER_WORDS = {r"\tfrac": r"\frac", r"\lVert": r"\|", r"\rVert": r"\|", r"\top": r"\mathsf{T}", r"\le": r"\leq"}


def _path(vertices: Any, codes: Any) -> str:
    """Outline of the glyphs; in SVG the second coordinate points down."""
    parts, k = [], 0
    while k < len(codes):
        count = _POINTS[int(codes[k])]
        points = "" if codes[k] == 79 else " ".join(f"{x:.4g} {-y:.4g}" for x, y in vertices[k : k + count])
        parts.append(_DRAWN[int(codes[k])] + points)
        k += count
    return "".join(parts)


def drawing(tex: str, *, displayed: bool = False) -> str:
    """Equation as SVG that is as high as the letters around it, in their colour.

    Parameters
    ----------
    tex : str
    displayed : bool
        On a line of its own, with fractions in full size.

    Raises
    ------
    ValueError
        Matplotlib does not know what it says.
    """
    source = re.sub(r"\\[a-zA-Z]+", lambda word: _OTHER_WORDS.get(word[0], word[0]), " ".join(tex.split()))
    if displayed:
        source = source.replace(r"\frac", r"\dfrac")
    with mpl.rc_context({"mathtext.fontset": "cm"}):
        font, paths = FontProperties(size=_SIZE), TextToPath()
        vertices, codes = paths.get_text_path(font, f"${source}$", ismath=True)
        width, height, depth = paths.get_text_width_height_descent(f"${source}$", font, ismath=True)
    outline = _path(np.asarray(vertices), codes)
    box = f"0 {-(height - depth):.4g} {width:.4g} {height:.4g}"
    style = f"width:{width / _EM:.4g}em;height:{height / _EM:.4g}em;vertical-align:{-depth / _EM:.4g}em"
    label = escape(" ".join(tex.split()), quote=True)
    return (
        f'<svg class="equation" role="img" aria-label="{label}" viewBox="{box}" style="{style}">'
        f'<path fill="currentColor" d="{outline}"/></svg>'
    )


def _drawn(node: nodes.Element, *, displayed: bool = False) -> str:
    try:
        return drawing(node.astext(), displayed=displayed)
    except ValueError as error:
        _LOGGER.warning("an equation that cannot be drawn: %s", " ".join(str(error).split()), location=node)
        return ""


def inline(writer: Any, node: nodes.math) -> None:
    """Write an equation within a sentence."""
    writer.body.append(_drawn(node))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.math_block) -> None:
    """Write an equation on a line of its own."""
    writer.body.append(f'<div class="math">{_drawn(node, displayed=True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer as ``html_math_renderer = "drawn"``."""
    app.add_html_math_renderer("drawn", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
