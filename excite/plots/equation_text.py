"""Texts beside an equation in figures: its quantity, and the error of its prediction."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from excite.plots.panels import value_axis
from excite.plots.style import DARK, VERMILLION, significant
from regressors.samples import Array

_QUANTITIES = {"Nm": "torque", "N": "force", "J": "work", "N s": "impulse", "Nm s": "angular impulse"}
_LARGE = 0.5  # relative error above which the note is highlighted


def label_equation(ax: Axes, unit: str) -> None:
    """Write quantity and unit of an equation beside its panel."""
    value_axis(ax, f"{_QUANTITIES.get(unit, 'value')} [{unit}]")


def relative_error(measured: Array, predicted: Array) -> str:
    """``||y - y_predicted|| / ||y||`` in percent; a text where all measured values are zero."""
    size = float(np.linalg.norm(measured))
    return f"{significant(100 * float(np.linalg.norm(measured - predicted)) / size, 3)} %" if size > 0 else "undefined"


def error_note(measured: Array, predicted: Array, unit: str) -> tuple[str, str]:
    """Error of one equation as text, and the text's colour."""
    rms, size = (float(np.sqrt(np.mean(x**2))) for x in (measured - predicted, measured))
    return error_text(rms, size, unit, relative_error(measured, predicted)), VERMILLION if rms > _LARGE * size else DARK


def error_text(rms: float, size: float, unit: str, relative: str) -> str:
    """Root mean square of the differences and of the measured values [unit], and their ratio."""
    return f"rms error {significant(rms, 3)} {unit} of {significant(size, 3)} {unit}: {relative}"
