"""Curves fitted to friction torques over speed, and the one that an information criterion prefers [KD96] section 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import scipy.optimize
import scipy.stats

from excite.friction.points import Point
from regressors.errors import InputError
from regressors.friction import CoulombViscous, FrictionCurve, Loaded, Side, Slope, Stribeck, TableFriction, Warm
from regressors.samples import Array, Index

CONFIDENCE = 0.99
_WORST_CONDITION = 1e8
_STUCK = 1e-4  # of a parameter's usual size, from a bound
_LEAST_SPAN = 1.05  # speeds further apart than this factor show how friction changes with speed


@dataclass(frozen=True, eq=False)
class Conditions:
    """What friction depends on, at N points.

    Parameters
    ----------
    v : ndarray, shape (N,)
        [rad/s or m/s]
    direction : ndarray, shape (N,)
        1 or -1, also at speed zero.
    warmth : ndarray, shape (N,)
        Temperature above the reference [K].
    load : ndarray, shape (N,)
        Size of the torque that the drive carries [Nm or N].
    """

    v: Array
    direction: Array
    warmth: Array
    load: Array

    @classmethod
    def of(cls, v: Array, warmth: float = 0.0, load: float = 0.0) -> Conditions:
        """Moving at some velocities, at one temperature and one load."""
        return cls(v, np.sign(v), np.full_like(v, warmth), np.full_like(v, load))

    def rows(self, which: Index) -> Conditions:
        """Some of the points."""
        return Conditions(*(getattr(self, name)[which] for name in ("v", "direction", "warmth", "load")))


@dataclass(frozen=True)
class Form:
    """An equation of friction over speed, over temperature, and over load.

    Parameters
    ----------
    name : str
    stribeck : bool
        ``Fc + (Fs - Fc) exp(-(|v| / vs)^delta)`` rather than ``Fc``.
    asymmetric : bool
        Parameters of their own in each direction, and no offset; one set and an offset if not.
    exponent : float
        delta.
    offset : bool
        Where there is one set.
    temperature : float, optional
        Reference temperature [deg C]; then Fc and Fv are linear in the difference to it.
    load : bool
        Whether a share of the torque that the drive carries is added to Fc.
    """

    name: str
    stribeck: bool = False
    asymmetric: bool = False
    exponent: float = 1.0
    offset: bool = True
    temperature: float | None = None
    load: bool = False

    @property
    def _of_side(self) -> tuple[str, ...]:
        steep = ("stiction", "stribeck") if self.stribeck else ()
        warm = () if self.temperature is None else ("coulomb_temperature", "viscous_temperature")
        return ("coulomb", "viscous", *steep, *warm, *(("load",) if self.load else ()))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters."""
        if self.asymmetric:
            return tuple(f"{side}.{name}" for side in ("forward", "backward") for name in self._of_side)
        return (*self._of_side, *(("offset",) if self.offset else ()))

    def values(self, p: Array, at: Conditions) -> tuple[Array, Array]:
        """Torque and its derivatives by the parameters.

        Parameters
        ----------
        p : ndarray, shape (k,)
        at : Conditions
            Of N points.

        Returns
        -------
        torque : ndarray, shape (N,)
        J : ndarray, shape (N, k)
        """
        n = len(self._of_side)
        if not self.asymmetric:
            f, J = self._side(p[:n], at)
            f, J = at.direction * f, at.direction[:, None] * J
            return (f + p[n], np.column_stack([J, np.ones_like(at.v)])) if self.offset else (f, J)
        f, J = np.zeros(at.v.size), np.zeros((at.v.size, 2 * n))
        for way, columns in ((1.0, slice(0, n)), (-1.0, slice(n, 2 * n))):
            rows = np.flatnonzero(way * at.direction > 0)
            one, two = self._side(p[columns], at.rows(rows))
            f[rows] = way * one
            J[rows, columns] = way * two
        return f, J

    def _side(self, p: Array, at: Conditions) -> tuple[Array, Array]:
        given = dict(zip(self._of_side, p.tolist(), strict=True))
        v, coulomb, viscous = np.abs(at.v), given["coulomb"], given["viscous"]
        if not self.stribeck:
            f, columns = coulomb + viscous * v, [np.ones_like(v), v]
        else:
            drop, vs = given["stiction"] - coulomb, given["stribeck"]
            x = v / vs
            e = np.exp(-(x**self.exponent))
            f = coulomb + drop * e + viscous * v
            columns = [1.0 - e, v, e, drop * e * self.exponent * x**self.exponent / vs]
        if self.temperature is not None:
            f = f + given["coulomb_temperature"] * at.warmth + given["viscous_temperature"] * at.warmth * v
            columns += [at.warmth, at.warmth * v]
        if self.load:
            f = f + given["load"] * at.load
            columns += [at.load]
        return f, np.column_stack(columns)

    def curve(self, p: Array, measured: tuple[float, float] | None = None) -> FrictionCurve:
        """The curve, linear in temperature where the form is.

        Parameters
        ----------
        p : ndarray, shape (k,)
        measured : tuple of float, optional
            Lowest and highest temperature of the points [deg C].
        """
        given = dict(zip(self.parameters, p.tolist(), strict=True))
        of = [f"{side}." if self.asymmetric else "" for side in ("forward", "backward")]
        curve: FrictionCurve
        if not self.stribeck and not self.asymmetric:
            curve = CoulombViscous(given["coulomb"], given["viscous"], given.get("offset", 0.0))
        else:
            ahead, behind = (self._curve_side(given, side) for side in of)
            curve = Stribeck(ahead, behind, given.get("offset", 0.0))
        if self.temperature is not None:
            up, down = (Slope(given[f"{side}coulomb_temperature"], given[f"{side}viscous_temperature"]) for side in of)
            curve = Warm(curve, self.temperature, up, down, measured)
        return Loaded(curve, *(given[f"{side}load"] for side in of)) if self.load else curve

    def _curve_side(self, given: dict[str, float], of: str) -> Side:
        coulomb, viscous = given[f"{of}coulomb"], given[f"{of}viscous"]
        if not self.stribeck:
            return Side(coulomb, viscous)
        return Side(coulomb, viscous, given[f"{of}stiction"], given[f"{of}stribeck"], self.exponent)


