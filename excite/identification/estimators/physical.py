"""Physically possible parameters by semidefinite programming [Wensing, Kim, Slotine 2018], [Sousa, Cortesao 2014]."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from excite.errors import ConicSolverError
from excite.identification.estimator import Context, Estimate, Estimator
from excite.identification.estimators.least_squares import weighting
from excite.identification.estimators.possible_set import (
    Described,
    PossibleSet,
    Pull,
    StandardProblem,
    near_described,
    nearest,
    own_scale,
    possible_estimate,
    possible_set,
    problem_of_factor,
    standard_problem,
)
from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.robot.inertia import from_pseudo_inertia, pseudo_inertia
from regressors.samples import Array

LEAST = 1e-9
UNCHANGED = "the data alone give possible bodies"
INSIDE = "the bodies lie inside what is possible"
_INSIDE = 1.05  # of the least eigenvalue: the conic solver's tolerance does not reach below it
_SHOWN = 1e-12
_AT_BOUND = 1e-5  # slack in a body's own scale that counts as none
_LITTLE = 1e-3  # of its size: friction of a drive that is inside of all bounds
_LIFT_ROUNDING = 0.01  # of the least eigenvalue, whose own rounding is 1e-16 of the mass
_ZERO = 1e-12  # of the size of a parameter that may not be negative: its own rounding
_SOLVED = 1e-9  # of that size: what the conic solver does not tell from zero


def physical(
    observations: Observations,
    model: RegressorModel,
    base: Base,
    *,
    pull: Pull | None = None,
    reference: Described | None = None,
) -> Estimate:
    """Weighted least squares over physically possible standard parameters of bodies and drives.

    ``min ||R (A theta) - Q'y||^2 / 2 + pull`` subject to ``J(theta_i) >= LEAST E`` of every body, rotor inertias,
    Coulomb and viscous friction of zero or more, and the zeros and equalities of the robot's structure. The triangular
    factor enters as residuals, never as R'R. What the data does not determine stays near the reference. Where the
    weighted least-squares estimate is physically possible, the result equals it.
    """
    problem = weighting(observations)
    standard = standard_problem(problem, model, base, pull, reference)
    theta = _unchanged(standard) if pull is None else None
    if theta is not None:
        return possible_estimate(problem, standard, theta, (UNCHANGED,))
    theta, notes = _minimiser(standard)
    return possible_estimate(problem, standard, theta, (*(_active(standard, theta) or (INSIDE,)), *notes))


def possible_fit(
    factor: Array, model: RegressorModel, base: Base, *, pull: Pull | None, reference: Described | None
) -> Array:
    """Base parameters of `physical`, shape (b,), from a factor F of ``[W y]' [W y] = F' F`` in the rows' weights."""
    standard = problem_of_factor(factor[:, :-1], factor[:, -1], model, base, pull, reference)
    return np.asarray(standard.A @ _minimiser(standard)[0])


def nearest_possible(standard: StandardProblem, shares: Sequence[float] = ()) -> tuple[Array, bool]:
    """Possible standard parameters nearest the reference, and whether they have the residuals of least squares."""
    for share in (*shares, 0.0):
        theta = _unchanged(standard, share)
        if theta is not None:
            return theta, True
    return _minimiser(standard)[0], False


def _minimiser(standard: StandardProblem) -> tuple[Array, tuple[str, ...]]:
    """Standard parameters at the optimum, shape (t,), certified to be possible, and what to say of them."""
    S = (standard.S * _free_scale(standard))[:, _needed(standard)]
    rows = np.concatenate([standard.G @ S, S / standard.deviation[:, None]])
    U, s, V = np.linalg.svd(rows, full_matrices=False)
    right = U.T @ np.concatenate([standard.r, standard.prior / standard.deviation])
    half = V.T / s  # theta = S half (right + z): the objective is |z|^2 / 2
    possible = _possible_set(standard, S @ (half @ right), S @ half)
    described = s * (V @ _free(S, _inside(standard))) - right
    z, notes = nearest(possible, described)
    for tried in (z, possible.towards(z, described)):
        theta = _lifted(standard, S @ (half @ (right + tried)))
        if _is_possible(standard, theta):
            return theta, notes
    raise ConicSolverError("physically possible parameters: none agree with the structure of the robot")


def _needed(standard: StandardProblem) -> NDArray[np.bool_]:
    """Free parameters that the data or a body depends on, or that are not known to be zero, shape (f,)."""
    kept = (standard.prior != 0.0) | np.any(standard.A != 0.0, axis=0)
    for body in standard.bodies:
        kept[body.index] = True
    return np.asarray(np.any(standard.S[kept] != 0.0, axis=0))


