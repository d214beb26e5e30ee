"""Colours of figures on a dark page: readable, of the same hue, and still different from each other."""

from __future__ import annotations

import colorsys
import itertools
import re
from pathlib import Path

import pytest

from excite.views import style
from excite.views.drawings import CARD, contrast, dark, dark_rules

MEANINGS = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)


def _hue(colour: str) -> float:
    return colorsys.rgb_to_hsv(*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)))[0]


@pytest.mark.parametrize("colour", MEANINGS)
def test_colours_that_mean_something_keep_their_hue_and_stand_out(colour: str) -> None:
    assert contrast(dark(colour), CARD) >= 3.0
    assert abs(_hue(dark(colour)) - _hue(colour)) < 0.04


def test_they_stay_different() -> None:
    for one, other in itertools.combinations(map(dark, MEANINGS), 2):
        steps = [abs(int(one[k : k + 2], 16) - int(other[k : k + 2], 16)) for k in (1, 3, 5)]
        assert max(steps) > 40, (one, other)


@pytest.mark.parametrize("colour", [style.DARK, "#000000"])
def test_text_is_readable(colour: str) -> None:
    assert contrast(dark(colour), CARD) >= 4.5


@pytest.mark.parametrize("colour", [style.BAND, style.FORBIDDEN, "#DDDDDD", "#EDEDED"])
def test_faint_tints_stay_faint(colour: str) -> None:
    assert 1.1 < contrast(dark(colour), CARD) < 3.0


def test_paper_becomes_the_card() -> None:
    css = (Path(style.__file__).parent / "page" / "style.css").read_text()
    assert dark("#ffffff") == CARD
    assert f"--card: {CARD}" in css


def test_every_colour_of_a_figure_has_a_rule_for_screens_only() -> None:
    rules = dark_rules(['<path fill="#0072b2" stroke="#333333"/>', '<path fill="#0072b2"/>'])
    assert re.findall(r'\[(\w+)="(#\w+)"\]', rules) == [("fill", "#0072b2"), ("stroke", "#333333")]
    assert rules.strip().startswith("@media screen and (prefers-color-scheme: dark)")
    assert dark_rules([]) == ""
