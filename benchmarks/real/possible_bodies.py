"""Weighted least squares over physically possible bodies, as one semidefinite program given to Clarabel directly.

``min ||R x - z||^2 / 2 + ||(x - x0) / (100 size)||^2 / 2`` with the triangular factor R of the weighted equations;
every body's pseudo-inertia is positive semidefinite, rotor inertias, Coulomb and viscous friction are not negative. x0
is the robot's description, which decides only what the data leaves open.
"""

from __future__ import annotations

import clarabel
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

Array = NDArray[np.float64]
LENGTH = 0.3  # m, to bring masses, first moments and inertias to one scale
FAR = 100.0
_UPPER = [(i, j) for j in range(4) for i in range(j + 1)]  # column by column, as Clarabel has it


def pseudo_inertia_basis() -> Array:
    """The matrices ``J_k`` of ``J = sum_k theta_k J_k``, shape (10, 4, 4), theta as in `regressors.robot.inertia`."""
    basis = np.zeros((10, 4, 4))
    basis[0, 3, 3] = 1.0
    for k in range(3):
        basis[1 + k, k, 3] = basis[1 + k, 3, k] = 1.0
    for k, (i, j) in zip(range(4, 10), [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)], strict=True):
        inertia = np.zeros((3, 3))
        inertia[i, j] = inertia[j, i] = 1.0
        basis[k, :3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return basis


def possible(W: Array, y: Array, noise: Array, bodies: int, described: Array, not_negative: Array) -> Array:
    """Parameters, shape (p,): ten of each body first, in the order of `regressors.robot.inertia`.

    Parameters
    ----------
    W : ndarray, shape (N, n, p)
    y : ndarray, shape (N, n)
        [Nm]
    noise : ndarray, shape (n,)
        Deviation of each joint's equations [Nm].
    bodies : int
    described : ndarray, shape (p,)
        Of the robot's description; zero where it says nothing.
    not_negative : ndarray of bool, shape (p,)

    Raises
    ------
    RuntimeError
        The solver found no solution.
    """
    p = W.shape[2]
    size = _sizes(described, bodies)
    rows = np.column_stack([(W * size / noise[:, None]).reshape(-1, p), (y / noise).ravel()])
    R = np.linalg.qr(rows, mode="r")[:p]
    weight, scaled = 1 / FAR**2, described / size
    P = scipy.sparse.block_diag([weight * scipy.sparse.eye(p), scipy.sparse.eye(p)], format="csc")
    q = np.concatenate([-weight * scaled, np.zeros(p)])
    blocks, right, cones = [np.hstack([R[:, :p], -np.eye(p)])], [R[:, p]], [clarabel.ZeroConeT(p)]
    bounds = -np.eye(p)[not_negative]
    blocks.append(np.hstack([bounds, np.zeros_like(bounds)]))
    right.append(np.zeros(len(bounds)))
    cones.append(clarabel.NonnegativeConeT(len(bounds)))
    for body in range(bodies):
        blocks.append(np.hstack([-_cone_rows(size, body), np.zeros((10, p))]))
        right.append(np.zeros(10))
        cones.append(clarabel.PSDTriangleConeT(4))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    A = scipy.sparse.csc_matrix(np.vstack(blocks))
    solution = clarabel.DefaultSolver(scipy.sparse.triu(P, format="csc"), q, A, np.concatenate(right), cones, settings)
    found = solution.solve()
    if str(found.status) not in ("Solved", "AlmostSolved"):
        raise RuntimeError(f"possible bodies: the conic solver ended with {found.status}")
    return np.asarray(found.x)[:p] * size


def _sizes(described: Array, bodies: int) -> Array:
    """Size of each parameter: of bodies by the described mass and a length, one for all others."""
    size = np.ones(described.size)
    unit = np.array([1.0, *(LENGTH,) * 3, *(LENGTH**2,) * 6])
    for body in range(bodies):
        size[10 * body : 10 * body + 10] = max(described[10 * body], 0.1) * unit
    return size


def _cone_rows(size: Array, body: int) -> Array:
    """Rows that make one body's scaled pseudo-inertia of the scaled parameters, shape (10, p)."""
    rows = np.zeros((10, size.size))
    scale = np.array([1 / LENGTH, 1 / LENGTH, 1 / LENGTH, 1.0]) / np.sqrt(size[10 * body])
    for k, J in enumerate(pseudo_inertia_basis()):
        scaled = scale[:, None] * J * scale * size[10 * body + k]
        rows[:, 10 * body + k] = [scaled[i, j] * (1.0 if i == j else np.sqrt(2.0)) for i, j in _UPPER]
    return rows