@dataclass(frozen=True, eq=False)
class Fit:
    """A form with its parameters.

    Parameters
    ----------
    form : Form
    values : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
        Of the windows' deviations; larger where the points scatter more than these say.
    scatter : float
        Root mean square of the residuals, each over its deviation and per degree of freedom.
    quantile : float
        Half the 99 % interval over the standard deviation.
    bic, aicc : float
        Information criteria.
    measured : tuple of float, optional
        Lowest and highest temperature of the points, where the form depends on it [deg C].
    """

    form: Form
    values: Array
    covariance: Array
    scatter: float
    quantile: float
    bic: float
    aicc: float
    measured: tuple[float, float] | None = None

    @property
    def halfwidth(self) -> Array:
        """Half the 99 % interval of each parameter."""
        return np.asarray(self.quantile * np.sqrt(np.diag(self.covariance)))

    @property
    def curve(self) -> FrictionCurve:
        """The curve, linear in temperature where the form is.

        Raises
        ------
        InputError
            No friction, at one end of the measured temperatures or the other.
        """
        curve = self.form.curve(self.values, self.measured)
        for end in self.measured or ():
            curve.at(end)
        return curve

    def band(self, v: Array, warmth: float = 0.0, load: float = 0.0) -> tuple[Array, Array]:
        """Torque at some velocities, and half its 99 % confidence band."""
        f, J = self.form.values(self.values, Conditions.of(v, warmth, load))
        return f, np.asarray(self.quantile * np.sqrt(np.einsum("ij,jk,ik->i", J, self.covariance, J)))