def _free(S: Array, theta: Array) -> Array:
    """Free parameters nearest standard ones, ``S^+ theta``, shape (f,)."""
    return np.asarray(np.linalg.lstsq(S, theta, rcond=None)[0])


def _inside(standard: StandardProblem) -> Array:
    """Standard parameters of the references, and of drives with a little friction."""
    theta = standard.prior.copy()
    for body in standard.bodies:
        theta[body.index] = from_pseudo_inertia(body.reference)
    theta[standard.positive] = np.maximum(theta[standard.positive], _LITTLE * standard.scale[standard.positive])
    return theta


def _is_possible(standard: StandardProblem, theta: Array) -> bool:
    return bool(
        np.all(standard.margins(theta) >= LEAST * (1 - _LIFT_ROUNDING)) and np.all(theta[standard.positive] >= 0)
    )


def _lifted(standard: StandardProblem, theta: Array) -> Array:
    """Move parameters that are outside by the solver's tolerance, some 1e-10, inside: all J by the same ``d E``.

    Parameters that may not be negative, and are as near to zero, are zero.
    """
    short = max(0.0, LEAST - float(standard.margins(theta).min(initial=np.inf)))
    shift = np.zeros(theta.size)
    for body in standard.bodies:
        shift[body.index] = from_pseudo_inertia(short * np.eye(4))
    lifted = theta + standard.S @ _free(standard.S, shift)
    positive, size = lifted[standard.positive], standard.scale[standard.positive]
    lifted[standard.positive] = np.where(positive < _SOLVED * size, 0.0, positive)
    return np.asarray(lifted)


def _unchanged(standard: StandardProblem, share: float = 0.0) -> Array | None:
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
        z, _ = nearest(_possible_set(standard, S @ origin, S @ slope, share))
    except ConicSolverError:
        return None
    x = origin + slope @ z
    theta = np.asarray(S @ (x + shown.T @ (coordinates - shown @ x)))  # refined to rounding accuracy
    positive, size = theta[standard.positive], standard.scale[standard.positive]
    theta[standard.positive] = np.where(np.abs(positive) <= _ZERO * size, 0.0, positive)
    return theta if _is_possible(standard, theta) else None


def _possible_set(standard: StandardProblem, origin: Array, slope: Array, share: float = 0.0) -> PossibleSet:
    lowest = [_INSIDE * LEAST * np.eye(4) + share * body.reference for body in standard.bodies]
    return possible_set(standard, origin, slope, lowest, [own_scale(body.reference) for body in standard.bodies])


def _free_scale(standard: StandardProblem) -> Array:
    """Sizes of the free parameters, shape (f,)."""
    return np.asarray((np.abs(standard.S) * standard.scale[:, None]).max(axis=0))


def _active(standard: StandardProblem, theta: Array) -> tuple[str, ...]:
    """A note on the active bounds of bodies, and one on those of zero."""
    held: list[str] = []
    for body in standard.bodies:
        T = own_scale(body.reference)
        slack = np.linalg.eigvalsh(T @ (pseudo_inertia(theta[body.index]) - LEAST * np.eye(4)) @ T.T)
        if slack[0] < _AT_BOUND:
            held.append(body.name.removeprefix("link ") if held else body.name)
    zero = [standard.names[j] for j in standard.positive if theta[j] < _AT_BOUND * standard.scale[j]]
    bodies = "the data alone give an impossible body; held at the nearest possible one, which the intervals ignore"
    drives = "the data alone give a negative value; held at zero, which the intervals ignore"
    return tuple(f"{', '.join(names)}: {text}" for names, text in ((held, bodies), (zero, drives)) if names)


class Physical(Estimator):
    """Weighted least squares over physically possible bodies and drives.

    Parameters
    ----------
    described_within : float, optional
        Standard deviation of the described bodies, in their sizes, see
        `excite.identification.estimators.possible_set.near_described`; none for bodies anywhere.

    Raises
    ------
    InputError
        A deviation that is not a positive number.
    """

    name = "physical"
    holds_rows = False

    def __init__(self, described_within: float | None = None) -> None:
        if described_within is not None and not (math.isfinite(described_within) and described_within > 0):
            raise InputError(f"described_within must be a positive number, given {described_within:g}")
        self.described_within = described_within

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `physical`."""
        if context is None:
            raise InputError("the estimator physical needs the model of the observations")
        described, target = context.described, context.target
        within = self.described_within
        pull = None if within is None else near_described(target.model, described, within)
        return physical(observations, target.model, target.base, pull=pull, reference=described)
