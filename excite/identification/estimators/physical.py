"""Physically possible parameters by semidefinite programming [Wensing, Kim, Slotine 2018], [Sousa, Cortesao 2014]."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import clarabel
import numpy as np
import scipy.linalg
import scipy.sparse

from excite.errors import ConicSolverError
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.estimators.log_cholesky import log_cholesky
from excite.identification.estimators.possible import possible_estimate
from excite.identification.estimators.standard import (
    Body,
    Entropic,
    Pull,
    Quadratic,
    StandardProblem,
    near_described,
    standard_problem,
)
from excite.identification.observations import Observations
from excite.identification.weights import weighting
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
_SOLVED = ("Solved", "AlmostSolved")
_TOLERANCES = (1e-10, 1e-8, 1e-6)  # the next where the solver gets stuck, as by equations without noise
_AT_BOUND = 1e-5  # slack in a body's own scale that counts as none
_ROWS, _COLUMNS = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T  # upper triangle, column by column
_UNITS = np.column_stack([pseudo_inertia(e)[_ROWS, _COLUMNS] for e in np.eye(10)])


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

    Parameters
    ----------
    observations : Observations
        In the base columns.
    model : RegressorModel
    base : Base
        Of the model.
    pull : Quadratic or Entropic, optional
        Prior knowledge, such as values of a CAD model.
    reference : mapping of str to float, optional
        Standard parameters near which undetermined ones stay; those of the robot's description if not given.
    least : float
        Smallest eigenvalue of a pseudo-inertia [of kg m^2 and kg together].

    Returns
    -------
    Estimate
        With `standard`; its covariance is that of the unconstrained least squares.

    Raises
    ------
    InputError
        Observations in other columns, a bound that is not positive; see `weighted`.
    ConicSolverError
        The conic solver found no solution.
    """
    if not (np.isfinite(least) and least > 0):
        raise InputError(f"physical: the least eigenvalue must be a positive number, given {least}")
    if isinstance(pull, Entropic):
        return replace(log_cholesky(observations, model, base, pull=pull, reference=reference), method="physical")
    problem = weighting(observations)
    standard = standard_problem(observations, problem, model, base, pull, reference)
    theta = _unchanged(standard, least) if pull is None else None
    if theta is not None:
        return possible_estimate("physical", observations, problem, standard, theta, (UNCHANGED,))
    theta = _minimiser(standard, least)
    bounds = _active(standard, theta, least) or (INSIDE,)
    return possible_estimate("physical", observations, problem, standard, theta, bounds)


def possible_fit(
    observations: Observations,
    model: RegressorModel,
    base: Base,
    *,
    pull: Quadratic | None = None,
    reference: Mapping[str, float] | None = None,
) -> Array:
    """Base parameters of `physical`, shape (b,), without what else belongs to an estimate.

    Parameters
    ----------
    observations, model, base, pull, reference
        See `physical`.

    Raises
    ------
    InputError, ConicSolverError
        See `physical`.
    """
    standard = standard_problem(observations, weighting(observations), model, base, pull, reference)
    return np.asarray(standard.A @ _minimiser(standard, LEAST))


def nearest_possible(
    standard: StandardProblem, least: float = LEAST, shares: Sequence[float] = ()
) -> tuple[Array, bool]:
    """Possible standard parameters nearest the reference, and whether they have the residuals of least squares.

    Parameters
    ----------
    standard : StandardProblem
    least : float
        See `physical`.
    shares : sequence of float
        Parts of its reference that every pseudo-inertia is to keep, ``J(theta_i) >= share J0_i``, tried one after the
        other: bodies at the bound of what is possible have no thickness.

    Raises
    ------
    ConicSolverError
        The conic solver found no solution.
    """
    for share in (*shares, 0.0):
        theta = _unchanged(standard, least, share)
        if theta is not None:
            return theta, True
    return _minimiser(standard, least), False


