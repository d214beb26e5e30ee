"""The body that real masses can make nearest to an estimate [Wensing, Kim, Slotine 2018]."""

from __future__ import annotations

import clarabel
import numpy as np
import scipy.sparse

from excite.errors import ConicSolverError
from regressors.robot.inertia import pseudo_inertia
from regressors.samples import Array

_ROWS, _COLUMNS = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T  # upper triangle, column by column
_UNITS = np.column_stack([pseudo_inertia(e)[_ROWS, _COLUMNS] for e in np.eye(10)])
_OFF_DIAGONAL = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2.0))
_LEAST = 1e-7  # of the size of the body: smallest eigenvalue of its pseudo-inertia in units of mass and length
_LEAST_LENGTH = 1e-3


def is_possible(phi: Array) -> bool:
    """Whether a body has the ten parameters: its pseudo-inertia is positive definite."""
    return bool(phi[0] > 0 and np.linalg.eigvalsh(pseudo_inertia(phi))[0] > 0)


def nearest_possible(phi: Array, covariance: Array) -> Array:
    """Parameters of a real body that the estimate excludes least.

    ``min (x - phi)' C^-1 (x - phi)`` subject to a positive definite pseudo-inertia of x; phi itself where it is one.

    Parameters
    ----------
    phi : ndarray, shape (10,)
        m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz [kg, kg m, kg m^2], with a positive mass.
    covariance : ndarray, shape (10, 10)
        C.

    Raises
    ------
    ConicSolverError
        The conic solver found no solution.
    """
    if is_possible(phi):
        return phi
    length = max(
        _LEAST_LENGTH, float(np.linalg.norm(phi[1:4]) / phi[0]), float(np.sqrt(np.abs(phi[4:]).max() / phi[0]))
    )
    scale = phi[0] * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    k = np.array([1 / length] * 3 + [1.0]) / np.sqrt(phi[0])  # brings the entries of the pseudo-inertia near one
    block = (_OFF_DIAGONAL * k[_ROWS] * k[_COLUMNS])[:, None] * _UNITS * scale
    least = _OFF_DIAGONAL * _LEAST * np.eye(4)[_ROWS, _COLUMNS]
    C = covariance / np.outer(scale, scale)
    values, vectors = np.linalg.eigh((C + C.T) / 2)
    P = (vectors / np.maximum(values, 1e-12 * values[-1])) @ vectors.T
    P = P * values[-1]  # its least eigenvalue is one
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solver = clarabel.DefaultSolver(
        scipy.sparse.triu(scipy.sparse.csc_matrix(P), format="csc"),
        -P @ (phi / scale),
        scipy.sparse.csc_matrix(-block),
        -least,
        [clarabel.PSDTriangleConeT(4)],
        settings,
    )
    solution = solver.solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        raise ConicSolverError(f"a possible body near the estimate: the conic solver ended with {solution.status}")
    return np.asarray(scale * np.array(solution.x))
