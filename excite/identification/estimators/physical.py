"""Physically possible parameters by semidefinite programming [Wensing, Kim, Slotine 2018], [Sousa, Cortesao 2014].

A pull by an entropic divergence needs no constraints: in log-Cholesky coordinates ``J = T U U' T'`` with U upper
triangular, the logarithms of its diagonal and its other entries free, reaches every positive definite J and no other
[Rucker, Wensing 2022]. T is the factor of a reference, ``J0 = T T'``; then the divergence from the reference is a sum
of squares as well: ``tr(J0^-1 J) - log det(J0^-1 J) - 4 = sum_{i<j} U_ij^2 + sum_i (U_ii^2 - 1 - 2 log U_ii)``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.optimize

from excite.errors import ConicSolverError
from excite.identification.estimator import Context, Estimate, Estimator
from excite.identification.estimators.least_squares import weighting
from excite.identification.estimators.possible_set import (
    Body,
    Entropic,
    PossibleSet,
    Pull,
    Quadratic,
    StandardProblem,
    exact_torques,
    near_described,
    nearest,
    own_scale,
    possible_estimate,
    possible_set,
    standard_problem,
)
from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.robot.inertia import from_pseudo_inertia, pseudo_inertia
from regressors.samples import Array

LEAST = 1e-9
UNCHANGED = "the weighted least-squares estimate is already physically possible"
INSIDE = "no physical bound is active"
_INSIDE = 1.05  # of the least eigenvalue: the conic solver's tolerance does not reach below it
_SHOWN = 1e-12
_AT_BOUND = 1e-5  # slack in a body's own scale that counts as none
_LITTLE = 1e-3  # of its size: friction of a drive that is inside of all bounds
_LIFT_ROUNDING = 0.01  # of the least eigenvalue, whose own rounding is 1e-16 of the mass
_ZERO = 1e-12  # of the size of a parameter that may not be negative: its own rounding


def physical(
    observations: Observations,
    model: RegressorModel,
    base: Base,
    *,
    pull: Pull | None = None,
    reference: Mapping[str, float] | None = None,
    least: float = LEAST,
) -> Estimate:
    """Weighted least squares over physically possible standard parameters of bodies and drives.

    ``min ||R (A theta) - Q'y||^2 / 2 + pull`` subject to ``J(theta_i) >= least E`` of every body, rotor inertias,
    Coulomb and viscous friction of zero or more, and the zeros and equalities of the robot's structure. The triangular
    factor enters as residuals, never as R'R. What the data does not determine stays near the reference. Where the
    weighted least-squares estimate is physically possible, the result equals it.
    """
    if not (np.isfinite(least) and least > 0):
        raise InputError(f"physical: the least eigenvalue must be a positive number, given {least}")
    if isinstance(pull, Entropic):
        return replace(log_cholesky(observations, model, base, pull=pull, reference=reference), method="physical")
    problem = weighting(observations)
    standard = standard_problem(observations, problem, model, base, pull, reference)
    theta = _unchanged(standard, least) if pull is None else None
    if theta is not None:
        notes = (UNCHANGED, *exact_torques(problem))
        return possible_estimate("physical", observations, problem, standard, theta, notes)
    theta, notes = _minimiser(standard, least)
    notes = (*(_active(standard, theta, least) or (INSIDE,)), *notes, *exact_torques(problem))
    return possible_estimate("physical", observations, problem, standard, theta, notes)


def possible_fit(
    observations: Observations,
    model: RegressorModel,
    base: Base,
    *,
    pull: Quadratic | None = None,
    reference: Mapping[str, float] | None = None,
) -> Array:
    """Base parameters of `physical`, shape (b,), without what else belongs to an estimate."""
    standard = standard_problem(observations, weighting(observations), model, base, pull, reference)
    return np.asarray(standard.A @ _minimiser(standard, LEAST)[0])


def nearest_possible(
    standard: StandardProblem, least: float = LEAST, shares: Sequence[float] = ()
) -> tuple[Array, bool]:
    """Possible standard parameters nearest the reference, and whether they have the residuals of least squares."""
    for share in (*shares, 0.0):
        theta = _unchanged(standard, least, share)
        if theta is not None:
            return theta, True
    return _minimiser(standard, least)[0], False


def _minimiser(standard: StandardProblem, least: float) -> tuple[Array, tuple[str, ...]]:
    """Standard parameters at the optimum, shape (t,), certified to be possible, and what to say of them."""
    S = standard.S * _free_scale(standard)
    rows = np.concatenate([standard.G @ S, S / standard.deviation[:, None]])
    U, s, V = np.linalg.svd(rows, full_matrices=False)
    right = U.T @ np.concatenate([standard.r, standard.prior / standard.deviation])
    half = V.T / s  # theta = S half (right + z): the objective is |z|^2 / 2
    possible = _possible_set(standard, S @ (half @ right), S @ half, least)
    described = s * (V @ (np.linalg.pinv(S) @ _inside(standard))) - right
    z, notes = nearest(possible, described)
    for tried in (z, possible.towards(z, described)):
        theta = _lifted(standard, S @ (half @ (right + tried)), least)
        if _is_possible(standard, theta, least):
            return theta, notes
    raise ConicSolverError("physically possible parameters: none agree with the structure of the robot")


def _inside(standard: StandardProblem) -> Array:
    """Standard parameters of the references, and of drives with a little friction."""
    theta = standard.prior.copy()
    for body in standard.bodies:
        theta[body.index] = from_pseudo_inertia(body.reference)
    theta[standard.positive] = np.maximum(theta[standard.positive], _LITTLE * standard.scale[standard.positive])
    return theta


def _is_possible(standard: StandardProblem, theta: Array, least: float) -> bool:
    return bool(
        np.all(standard.margins(theta) >= least * (1 - _LIFT_ROUNDING)) and np.all(theta[standard.positive] >= 0)
    )


def _lifted(standard: StandardProblem, theta: Array, least: float) -> Array:
    """Move parameters that are outside by the solver's tolerance, some 1e-10, inside: all J by the same ``d E``."""
    short = max(0.0, least - float(standard.margins(theta).min(initial=np.inf)))
    shift = np.zeros(theta.size)
    for body in standard.bodies:
        shift[body.index] = from_pseudo_inertia(short * np.eye(4))
    lifted = theta + standard.S @ (np.linalg.pinv(standard.S) @ shift)
    lifted[standard.positive] = np.maximum(lifted[standard.positive], 0.0)
    return np.asarray(lifted)