def forms(
    model: str, exponent: float | None, *, offset: bool, temperature: float | None = None, load: bool = False
) -> tuple[Form, ...]:
    """Equations that a model's name stands for.

    Parameters
    ----------
    model : {"auto", "coulomb-viscous", "stribeck"}
    exponent : float, optional
        Of the Stribeck term; both Tustin's 1 and the usual 2 if not given.
    offset : bool
        False where only the part that is the same in both directions was measured.
    temperature : float, optional
        Reference temperature, where friction is to depend on it [deg C].
    load : bool
        Whether friction is to grow with what the drive carries.
    """
    found = []
    on = [*([] if temperature is None else ["temperature"]), *(["load"] if load else [])]
    also = f", linear in {' and '.join(on)}" if on else ""
    for asymmetric in (False, True) if offset else (False,):
        side = "asymmetric " if asymmetric else ""
        if model in ("auto", "coulomb-viscous"):
            found.append(Form(f"{side}coulomb-viscous{also}", False, asymmetric, 1.0, offset, temperature, load))
        if model in ("auto", "stribeck"):
            for delta in (1.0, 2.0) if exponent is None else (exponent,):
                name = f"{side}stribeck (exponent {delta:g}){also}"
                found.append(Form(name, True, asymmetric, delta, offset, temperature, load))
    return tuple(found)


def fit(points: Sequence[Point], form: Form) -> Fit:
    """Parameters of a form by weighted least squares, with intervals from the Jacobian.

    Parameters
    ----------
    points : sequence of Point
    form : Form

    Raises
    ------
    InputError
        The points do not determine them, or what they give is no friction.
    """
    at, tau, sigma = _arrays(points, form.temperature)
    k, n = len(form.parameters), tau.size
    if n <= k:
        raise InputError(f"{n} points for {k} parameters")
    best = None
    for start, lower, upper in _starts(form, at.v, tau):
        found = scipy.optimize.least_squares(
            lambda p: (form.values(p, at)[0] - tau) / sigma,
            start,
            lambda p: form.values(p, at)[1] / sigma[:, None],
            bounds=(lower, upper),
            x_scale="jac",
            max_nfev=500,
        )
        if best is None or found.cost < best[0].cost:
            best = (found, start, lower, upper)
    assert best is not None
    found, start, lower, upper = best
    p = np.asarray(found.x, dtype=float)
    J = form.values(p, at)[1] / sigma[:, None]
    scale = np.linalg.norm(J, axis=0)
    if np.any(scale == 0.0) or np.linalg.cond(J / scale) > _WORST_CONDITION:
        raise InputError("the points do not determine its parameters")
    stuck = [
        f"{name} is driven to {a if x - a < b - x else b:.3g}"
        for name, x, usual, a, b in zip(form.parameters, p, start, lower, upper, strict=True)
        if min(x - a, b - x) < _STUCK * max(abs(x), abs(usual))
    ]
    if stuck:
        raise InputError(f"{', '.join(stuck)}, the end of what can be")
    chi2 = 2.0 * float(found.cost)
    scatter = float(np.sqrt(chi2 / (n - k)))
    covariance = np.linalg.inv((J / scale).T @ (J / scale)) / np.outer(scale, scale) * max(1.0, scatter**2)
    likely = n * float(np.log(max(chi2 / n, 1e-12)))
    level = 0.5 + 0.5 * CONFIDENCE
    quantile = float(scipy.stats.t.ppf(level, n - k)) if scatter > 1.0 else float(scipy.stats.norm.ppf(level))
    correction = 2.0 * (k + 1) * (k + 2) / (n - k - 2) if n > k + 2 else np.inf
    criteria = likely + k * float(np.log(n)), likely + 2.0 * (k + 1) + correction
    return Fit(form, p, covariance, scatter, quantile, *criteria, _temperatures(points, form))


