"""Figures as SVG in pages: identifiers of their own, no styles, texts as they are, and never huge."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from excite.views.figure_files import LARGE, svg_text


def figure(points: int = 10, title: str = "title") -> Figure:
    made = Figure(figsize=(3.0, 2.0))
    ax = made.subplots()
    ax.plot(np.arange(points), np.random.default_rng(0).normal(size=points), "o-", label="curve")
    ax.set_title(title, fontweight="bold", fontstyle="italic")
    ax.legend()
    return made


def test_styles_are_attributes_and_identifiers_begin_with_the_prefix() -> None:
    root = ElementTree.fromstring(svg_text(figure(), "p1", 'a "label" <b>'))
    elements = list(root.iter())
    assert root.tag == "svg"
    assert root.get("aria-label") == 'a "label" <b>'
    assert not any("style" in each.attrib or each.tag == "style" for each in elements)
    identifiers = {each.get("id") for each in elements} - {None}
    assert identifiers
    assert all(str(each).startswith("p1-") for each in identifiers)
    for each in elements:
        assert each.get("href", "#p1-").startswith("#p1-")
        assert "url(#" not in each.get("clip-path", "") or "url(#p1-" in each.get("clip-path", "")
    title = next(each for each in root.iter("text") if each.text == "title")
    assert (title.get("font-weight"), title.get("font-style")) in (("700", "italic"), ("bold", "italic"))


@pytest.mark.parametrize("name", ['<script>x</script> style="a:b" id="c"', "a & b", "$x$", "\x1b[31m"])
def test_names_are_texts(name: str) -> None:
    root = ElementTree.fromstring(svg_text(figure(title=name), "p", name))
    shown = [each.text for each in root.iter("text")]
    assert name.replace("\x1b", "\\x1b") in shown
    assert not list(root.iter("script"))


def test_the_same_figure_has_the_same_text() -> None:
    assert svg_text(figure(), "p", "l") == svg_text(figure(), "p", "l")


def test_long_curves_become_a_picture() -> None:
    text = svg_text(figure(20000), "p", "l")
    assert len(text) < LARGE
    images = list(ElementTree.fromstring(text).iter("image"))
    assert images
    assert all(str(each.get("href")).startswith("data:image/png") for each in images)
