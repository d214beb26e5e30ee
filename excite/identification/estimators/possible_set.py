"""Possible robots in linear coordinates, the one nearest the origin of these, and an estimate from it.

Coordinates z in which the quantity to minimise is ``|z|^2`` serve every data set alike, without noise, badly scaled or
of deficient rank: the programme has neither a weight nor an equality, and the solver sees nothing but
``M_i + sum_k B_ik z_k >= 0`` of every body in its own scale and ``c_j + b_j z >= 0`` of every positive parameter
[Wensing, Kim, Slotine 2018]. Whatever the solver says is checked here, and stated where it ended early.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import clarabel
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from excite.errors import ConicSolverError
from excite.identification.estimate import Estimate
from excite.identification.estimators.least_squares import GroupWeights, weighted_estimate
from excite.identification.estimators.standard import StandardProblem
from excite.identification.observations import Observations
from regressors.robot.inertia import pseudo_inertia
from regressors.samples import Array

_FIXED = 1e-12  # slope of a parameter, over its size, that does not count
_ROWS, _COLUMNS = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T  # upper triangle, column by column
_WEIGHT = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2.0))
_UNITS = np.array([pseudo_inertia(e) for e in np.eye(10)])
_TOLERANCE, _ALMOST = 1e-10, 1e-7  # asked of the solver, and accepted without a word
_OUTSIDE = 1e-6  # of a body's size: what a solution that the solver ended early may lack
_RETRIES: tuple[dict[str, float], ...] = (  # regularisation of the solver's linear systems, and its steps
    {},
    {"static_regularization_constant": 1e-7, "max_step_fraction": 0.9},
    {"static_regularization_constant": 1e-10, "dynamic_regularization_delta": 1e-9, "max_step_fraction": 0.95},
)
_SOLVED = ("Solved", "AlmostSolved")
_INFEASIBLE = ("PrimalInfeasible", "AlmostPrimalInfeasible")
Block = tuple[Array, Array, object]  # A, b and the cone of b - A x


@dataclass(frozen=True, eq=False)
class PossibleSet:
    """``M_i + sum_k B_ik z_k > 0`` of every body, ``c_j + b_j z > 0`` of every positive parameter."""

    M: Array  # (bodies, 4, 4)
    B: Array  # (bodies, 4, 4, d)
    c: Array  # (k,)
    b: Array  # (k, d)

    @property
    def size(self) -> int:
        """Number d of coordinates."""
        return int(self.b.shape[1])

    def bodies(self, z: Array) -> Array:
        """Change of each body's matrix by the coordinates, shape (n, bodies, 4, 4)."""
        return np.asarray((z @ self.B.reshape(self.M.size, self.size).T).reshape(len(z), *self.M.shape))

    def margins(self, z: Array) -> Array:
        """Least eigenvalue or value of each constraint, in the parameters' own sizes, shape (n, bodies + k)."""
        least = np.linalg.eigvalsh(self.M + self.bodies(z))[..., 0]
        return np.concatenate([least, self.c + z @ self.b.T], axis=1)

    def contains(self, z: Array) -> NDArray[np.bool_]:
        """Whether each of n points is inside, shape (n,)."""
        return np.asarray(np.all(self.margins(z) > 0.0, axis=1))

    def towards(self, z: Array, inside: Array) -> Array:
        """The point between z and one inside, shape (d,), that is as near z as concave margins let it be."""
        there, here = self.margins(np.stack([inside, z]))
        short = np.maximum(-here, 0.0)
        t = float(np.max(short / np.where(short > 0, there + short, 1.0), initial=0.0))
        return np.asarray(z + t * (inside - z))

    def blocks(self, slack: bool = False) -> list[Block]:
        """Rows of a conic programme in z, with a last variable that all constraints are to exceed if asked for."""
        added = [] if not slack else [_WEIGHT * np.eye(4)[_ROWS, _COLUMNS]]
        rows: list[Block] = [
            (
                np.column_stack([-_WEIGHT[:, None] * B[_ROWS, _COLUMNS], *added]),
                _WEIGHT * M[_ROWS, _COLUMNS],
                clarabel.PSDTriangleConeT(4),
            )
            for M, B in zip(self.M, self.B, strict=True)
        ]
        if self.c.size:
            ones = [np.ones(self.c.size)] if slack else []
            rows.append((np.column_stack([-self.b, *ones]), self.c, clarabel.NonnegativeConeT(self.c.size)))
        return rows