def chosen_fit(
    points: Sequence[Point], candidates: Sequence[Form], criterion: str
) -> tuple[Fit, tuple[Fit, ...], dict[str, str]]:
    """The fit with the smallest criterion, all fits, and why other forms could not be fitted.

    Parameters
    ----------
    points : sequence of Point
    candidates : sequence of Form
    criterion : {"bic", "aicc"}

    Raises
    ------
    InputError
        None can be fitted.
    """
    fits, failed = [], {}
    for form in candidates:
        try:
            one = fit(points, form)
            one.curve  # noqa: B018, which no friction has is an error
            fits.append(one)
        except InputError as error:
            failed[form.name] = str(error)
    if not fits:
        raise InputError("no curve can be fitted: " + "; ".join(f"{name}: {why}" for name, why in failed.items()))
    best_first = sorted(fits, key=attrgetter(criterion))
    return best_first[0], tuple(best_first), failed


def table_of(points: Sequence[Point]) -> TableFriction:
    """Mean torque per speed, those within 5 % of each other taken together, each weighted by its variance.

    Parameters
    ----------
    points : sequence of Point
    """
    rows: list[list[Point]] = []
    for point in sorted(points, key=lambda p: p.speed):
        near = rows and abs(point.speed - rows[-1][0].speed) <= (_LEAST_SPAN - 1.0) * abs(point.speed)
        rows[-1].append(point) if near else rows.append([point])
    means = []
    for row in rows:
        weight = np.array([p.deviation for p in row]) ** -2.0
        means.append([float(weight @ [p.speed for p in row]), float(weight @ [p.torque for p in row])] / weight.sum())
    speed, torque = np.array(means).T
    return TableFriction(speed, torque)


def _arrays(points: Sequence[Point], temperature: float | None) -> tuple[Conditions, Array, Array]:
    """What friction depends on, the torques, and their deviations."""
    v, tau, sigma = (np.array([getattr(p, name) for p in points]) for name in ("speed", "torque", "deviation"))
    warmth = [0.0 if temperature is None or p.temperature is None else p.temperature - temperature for p in points]
    load = np.array([0.0 if p.load is None else p.load for p in points])
    return Conditions(v, np.sign(v), np.array(warmth), load), tau, sigma


def _temperatures(points: Sequence[Point], form: Form) -> tuple[float, float] | None:
    """Lowest and highest, where the form depends on them."""
    known = [p.temperature for p in points if p.temperature is not None]
    return (min(known), max(known)) if known and form.temperature is not None else None


def _starts(form: Form, v: Array, tau: Array) -> list[tuple[Array, Array, Array]]:
    """Starting values with lower and upper bounds, several where the equation is not linear."""
    size, speed = float(np.abs(tau).max()) + 1e-9, np.abs(v)
    slope = size / speed.max()
    slowest, fastest = float(speed.min()), float(speed.max())
    places = np.geomspace(0.5 * slowest, fastest, 4) if form.stribeck else [1.0]
    known = {
        "coulomb": (0.6 * size, 0.0, np.inf),
        "viscous": (0.3 * slope, -np.inf, np.inf),
        "stiction": (size, 0.0, np.inf),
        "offset": (0.0, -np.inf, np.inf),
        "coulomb_temperature": (0.0, -np.inf, np.inf),
        "viscous_temperature": (0.0, -np.inf, np.inf),
        "load": (0.02, 0.0, 1.0),
    }
    found = []
    for place in places:
        of = {**known, "stribeck": (float(place), 0.05 * slowest, 1.05 * fastest)}
        if form.stribeck:  # a falling line would be what the exponential is for, and fall on beyond the data
            of["viscous"] = (0.3 * slope, 0.0, np.inf)
        start, lower, upper = np.array([of[name.rsplit(".", 1)[-1]] for name in form.parameters]).T
        found.append((start, lower, upper))
    return found
