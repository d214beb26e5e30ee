"""The relaxation over finitely many states, solved as a conic programme."""

from __future__ import annotations

from collections.abc import Callable

import clarabel
import numpy as np
import scipy.sparse as sp

from excite.errors import ConicSolverError
from excite.optimality.bounded_criteria import BoundedCriterion, Multipliers
from excite.optimality.moment_conditions import MomentConditions
from excite.optimality.triangles import matrix_of
from regressors.samples import Array

_GAP, _FEASIBILITY = 1e-5, 1e-6  # of the solver; bounds do not depend on them, see `dual_certificate`
_ITERATIONS = 100
_REGULARISATION = 1e-7  # Clarabel's 1e-8 ends some of these programmes at the first step
_TOTAL = 1e-12
_USABLE = ("Solved", "AlmostSolved", "MaxIterations", "InsufficientProgress")


def relaxation(
    criterion: BoundedCriterion, F: Array, h: Array, conditions: MomentConditions, scale: float
) -> tuple[Array, Multipliers]:
    """Best measure on some states, and the dual point."""  # F (N, b, b); h (N, m); result (N,)
    part = criterion.part(F, scale)
    own, N = part.objective.size, len(F)
    B = conditions.cone()
    p = B.shape[1]
    sizes = np.maximum(np.abs(h).max(axis=0), 1e-9)
    of_cone = np.zeros((h.shape[1], p))
    of_cone[: len(B)] = B
    zeros: Callable[[int, int], sp.csc_matrix] = lambda rows, columns: sp.csc_matrix((rows, columns))  # noqa: E731
    rows = [sp.hstack([zeros(h.shape[1], own), sp.csc_matrix((h / sizes).T), sp.csc_matrix(-of_cone / sizes[:, None])])]
    right = [np.zeros(h.shape[1])]
    cones = [clarabel.ZeroConeT(h.shape[1])]
    if part.total:
        rows.append(sp.hstack([zeros(1, own), np.ones((1, N)), zeros(1, p)]))
        right.append(np.ones(1))
        cones.append(clarabel.ZeroConeT(1))
    rows.append(sp.hstack([zeros(N, own), -sp.eye_array(N), zeros(N, p)]))
    right.append(np.zeros(N))
    cones.append(clarabel.NonnegativeConeT(N))
    first = sum(b.size for b in right)
    for A, b, size in part.psd:
        rows.append(sp.hstack([A, zeros(A.shape[0], p)]))
        right.append(b)
        cones.append(clarabel.PSDTriangleConeT(size))
    for A, b in part.exponential:
        rows.append(sp.hstack([A, zeros(3, p)]))
        right.append(b)
        cones.append(clarabel.ExponentialConeT())
    if p:
        rows.append(sp.hstack([zeros(p, own + N), -sp.eye_array(p)]))
        right.append(np.zeros(p))
        cones += [clarabel.PSDTriangleConeT(size) for size in conditions.sizes]
    x, z = _solved(np.concatenate([part.objective, np.zeros(N + p)]), sp.vstack(rows), np.concatenate(right), cones)
    dual = []
    for _, b, size in part.psd:
        dual.append(matrix_of(z[first : first + b.size], size))
        first += b.size
    lower, upper, constant = criterion.multipliers([_positive(each) for each in dual], scale)
    weights = np.maximum(x[own : own + N], 0.0)
    moments = conditions.admitted(-z[: h.shape[1]] / sizes)
    return weights / max(weights.sum(), _TOTAL), Multipliers(lower, upper, constant, moments)


def _positive(M: Array) -> Array:
    """The matrix without negative eigenvalues."""
    values, V = np.linalg.eigh(M)
    return np.asarray((V * np.maximum(values, 0.0)) @ V.T)


def _solved(objective: Array, A: sp.spmatrix, b: Array, cones: list[object]) -> tuple[Array, Array]:
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_iter, settings.max_threads = False, _ITERATIONS, 1
    settings.tol_gap_rel = settings.tol_gap_abs = _GAP
    settings.tol_feas = _FEASIBILITY
    settings.static_regularization_constant = _REGULARISATION
    n = objective.size
    solution = clarabel.DefaultSolver(sp.csc_matrix((n, n)), objective, sp.csc_matrix(A), b, cones, settings).solve()
    x, z = np.array(solution.x), np.array(solution.z)
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(z))) or str(solution.status) not in _USABLE:
        raise ConicSolverError(f"the relaxation was not solved: {solution.status}")
    return x, z