def possible_set(
    standard: StandardProblem, origin: Array, slope: Array, lowest: Sequence[Array], scaling: Sequence[Array]
) -> PossibleSet:
    """Possible robots among ``theta = origin + slope @ z``."""
    # origin (t,); slope (t, d); lowest (4, 4); scaling (4, 4)
    d = slope.shape[1]
    M, B = np.zeros((len(standard.bodies), 4, 4)), np.zeros((len(standard.bodies), 4, 4, d))
    for k, (body, least, T) in enumerate(zip(standard.bodies, lowest, scaling, strict=True)):
        M[k], B[k] = body_in_coordinates(origin[body.index], slope[body.index], least, T)
    scale = standard.scale[standard.positive]
    c, b = origin[standard.positive] / scale, slope[standard.positive] / scale[:, None]
    free = np.abs(b).max(axis=1, initial=0.0) > _FIXED
    return PossibleSet(M, B, c[free], b[free])


def body_in_coordinates(origin: Array, slope: Array, lowest: Array, T: Array) -> tuple[Array, Array]:
    """M and B of a body of ten parameters, shapes (4, 4) and (4, 4, d); see `possible_set`."""
    units = T @ _UNITS @ T.T  # (10, 4, 4)
    M = np.tensordot(origin, units, axes=1) - T @ lowest @ T.T
    return np.asarray(M), np.asarray(np.tensordot(units, slope, axes=([0], [0])))


def own_scale(reference: Array) -> Array:
    """Scaling T of a body that brings the entries of its pseudo-inertia, ``T J T'``, near one, shape (4, 4)."""
    length = np.sqrt(np.trace(reference[:3, :3]) / reference[3, 3])
    return np.asarray(np.diag([1 / length] * 3 + [1.0]) / np.sqrt(reference[3, 3]))


def nearest(possible: PossibleSet, inside: Array | None = None) -> tuple[Array, tuple[str, ...]]:
    """The possible point nearest the origin of the coordinates, to the solver's tolerance, and what to say of it."""
    # inside (d,); result (d,)
    d = possible.size
    if possible.margins(np.zeros((1, d))).min(initial=0.0) >= 0:
        return np.zeros(d), ()
    identity = scipy.sparse.identity(d, format="csc")
    try:
        return conic_solution(possible, identity, np.zeros(d), possible.blocks())
    except ConicSolverError:
        if inside is None or possible.margins(inside[None]).min(initial=0.0) < 0:
            raise
    return possible.towards(np.zeros(d), inside), (
        "the conic solver found no possible bodies: the estimate of least squares is moved towards the description "
        "until it is possible",
    )


def conic_solution(
    possible: PossibleSet, P: scipy.sparse.csc_matrix, q: Array, blocks: Sequence[Block]
) -> tuple[Array, tuple[str, ...]]:
    """Minimise ``x' P x / 2 + q' x`` subject to the blocks; x begins with the coordinates of a possible set."""
    # P (n, n); q (n,); result (n,)
    A, b, cones = zip(*blocks, strict=True)
    rows, right = scipy.sparse.csc_matrix(np.concatenate(A)), np.concatenate(b)
    upper = scipy.sparse.triu(P, format="csc")
    ended: list[tuple[float, Array, str]] = []
    for further in _RETRIES:
        solution = clarabel.DefaultSolver(upper, q, rows, right, list(cones), _settings(further)).solve()
        x, status = np.array(solution.x), str(solution.status)
        sound = bool(np.all(np.isfinite(x)) and possible.margins(x[None, : possible.size]).min(initial=0.0) > -_OUTSIDE)
        if sound and status in _SOLVED:
            return x, ()
        if status in _INFEASIBLE and not further:
            raise ConicSolverError(f"physically possible parameters: the conic solver ended with {status}")
        if sound:
            ended.append((float(x @ (P @ x) / 2 + q @ x), x, status))
    if not ended:
        raise ConicSolverError(f"physically possible parameters: the conic solver ended with {status}")
    _, x, status = min(ended, key=lambda one: one[0])
    return x, (f"the conic solver ended with {status}: the result is possible, but may not be the best",)


def _settings(further: dict[str, float]) -> clarabel.DefaultSettings:
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    settings.reduced_tol_gap_abs = settings.reduced_tol_gap_rel = settings.reduced_tol_feas = _ALMOST
    for name, value in further.items():
        setattr(settings, name, value)
    return settings


def possible_estimate(
    method: str,
    observations: Observations,
    problem: GroupWeights,
    standard: StandardProblem,
    theta: Array,
    notes: tuple[str, ...],
) -> Estimate:
    """Estimate from possible standard parameters, with the covariance of weighted least squares."""
    free = weighted_estimate(method, observations, problem)
    fit = np.asarray(standard.A @ theta)
    values = np.where(np.isnan(free.values), np.nan, fit)
    named = dict(zip(standard.names, theta.tolist(), strict=True))
    notes = (*free.notes, *notes, "covariance of the estimate without constraints and pull")
    return replace(free, values=values, standard=named, notes=notes, fit=fit, unconstrained=free.coefficients)
