"""Mass matrix of a model of joint torques as a linear function of its base parameters."""

from __future__ import annotations

import numpy as np

from excite.information.target import IdentificationTarget
from regressors.samples import Array, Samples


def mass_matrix_regressor(target: IdentificationTarget, q: Array) -> Array | None:
    """Regressor of ``M(q)``, linear in the base parameters: ``M_ij = sum_b K_ijb beta_b``.

    Column j of M is what a unit acceleration of moving coordinate j adds to the torques at rest,
    ``M e_j = N' (Y(q, 0, N e_j) - Y(q, 0, 0)) beta``, with ``q = N s + q0``.
    """  # q (N, n)
    equations = target.model.torque_equations()
    if equations is None or equations.unused:
        return None
    N = equations.motion.matrix
    k, count = N.shape[1], len(q)
    q = (q - equations.motion.offset) @ (N @ np.linalg.pinv(N)).T + equations.motion.offset
    accelerations = np.vstack([np.zeros(N.shape[0]), N.T])  # (k + 1, n)
    ddq = np.tile(accelerations, (count, 1))
    still = np.zeros_like(ddq)
    states = Samples(np.arange(len(ddq), dtype=float), np.repeat(q, k + 1, axis=0), still, ddq, still)
    rows = target.model.instants(states)[:, target.base.index].reshape(count, k + 1, k, -1)
    return np.asarray((rows[:, 1:] - rows[:, :1]).swapaxes(1, 2))


def mass_matrices(target: IdentificationTarget, coefficients: Array, q: Array) -> Array | None:
    """``M(q)``, shape (N, k, k), made symmetric; None as in `mass_matrix_regressor`."""  # coefficients (b,)
    K = mass_matrix_regressor(target, q)
    if K is None:
        return None
    M = K @ coefficients
    return np.asarray((M + M.swapaxes(1, 2)) / 2)