def _unchanged(standard: StandardProblem, least: float, share: float = 0.0) -> Array | None:
    """Possible standard parameters with the residuals of unconstrained least squares, if there are any."""
    S = standard.S * _free_scale(standard)
    U, s, V = np.linalg.svd(standard.G @ S)
    rank = int(np.sum(s > _SHOWN * s[0]))
    shown, left_open = V[:rank], V[rank:].T
    coordinates = (U.T @ standard.r)[:rank] / s[:rank]
    best = shown.T @ coordinates
    U, s, V = np.linalg.svd(S @ left_open / standard.deviation[:, None], full_matrices=False)
    right = U.T @ ((standard.prior - S @ best) / standard.deviation)
    slope = left_open @ (V.T / s)
    origin = best + slope @ right
    try:
        z, _ = nearest(_possible_set(standard, S @ origin, S @ slope, least, share))
    except ConicSolverError:
        return None
    x = origin + slope @ z
    theta = np.asarray(S @ (x + shown.T @ (coordinates - shown @ x)))  # refined to rounding accuracy
    positive, size = theta[standard.positive], standard.scale[standard.positive]
    theta[standard.positive] = np.where(np.abs(positive) <= _ZERO * size, np.maximum(positive, 0.0), positive)
    return theta if _is_possible(standard, theta, least) else None


def _possible_set(
    standard: StandardProblem, origin: Array, slope: Array, least: float, share: float = 0.0
) -> PossibleSet:
    lowest = [_INSIDE * least * np.eye(4) + share * body.reference for body in standard.bodies]
    return possible_set(standard, origin, slope, lowest, [own_scale(body.reference) for body in standard.bodies])


def _free_scale(standard: StandardProblem) -> Array:
    """Sizes of the free parameters, shape (f,)."""
    return np.asarray((standard.S * standard.scale[:, None]).max(axis=0))


def _active(standard: StandardProblem, theta: Array, least: float) -> tuple[str, ...]:
    """Notes on the active bounds."""
    notes = []
    for body in standard.bodies:
        T = own_scale(body.reference)
        slack = np.linalg.eigvalsh(T @ (pseudo_inertia(theta[body.index]) - least * np.eye(4)) @ T.T)
        if slack[0] < _AT_BOUND:
            notes.append(f"pseudo-inertia of {body.name} at its bound")
    for j in standard.positive:
        if theta[j] < _AT_BOUND * standard.scale[j]:
            notes.append(f"{standard.names[j]} at its bound of zero")
    return tuple(notes)


