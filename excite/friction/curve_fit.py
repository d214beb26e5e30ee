"""The curve through the points of a drive, its uncertainty, and remarks on its validity and its data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np
import scipy

from excite.friction.breakaway_torque import BreakAway
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.friction_equations import Conditions, Form
from excite.friction.points import Point
from regressors.errors import InputError
from regressors.robot.friction.curve import FrictionCurve, TableFriction
from regressors.robot.friction.uncertainty import CurveUncertainty
from regressors.samples import Array, Index

CONFIDENCE = 0.99
_WORST_CONDITION = 1e8
_STUCK = 1e-4  # distance from a bound, relative to a parameter's usual size, that counts as on it
_FALLEN = 5.0  # exp(-5) is 1 %
LEAST_SPAN = 1.05  # least ratio of speeds that determine how friction changes with speed
WARMER = 2.0  # [K], least difference of temperatures that counts


@dataclass(frozen=True, eq=False)
class CurveFit:
    """A fitted form with its parameters."""

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"parameters": lambda fit: fit.parameters}

    form: Form
    values: Array  # (k,)
    # (k, k) by the deviations of the windows; larger where the points scatter more than these predict
    covariance: Array
    scatter: float  # root mean square of the residuals, each divided by its deviation, per degree of freedom
    quantile: float  # half the 99 % interval over the standard deviation
    bic: float  # information criteria for the deviations of the points, enlarged in proportion if they scatter more
    aicc: float
    # lowest and highest temperature of the points, where the form depends on it [deg C]
    measured: tuple[float, float] | None = None
    # parameters that the points bound but do not determine: held fixed, with intervals of zero
    held: tuple[str, ...] = ()

    @property
    def parameters(self) -> dict[str, dict[str, float | None]]:
        """Value of each parameter, and half its 99 % interval; None where it is held."""
        rows = zip(self.form.parameters, self.values.tolist(), self.halfwidth.tolist(), strict=True)
        return {name: {"value": value, "interval99": None if name in self.held else half} for name, value, half in rows}

    @property
    def halfwidth(self) -> Array:
        """Half the 99 % interval of each parameter."""
        return np.asarray(self.quantile * np.sqrt(np.diag(self.covariance)))

    @property
    def curve(self) -> FrictionCurve:
        """The curve, linear in temperature where the form is; `InputError` if its parameters are not possible."""
        return self.form.curve(self.values, self.measured)

    def residuals(self, points: Sequence[Point]) -> Array:
        """Torque of each point less that of the curve under its conditions, shape (N,)."""
        at, tau, _ = _arrays(points, self.form.temperature)
        return np.asarray(tau - self.form.values(self.values, at)[0])

    def band(self, v: Array, temperature_rise: float = 0.0, load: float = 0.0) -> tuple[Array, Array]:
        """Torque at given velocities, and half its 99 % confidence band."""
        f, J = self.form.values(self.values, Conditions.of(v, temperature_rise, load))
        return f, np.asarray(self.quantile * np.sqrt(np.einsum("ij,jk,ik->i", J, self.covariance, J)))


def fit(points: Sequence[Point], form: Form) -> CurveFit:
    """Parameters of a form by weighted least squares, with intervals from the Jacobian."""
    data = _arrays(points, form.temperature)
    free = np.ones(len(form.parameters), dtype=bool)
    p, stuck = _minimum(form, data, free)
    unseen = _falls_unseen(form, data[0].v, p)
    if unseen and set(stuck) <= set(unseen):
        free = np.array([name not in unseen for name in form.parameters])
        p, stuck = _minimum(form, data, free)
    if stuck:
        raise InputError(", ".join(f"{name} reaches its bound {end:.3g}" for name, end in stuck.items()))
    return _with_covariance(form, p, free, data, _temperatures(points, form))


_Data = tuple[Conditions, Array, Array]  # conditions, torques and standard deviations of the points


def _minimum(form: Form, data: _Data, free: Index) -> tuple[Array, dict[str, float]]:
    """Parameters with the least sum of squares, those that are not free held fixed, and the bounds that some end at."""
    at, tau, _ = data
    if tau.size <= np.count_nonzero(free):
        raise InputError(f"{tau.size} points for {np.count_nonzero(free)} parameters")
    best = None
    for start, lower, upper in _starts(form, at.v, tau):
        whole = np.where(free, start, _unseen(form, at.v))
        least = partial(_residuals, form, data, free, whole)
        minimum = scipy.optimize.least_squares(
            lambda x, least=least: least(x)[0],
            start[free],
            lambda x, least=least: least(x)[1],
            bounds=(lower[free], upper[free]),
            x_scale="jac",
            max_nfev=500,
        )
        if best is None or minimum.cost < best[0]:
            whole[free] = minimum.x
            best = (minimum.cost, whole, start, lower, upper)
    assert best is not None
    _, p, start, lower, upper = best
    rows = zip(form.parameters, free, p, start, lower, upper, strict=True)
    return p, {
        name: a if x - a < b - x else b
        for name, is_free, x, usual, a, b in rows
        if is_free and min(x - a, b - x) < _STUCK * max(abs(x), abs(usual))
    }


def _residuals(form: Form, data: _Data, free: Index, whole: Array, x: Array) -> tuple[Array, Array]:
    at, tau, sigma = data
    p = whole.copy()
    p[free] = x
    f, J = form.values(p, at)
    return (f - tau) / sigma, J[:, free] / sigma[:, None]


def _unseen(form: Form, v: Array) -> float:
    """Stribeck speed of a curve that has decayed to 1 % at the slowest of the points."""
    return float(np.abs(v[v != 0.0]).min() / _FALLEN ** (1.0 / form.exponent))


def _falls_unseen(form: Form, v: Array, p: Array) -> list[str]:
    """Undetermined Stribeck speeds: friction falls from its known value at rest below the slowest points."""
    if not np.any(v == 0.0):
        return []
    return [
        name for name, x in zip(form.parameters, p, strict=True) if name.endswith("stribeck") and x < _unseen(form, v)
    ]


def _with_covariance(form: Form, p: Array, free: Index, data: _Data, measured: tuple[float, float] | None) -> CurveFit:
    """A fit with its covariance and criteria."""
    r, J = _residuals(form, data, free, p, p[free])
    k, n = int(np.count_nonzero(free)), r.size
    scale = np.linalg.norm(J, axis=0)
    if np.any(scale == 0.0) or np.linalg.cond(J / scale) > _WORST_CONDITION:
        raise InputError("the points do not determine its parameters")
    chi2 = float(r @ r)
    scatter = float(np.sqrt(chi2 / (n - k)))
    covariance = np.zeros((free.size, free.size))
    within = np.linalg.inv((J / scale).T @ (J / scale)) / np.outer(scale, scale)
    covariance[np.ix_(free, free)] = within * max(1.0, scatter**2)
    wider = max(1.0, chi2 / n)  # never less than the points' own deviations
    likely = n * float(np.log(wider)) + chi2 / wider
    level = 0.5 + 0.5 * CONFIDENCE
    quantile = float(scipy.special.stdtrit(n - k, level)) if scatter > 1.0 else float(scipy.special.ndtri(level))
    correction = 2.0 * (k + 1) * (k + 2) / (n - k - 2) if n > k + 2 else np.inf
    criteria = likely + k * float(np.log(n)), likely + 2.0 * (k + 1) + correction
    held = tuple(name for name, is_free in zip(form.parameters, free, strict=True) if not is_free)
    return CurveFit(form, p, covariance, scatter, quantile, *criteria, measured, held)


def chosen_fit(
    points: Sequence[Point], candidates: Sequence[Form], criterion: str
) -> tuple[CurveFit | None, tuple[CurveFit, ...], dict[str, str]]:
    """The fit with the smallest criterion, all fits, best first, and why other forms could not be fitted."""
    fits, failed = [], {}
    for form in candidates:
        try:
            candidate = fit(points, form)
            curve = candidate.curve
            for end in candidate.measured or ():
                curve.at(end)  # possible friction at both ends of the measured temperatures
            fits.append(candidate)
        except InputError as error:
            failed[form.name] = str(error)
    fits.sort(key=attrgetter(criterion))
    return next(iter(fits), None), tuple(fits), failed


def table_of(points: Sequence[Point]) -> TableFriction:
    """Mean torque per speed within 5 %, by inverse variances, or by equal weights where temperatures differ by 2 K."""
    rows: list[list[Point]] = []
    for point in sorted(points, key=lambda p: p.speed):
        near = rows and abs(point.speed - rows[-1][0].speed) <= (LEAST_SPAN - 1.0) * abs(point.speed)
        rows[-1].append(point) if near else rows.append([point])
    means = []
    for row in rows:
        warm = [p.temperature for p in row if p.temperature is not None]
        mixed = bool(warm) and max(warm) - min(warm) >= WARMER
        weight = np.ones(len(row)) if mixed else np.array([p.deviation for p in row]) ** -2.0
        means.append([float(weight @ [p.speed for p in row]), float(weight @ [p.torque for p in row])] / weight.sum())
    speed, torque = np.array(means).T
    return TableFriction(speed, torque)


def _arrays(points: Sequence[Point], temperature: float | None) -> _Data:
    """Conditions, torques and standard deviations of the points."""
    v, tau, sigma = (np.array([getattr(p, name) for p in points]) for name in ("speed", "torque", "deviation"))
    rise = [0.0 if temperature is None or p.temperature is None else p.temperature - temperature for p in points]
    load = np.array([0.0 if p.load is None else p.load for p in points])
    return Conditions(v, np.copysign(1.0, v), np.array(rise), load), tau, sigma


def _temperatures(points: Sequence[Point], form: Form) -> tuple[float, float] | None:
    """Lowest and highest temperature, where the form depends on it."""
    known = [p.temperature for p in points if p.temperature is not None]
    return (min(known), max(known)) if known and form.temperature is not None else None


def _starts(form: Form, v: Array, tau: Array) -> list[tuple[Array, Array, Array]]:
    """Initial guesses with lower and upper bounds, several where the equation is nonlinear."""
    size, speed = float(np.abs(tau).max()) + 1e-9, np.abs(v[v != 0.0])
    slope = size / speed.max()
    slowest, fastest = float(speed.min()), float(speed.max())
    places = np.geomspace(0.5 * slowest, fastest, 4) if form.stribeck else [1.0]
    known = {
        "viscous": (0.3 * slope, -np.inf, np.inf),
        "stiction": (_at_rest(v, tau, 1.0, size), 0.0, np.inf),
        "backward.stiction": (_at_rest(v, tau, -1.0, size), 0.0, np.inf),
        "offset": (0.0, -np.inf, np.inf),
        "coulomb_temperature": (0.0, -np.inf, np.inf),
        "viscous_temperature": (0.0, -np.inf, np.inf),
        "load": (0.02, 0.0, 1.0),
    }
    guesses = []
    shares = (0.6, 1.0) if form.stribeck and np.any(v == 0.0) else (0.6,)  # friction may rise from rest, too
    for place, share in product(places, shares):
        of = {
            **known,
            "coulomb": (share * size, 0.0, np.inf),
            "stribeck": (float(place), 0.05 * slowest, 1.05 * fastest),
        }
        if form.stribeck:  # a falling line would replace the exponential, and continue to fall beyond the data
            of["viscous"] = (0.3 * slope, 0.0, np.inf)
        rows = [of.get(name, of[name.rsplit(".", 1)[-1]]) for name in form.parameters]
        start, lower, upper = np.array(rows).T
        guesses.append((start, lower, upper))
    return guesses


def _at_rest(v: Array, tau: Array, direction: float, otherwise: float) -> float:
    """Size of the mean torque at which one direction breaks away."""
    rows = (v == 0.0) & (np.copysign(1.0, v) == direction)
    return float(np.abs(tau[rows].mean())) if rows.any() else otherwise


def curve_uncertainty(fit: CurveFit) -> CurveUncertainty:
    """Covariance of a fit's parameters, such that 2.576 deviations are half of a 99 % interval.

    Where the scatter is known from few points, the interval is by Student's t, and the covariance larger by
    ``(t / 2.576)^2``. Parameters that are held have no deviation.
    """
    places = [(place, k) for k, name in enumerate(fit.form.parameters) for place in _places(fit.form, name)]
    rows = [k for _, k in places]
    wider = (fit.quantile / float(scipy.special.ndtri(0.5 + 0.5 * CONFIDENCE))) ** 2
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


_ALIKE = 2.0  # difference of the criterion below which forms are equally likely


_SEEN = 3.0  # standard deviations of the mean


def stiction_remarks(
    rests: int, breaks: Sequence[BreakAway], best: CurveFit | None, settings: FitSettings, slowest: str, *, alone: bool
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
        remarks.append(f"the curve has no break-away torques: stiction is extrapolated below {slowest}")
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
    told: str, reference: float | None, best: CurveFit | None, settings: FitSettings, breaks: Sequence[BreakAway]
) -> list[str]:
    """Remarks on whether friction depends on temperature."""
    if reference is None:
        return [told] if told else []
    known = [each.temperature for each in breaks if each.temperature is not None]
    mixed = bool(known) and max(known) - min(known) >= WARMER
    rest = f"mean break-away torques are from {min(known):.3g} to {max(known):.3g} deg C" if mixed else ""
    if best is None or best.form.temperature is None:
        what = "enter a table: each row is the mean over all temperatures"
        what = what if best is None else f"change friction by {settings.criterion.upper()}"
        return [f"temperature, {told}, does not {what}", *([rest] if mixed else [])]
    also = "; mean break-away torques are converted to it" if mixed else ""
    return [f"linear in temperature, {told}; the file holds the curve at {reference:.4g} deg C with its slopes{also}"]


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
