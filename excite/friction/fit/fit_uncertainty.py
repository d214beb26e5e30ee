"""Uncertainty of the parameters of a fitted curve, by their keys in a friction file."""

from __future__ import annotations

import numpy as np
import scipy.stats

from excite.friction.fit.curve_fit import CONFIDENCE, CurveFit
from excite.friction.fit.friction_equations import Form
from regressors.friction.curves import CurveUncertainty


def curve_uncertainty(fit: CurveFit) -> CurveUncertainty:
    """Covariance of a fit's parameters, such that 2.576 deviations are half of a 99 % interval.

    Where the scatter is known from few points, the interval is by Student's t, and the covariance larger by
    ``(t / 2.576)^2``. Parameters that are held have no deviation.
    """
    places = [(place, k) for k, name in enumerate(fit.form.parameters) for place in _places(fit.form, name)]
    rows = [k for _, k in places]
    wider = (fit.quantile / float(scipy.stats.norm.ppf(0.5 + 0.5 * CONFIDENCE))) ** 2
    return CurveUncertainty(tuple(place for place, _ in places), wider * fit.covariance[np.ix_(rows, rows)])


def _places(form: Form, parameter: str) -> tuple[str, ...]:
    """Keys of a parameter in a friction file; two where stiction is Coulomb friction."""
    side, _, name = parameter.rpartition(".")
    of = f"{side}." if side else ""
    if name.endswith("_temperature"):
        return (f"temperature.{of}{name.removesuffix('_temperature')}",)
    if name == "load":
        return (f"load.{side}" if side else "load",)
    tied = name == "coulomb" and form.asymmetric and not form.stribeck
    return (parameter, f"{of}stiction") if tied else (parameter,)
