"""Figures as SVG for pages: text that can be selected, no styles, and identifiers of one page only once."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from xml.etree import ElementTree

import matplotlib
from matplotlib.figure import Figure

from excite.plots.style import DPI, literal
from regressors.quoting import printable

LARGE = 300_000  # characters; longer ones have their curves as a picture
_PIXELS = 1.35  # of a page, per point of a figure
FONTS = "DejaVu Sans, Verdana, Arial, sans-serif"
_FONT = re.compile(r"(?P<style>italic |oblique )?(?P<weight>bold |\d{3} )?(?P<size>[\d.]+)px (?P<family>.+)", re.DOTALL)
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_ROUNDED = ("d", "transform", "x", "y", "points")
_LEFT_OUT = ("metadata", "style")


def svg_text(figure: Figure, prefix: str, label: str) -> str:
    """A figure as an ``<svg>`` element, to stand in an HTML page.

    Styles become attributes, so that a page can forbid inline styles; coordinates are rounded to 0.01 pt. Where the
    text would be longer than 300,000 characters, as of the torques of a long log, curves are drawn as a picture in it.
    """
    literal(figure)
    text = _drawn(figure)
    if len(text) > LARGE:
        for ax in figure.axes:  # not those of legends, which matplotlib would misplace
            for line in ax.lines:
                line.set_rasterized(True)
        text = _drawn(figure)
    return _element(text, prefix, label)


def _drawn(figure: Figure) -> str:
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "excite"}):
        figure.savefig(stream, format="svg", dpi=DPI, metadata={"Date": None, "Creator": None})
    return stream.getvalue()


def _element(text: str, prefix: str, label: str) -> str:
    root = ElementTree.fromstring(text)
    for element in root.iter():
        for child in [child for child in element if _plain(child.tag) in _LEFT_OUT]:
            element.remove(child)
        element.tag = _plain(element.tag)
        given = dict(element.attrib)
        element.attrib.clear()
        for name, value in _attributes(given):
            element.set(name, _rounded(value) if name in _ROUNDED else _of_page(name, value, prefix))
        if element.text is not None and not element.text.strip():
            element.text = None
        element.tail = None
    for name in ("width", "height", "version"):
        root.attrib.pop(name, None)
    root.set("width", f"{_PIXELS * float(root.attrib['viewBox'].split()[2]):.0f}")
    root.attrib |= {"role": "img", "aria-label": printable(label), "font-family": FONTS}
    root.attrib |= {"stroke-linejoin": "round", "stroke-linecap": "butt"}  # of all elements, as in the style left out
    return ElementTree.tostring(root, encoding="unicode", short_empty_elements=False)


def _plain(name: str) -> str:
    """The name without its namespace, which HTML knows by itself."""
    return name.rpartition("}")[2]


def _attributes(given: dict[str, str]) -> Iterator[tuple[str, str]]:
    for name, value in given.items():
        if name == "style":
            declared = (each.partition(":") for each in value.split(";") if ":" in each)
            yield from (pair for key, _, each in declared for pair in _of_style(key.strip(), each.strip()))
        else:
            yield _plain(name), value


def _of_style(name: str, value: str) -> list[tuple[str, str]]:
    """A CSS declaration as attributes of the same name; ``font`` in its parts; the family is that of the root."""
    if name == "font-family":
        return []
    font = _FONT.fullmatch(value) if name == "font" else None
    if font is None:
        return [(name, value)]
    parts = {"font-style": font["style"], "font-weight": font["weight"], "font-size": font["size"]}
    return [(part, each.strip()) for part, each in parts.items() if each]


def _of_page(name: str, value: str, prefix: str) -> str:
    """An identifier, or a reference to one, as unique as the prefix."""
    if name == "id":
        return f"{prefix}-{value}"
    if name == "href" and value.startswith("#"):
        return f"#{prefix}-{value[1:]}"
    return value.replace("url(#", f"url(#{prefix}-")


def _rounded(text: str) -> str:
    return _NUMBER.sub(lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), " ".join(text.split()))