class Physical(Estimator):
    """Weighted least squares over physically possible bodies and drives.

    Parameters
    ----------
    pull : float
        Weight of the pull towards the described values, see `excite.identification.estimators.possible_set.Entropic`.
    described_within : float, optional
        Instead: standard deviation of the described bodies, in their sizes, see
        `excite.identification.estimators.possible_set.near_described`.

    Raises
    ------
    InputError
        A pull that is negative or not finite, a deviation that is not positive, or both.
    """

    name = "physical"
    holds_rows = False

    def __init__(self, pull: float = 0.0, described_within: float | None = None) -> None:
        if not (math.isfinite(pull) and pull >= 0):
            raise InputError(f"pull must be zero or a positive number, given {pull:g}")
        if described_within is not None and not (math.isfinite(described_within) and described_within > 0):
            raise InputError(f"described_within must be a positive number, given {described_within:g}")
        if pull and described_within is not None:
            raise InputError("`pull` and `described_within` both pull bodies to their description; give one of them")
        self.pull, self.described_within = pull, described_within

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `physical`."""
        if context is None:
            raise InputError("the estimator physical needs the model of the observations")
        described, target = context.described, context.target
        pull: Pull | None = Entropic(described, self.pull) if self.pull > 0 else None
        if self.described_within is not None:
            pull = near_described(target.model, described, self.described_within)
        return physical(observations, target.model, target.base, pull=pull, reference=described)


_UPPER = [(i, j) for i in range(4) for j in range(i + 1, 4)]
_TOLERANCE = 1e-12
_EVALUATIONS = 500
_STRUCTURE = 1e5  # weight of structural zeros and equalities, which enter as residuals


def log_cholesky(
    observations: Observations,
    model: RegressorModel,
    base: Base,
    *,
    pull: Pull | None = None,
    reference: Mapping[str, float] | None = None,
) -> Estimate:
    """Solve the problem of `physical` in coordinates that only reach possible parameters.

    Solved by the Gauss-Newton method in a trust region, with the exact Jacobian. An optimum with a singular
    pseudo-inertia is approached, not reached.
    """
    problem = weighting(observations)
    quadratic = pull if isinstance(pull, Quadratic) else None
    standard = standard_problem(observations, problem, model, base, quadratic, reference)
    charts = _charts(standard, pull if isinstance(pull, Entropic) else None)
    coordinates = _Coordinates(standard, charts)
    minimum = scipy.optimize.least_squares(
        coordinates.residual,
        np.zeros(coordinates.size),
        coordinates.jacobian,
        method="trf",  # logarithms and ratios have scale one, and a trust region keeps their exponentials small
        xtol=_TOLERANCE,
        ftol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=_EVALUATIONS,
    )
    theta = coordinates.theta(minimum.x)
    theta = standard.S @ np.linalg.lstsq(standard.S, theta, rcond=None)[0]
    ended = "converged" if minimum.status > 0 else "stopped without convergence"
    note = f"{ended} after {minimum.nfev} evaluations in {coordinates.size} coordinates"
    return possible_estimate("log-cholesky", observations, problem, standard, theta, (note,))


@dataclass(frozen=True, eq=False)
class _Chart:
    """Coordinates of one body: four logarithms of the diagonal of U, then its upper entries."""

    body: Body
    T: Array
    weight: float  # of the entropic divergence from T T'

    def factor(self, xi: Array) -> Array:
        U = np.diag(np.exp(xi[:4]))
        for k, (i, j) in enumerate(_UPPER, 4):
            U[i, j] = xi[k]
        return U

    def theta(self, xi: Array) -> Array:
        half = self.T @ self.factor(xi)
        return from_pseudo_inertia(half @ half.T)

    def slope(self, xi: Array) -> Array:
        """Derivative of the ten parameters, shape (10, 10)."""
        half = self.T @ self.factor(xi)
        columns = []
        for k, (i, j) in enumerate([(i, i) for i in range(4)] + _UPPER):
            d = np.zeros((4, 4))
            d[:, j] = self.T[:, i] * (np.exp(xi[k]) if i == j else 1.0)
            columns.append(from_pseudo_inertia(d @ half.T + half @ d.T))
        return np.column_stack(columns)

    def divergence(self, xi: Array) -> Array:
        """Ten residuals, half of whose sum of squares is the weighted divergence."""
        x = xi[:4]
        excess = np.maximum(np.expm1(2 * x) - 2 * x, 0.0)
        return np.asarray(np.sqrt(2 * self.weight) * np.concatenate([np.sign(x) * np.sqrt(excess), xi[4:]]))

    def divergence_slope(self, xi: Array) -> Array:
        """Derivative of `divergence`, its diagonal, shape (10,)."""
        x = xi[:4]
        root = np.sqrt(np.maximum(np.expm1(2 * x) - 2 * x, 0.0))
        near = np.abs(x) < 1e-6  # the quotient tends to sqrt 2
        slope = np.where(near, np.sqrt(2.0), np.abs(np.expm1(2 * x)) / np.where(near, 1.0, root))
        return np.asarray(np.sqrt(2 * self.weight) * np.concatenate([slope, np.ones(6)]))


def _charts(standard: StandardProblem, pull: Entropic | None) -> tuple[_Chart, ...]:
    charts, pulled = [], 0
    for body in standard.bodies:
        J, weight = body.reference, 0.0
        names = [standard.names[k] for k in body.index]
        if pull is not None and all(name in pull.values for name in names):
            J, weight, pulled = pseudo_inertia([pull.values[name] for name in names]), pull.weight, pulled + 1
            if not (np.all(np.isfinite(J)) and np.linalg.eigvalsh(J)[0] > 0):
                raise InputError(f"pull: the parameters of {body.name} are not those of a possible body")
        charts.append(_Chart(body, _upper_factor(J), weight))
    if pull is not None and not pulled:
        raise InputError("pull: expected all ten parameters of at least one body, but none is complete")
    return tuple(charts)


def _upper_factor(J: Array) -> Array:
    """Upper triangular T with ``T T' = J``."""
    return np.asarray(scipy.linalg.cholesky(J[::-1, ::-1], lower=True)[::-1, ::-1])


