"""One colour and one hatch per unit, the same in every figure of every robot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib.patches import Patch

from excite.plots.style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION, typeset

_YELLOW = "#F0E442"  # of the same palette
_LINEAR = "////"  # units of prismatic joints, whose quantity has the colour of the revolute ones
# Hatches tell units apart in print without colours.
_LOOKS = {
    "kg m^2": (BLUE, ""),
    "kg m": (ORANGE, ""),
    "kg": (SKY, ".."),
    "Nm": (GREEN, ""),
    "N": (GREEN, _LINEAR),
    "Nm s/rad": (PURPLE, "\\\\"),
    "N s/m": (PURPLE, _LINEAR),
    "Nm/rad": (SKY, "\\\\"),
    "N/m": (SKY, _LINEAR),
    "Nm/Nm": (VERMILLION, ""),
    "N/N": (VERMILLION, _LINEAR),
    "Nm (s/rad)^0.5": (_YELLOW, ""),
    "N (s/m)^0.5": (_YELLOW, _LINEAR),
}
_OTHER = (GREY, "xx")


def unit_style(unit: str) -> dict[str, Any]:
    """Style of a patch that shows a value in a unit; units that no built-in model has are grey."""
    colour, hatch = _LOOKS.get(unit, _OTHER)
    return {"facecolor": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0.0}


def unit_patches(units: Iterable[str]) -> list[Patch]:
    """Entries of a legend for units, one for all that no built-in model has."""
    given = list(dict.fromkeys(units))
    others = [unit for unit in given if unit not in _LOOKS]
    patches = [Patch(**unit_style(unit), label=typeset(unit)) for unit in given if unit in _LOOKS]
    if others:
        patches.append(Patch(**unit_style(others[0]), label=typeset(", ".join(unit or "none" for unit in others))))
    return patches
