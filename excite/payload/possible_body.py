"""The body that real masses can make nearest to an estimate [Wensing, Kim, Slotine 2018]."""

from __future__ import annotations

import numpy as np

from excite.identification.estimators.possible_set import PossibleSet, body_in_coordinates, nearest, own_scale
from regressors.robot.inertia import from_pseudo_inertia, pseudo_inertia
from regressors.samples import Array

_LEAST = 1e-7  # of the size of the body: smallest eigenvalue of its pseudo-inertia in units of mass and length
_LEAST_LENGTH = 1e-3
_LEAST_VARIANCE = 1e-12  # of the largest one


def is_possible(phi: Array) -> bool:
    """Whether a body has the ten parameters: its pseudo-inertia is positive definite."""
    return bool(phi[0] > 0 and np.linalg.eigvalsh(pseudo_inertia(phi))[0] > 0)


def nearest_possible(phi: Array, covariance: Array) -> Array:
    """Parameters of a real body that the estimate excludes least.

    ``min (x - phi)' C^-1 (x - phi)`` subject to a positive definite pseudo-inertia of x; phi itself where it is one.
    """  # phi (10,); covariance (10, 10)
    if is_possible(phi):
        return phi
    length = max(
        _LEAST_LENGTH, float(np.linalg.norm(phi[1:4]) / phi[0]), float(np.sqrt(np.abs(phi[4:]).max() / phi[0]))
    )
    scale = phi[0] * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    slope = scale[:, None] * vectors * np.sqrt(np.maximum(values, _LEAST_VARIANCE * values[-1]) / values[-1])
    ball = phi[0] * np.diag([length**2] * 3 + [1.0])
    M, B = body_in_coordinates(phi, slope, _LEAST * ball, own_scale(ball))
    inside = np.linalg.solve(slope, from_pseudo_inertia(ball) - phi)
    possible = PossibleSet(M[None], B[None], np.zeros(0), np.zeros((0, 10)))
    z, _ = nearest(possible, inside)
    return np.asarray(phi + slope @ possible.towards(z, inside))