class _Coordinates:
    """All parameters in free coordinates: bodies by their charts, positive ones by logarithms, the rest as they are."""

    def __init__(self, standard: StandardProblem, charts: tuple[_Chart, ...]) -> None:
        self.standard, self.charts = standard, charts
        in_bodies = np.concatenate([np.zeros(0, dtype=np.intp), *(chart.body.index for chart in charts)])
        self.rest = np.setdiff1d(np.arange(len(standard.names)), in_bodies)
        self.logarithmic = np.isin(self.rest, standard.positive)
        self.size = 10 * len(charts) + self.rest.size
        S = standard.S
        broken = (np.eye(len(S)) - S @ np.linalg.pinv(S)) / standard.scale[:, None]
        weak = np.diag(1 / standard.deviation)
        self.matrix = np.concatenate([standard.G, weak, _STRUCTURE * broken[np.any(broken != 0, axis=1)]])
        self.right = np.zeros(len(self.matrix))
        self.right[: standard.r.size] = standard.r
        self.right[standard.r.size :][: len(S)] = standard.prior / standard.deviation

    def theta(self, xi: Array) -> Array:
        """Standard parameters, shape (t,)."""
        theta = np.empty(len(self.standard.names))
        for chart, part in zip(self.charts, self._parts(xi), strict=True):
            theta[chart.body.index] = chart.theta(part)
        free = xi[10 * len(self.charts) :]
        theta[self.rest] = self.standard.scale[self.rest] * np.where(self.logarithmic, np.exp(free), free)
        return theta

    def residual(self, xi: Array) -> Array:
        divergences = [c.divergence(part) for c, part in zip(self.charts, self._parts(xi), strict=True) if c.weight]
        return np.concatenate([self.matrix @ self.theta(xi) - self.right, *divergences])

    def jacobian(self, xi: Array) -> Array:
        slope = np.zeros((len(self.standard.names), self.size))
        below = []
        for k, (chart, part) in enumerate(zip(self.charts, self._parts(xi), strict=True)):
            columns = np.arange(10 * k, 10 * k + 10)
            slope[np.ix_(chart.body.index, columns)] = chart.slope(part)
            if chart.weight:
                block = np.zeros((10, self.size))
                block[:, columns] = np.diag(chart.divergence_slope(part))
                below.append(block)
        free = xi[10 * len(self.charts) :]
        columns = np.arange(10 * len(self.charts), self.size)
        slope[self.rest, columns] = self.standard.scale[self.rest] * np.where(self.logarithmic, np.exp(free), 1.0)
        return np.concatenate([self.matrix @ slope, *below])

    def _parts(self, xi: Array) -> list[Array]:
        return list(xi[: 10 * len(self.charts)].reshape(-1, 10))