def _minimiser(standard: StandardProblem, least: float) -> Array:
    """Standard parameters at the optimum, shape (t,)."""
    f, k = standard.S.shape[1], standard.G.shape[0]
    GS = standard.G @ standard.S * _free_scale(standard)
    equalities = np.hstack([GS, -np.eye(k)])  # of the free parameters divided by their scale, and of the residuals
    status, x = _conic_solution(standard, equalities, standard.r, least)
    if status not in _SOLVED:
        raise ConicSolverError(f"physically possible parameters: the conic solver ended with {status}")
    return _lifted(standard, standard.S @ (_free_scale(standard) * x[:f]), least)


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
    scale = _free_scale(standard)
    U, s, V = np.linalg.svd(standard.G @ standard.S * scale, full_matrices=False)
    shown = s > _SHOWN * s[0]
    U, s, V = U[:, shown], s[shown], V[shown]
    status, x = _conic_solution(standard, V, U.T @ standard.r / s, least, share)
    if status not in _SOLVED:
        return None
    x = x + V.T @ (U.T @ standard.r / s - V @ x)  # refined to rounding accuracy
    theta = np.asarray(standard.S @ (scale * x))
    possible = np.all(standard.margins(theta) >= least) and np.all(theta[standard.positive] >= 0)
    return theta if possible else None


def _conic_solution(
    standard: StandardProblem, equalities: Array, right: Array, least: float, share: float = 0.0
) -> tuple[str, Array]:
    """Solver status, and variables with the least pull (and residuals, if any) under the equalities and all bounds."""
    scale = _free_scale(standard)
    k = equalities.shape[1] - scale.size  # residuals
    D = standard.S * scale / standard.deviation[:, None]
    P = scipy.sparse.csc_matrix(scipy.linalg.block_diag(D.T @ D, np.eye(k)))
    q = np.concatenate([-D.T @ (standard.prior / standard.deviation), np.zeros(k)])
    rows, rights, cones = [equalities], [right], [clarabel.ZeroConeT(len(equalities))]
    for body in standard.bodies:
        lowest = _INSIDE * least * np.eye(4) + share * body.reference
        block, bound = _cone_rows(standard.S * scale, body, lowest)
        rows.append(np.hstack([-block, np.zeros((10, k))]))
        rights.append(-bound)
        cones.append(clarabel.PSDTriangleConeT(4))
    if standard.positive.size:
        unit = (standard.S * scale / standard.scale[:, None])[standard.positive]
        rows.append(np.hstack([-unit, np.zeros((len(unit), k))]))
        rights.append(np.zeros(len(unit)))
        cones.append(clarabel.NonnegativeConeT(len(unit)))
    A = scipy.sparse.csc_matrix(np.concatenate(rows))
    for tolerance in _TOLERANCES:
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        upper, right = scipy.sparse.triu(P, format="csc"), np.concatenate(rights)
        solution = clarabel.DefaultSolver(upper, q, A, right, cones, settings).solve()
        if str(solution.status) in (*_SOLVED, "PrimalInfeasible"):
            break
    return str(solution.status), np.array(solution.x)


def _free_scale(standard: StandardProblem) -> Array:
    """Sizes of the free parameters, shape (f,)."""
    return np.asarray((standard.S * standard.scale[:, None]).max(axis=0))


def _congruence(reference: Array) -> Array:
    """Scaling k of a body that brings the entries of its pseudo-inertia, ``k J k``, near one, shape (4,)."""
    length = np.sqrt(np.trace(reference[:3, :3]) / reference[3, 3])
    return np.asarray(np.array([1 / length] * 3 + [1.0]) / np.sqrt(reference[3, 3]))


def _cone_rows(S: Array, body: Body, lowest: Array) -> tuple[Array, Array]:
    """Upper triangle of a body's pseudo-inertia per free parameter, and of its bound; off-diagonals times sqrt 2."""
    k = _congruence(body.reference)
    weight = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2.0)) * k[_ROWS] * k[_COLUMNS]
    return np.asarray(weight[:, None] * _UNITS @ S[body.index]), weight * lowest[_ROWS, _COLUMNS]


def _active(standard: StandardProblem, theta: Array, least: float) -> tuple[str, ...]:
    """Notes on the active bounds."""
    notes = []
    for body in standard.bodies:
        k = _congruence(body.reference)
        slack = np.linalg.eigvalsh(np.outer(k, k) * (pseudo_inertia(theta[body.index]) - least * np.eye(4)))
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
        Weight of the pull towards the described values, see `excite.identification.estimators.standard.Entropic`.
    described_within : float, optional
        Instead: standard deviation of the described bodies, in their sizes, see
        `excite.identification.estimators.standard.near_described`.

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
