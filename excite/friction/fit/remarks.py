"""Remarks on a fitted curve: its range of validity, its data, and why no curve can be fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from excite.friction.fit.breakaway_torque import BreakAway
from excite.friction.fit.curve_fit import LEAST_SPAN, WARMER, CurveFit
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.points import Point

_ALIKE = 2.0  # difference of the criterion below which forms are equally likely
_SEEN = 3.0  # standard deviations of the mean


def stiction_remarks(
    rests: int,
    breaks: Sequence[BreakAway],
    best: CurveFit | None,
    settings: FitSettings,
    points: Sequence[Point],
    speed_unit: str,
    *,
    alone: bool,
) -> list[str]:
    """Remarks on how break-away torques enter the curve."""
    remarks = []
    if rests:
        paired = " pairs of" if settings.gravity == "symmetric" else ""
        remarks.append(f"{rests}{paired} break-away torques are points of the curve at speed zero")
    elif breaks and settings.stiction == "report":
        remarks.append("break-away torques are not in the curve: `stiction='report'`")
    elif breaks and (best is None or settings.model == "coulomb-viscous"):
        remarks.append(f"break-away torques are not in the curve: `model={settings.model!r}` has no stiction")
    if alone and settings.stiction == "fit" and best is not None and settings.model != "coulomb-viscous":
        remarks.append(
            "without a plan, a break-away torque counts only if another one in the same direction repeats it"
        )
    if breaks and settings.gravity == "symmetric":
        remarks.append("break-away torques of one direction alone contain gravity")
    if best is not None and best.form.stribeck and not rests:
        slowest = min(abs(p.speed) for p in points)
        remarks.append(
            f"the curve has no break-away torques: stiction is extrapolated below {slowest:.3g} {speed_unit}"
        )
    if best is not None and best.held:
        remarks.append(
            "friction falls from its break-away value below the speed of the slowest window: "
            f"{', '.join(best.held)} is an upper bound"
        )
    return remarks


def alike_remarks(fits: Sequence[CurveFit], settings: FitSettings) -> list[str]:
    """Remark on the forms whose criterion is within 2 of that of the best."""
    value = [getattr(curve_fit, settings.criterion) for curve_fit in fits]
    alike = [curve_fit.form.name for curve_fit, x in zip(fits[1:], value[1:], strict=True) if x - value[0] < _ALIKE]
    if not alike:
        return []
    names = f"{', '.join(alike[:-1])} and {alike[-1]} fit" if len(alike) > 1 else f"{alike[0]} fits"
    return [f"{names} about as well: {settings.criterion.upper()} differs by less than {_ALIKE:g}"]


def load_remarks(
    loads: tuple[float, float] | None, best: CurveFit | None, settings: FitSettings, unit: str
) -> list[str]:
    """Remark on whether friction grows with the torque that the drive carries."""
    if loads is None or best is None:
        return []
    sentence = f"the drive carries {loads[0]:.3g} to {loads[1]:.3g} {unit}"
    if not best.form.load:
        return [f"{sentence}, which does not change friction by {settings.criterion.upper()}"]
    return [f"{sentence}, and friction grows with it; the parameters are those at zero load"]


def temperature_remarks(
    of_temperature: str,
    reference: float | None,
    best: CurveFit | None,
    settings: FitSettings,
    breaks: Sequence[BreakAway],
) -> list[str]:
    """Remarks on whether friction depends on temperature."""
    if reference is None:
        return [of_temperature] if of_temperature else []
    known = [each.temperature for each in breaks if each.temperature is not None]
    mixed = bool(known) and max(known) - min(known) >= WARMER
    rest = f"mean break-away torques are from {min(known):.3g} to {max(known):.3g} deg C" if mixed else ""
    if best is None or best.form.temperature is None:
        what = "enter a table: each row is the mean over all temperatures"
        what = what if best is None else f"change friction by {settings.criterion.upper()}"
        return [f"temperature, {of_temperature}, does not {what}", *([rest] if mixed else [])]
    also = "; mean break-away torques are converted to it" if mixed else ""
    return [
        f"linear in temperature, {of_temperature}; the file holds the curve at {reference:.4g} deg C "
        f"with its slopes{also}"
    ]


def why_no_curve(points: Sequence[Point], failed: Mapping[str, str], unit: str, speed_unit: str) -> str:
    """The common reason why no form can be fitted, where it is known; else that of each."""
    count = f"{len(points)} window{'s' if len(points) > 1 else ''}"
    speeds = np.array([abs(p.speed) for p in points])
    against = np.array([float(np.sign(p.speed)) * p.torque for p in points])
    A = np.column_stack([np.ones_like(speeds), speeds])
    line = A @ np.linalg.lstsq(A, against, rcond=None)[0]
    left = float(np.sum((against - line) ** 2)) / max(len(points) - 2, 1)
    noise = float(np.sqrt(max(left, float(np.mean([p.deviation**2 for p in points])))))
    if float(line @ line) < 2.0 * (_SEEN * noise) ** 2:
        return (
            f"{count}, no friction above the noise: the mean torque against the motion is {against.mean():.3g} {unit}, "
            f"the noise of a window {noise:.2g} {unit}; check that the torque is that of the drive, in {unit}"
        )
    if speeds.max() <= LEAST_SPAN * speeds.min():
        return (
            f"{count}, all at one speed, {speeds.mean():.3g} {speed_unit}, so no curve can be fitted; make runs at "
            "more speeds, or give `model='table'`, which tabulates the points"
        )
    if against.mean() < 0:
        return (
            f"{count}, the mean torque is along the motion, {against.mean():.3g} {unit}, so it cannot be friction; "
            "check that torque and position have the same sign"
        )
    return f"{count}, no curve can be fitted: " + "; ".join(f"{name}: {why}" for name, why in failed.items())
