"""The coordinates of possible robots: bodies with positive definite pseudo-inertias, drives without negative friction.

Every body keeps a share of its described pseudo-inertia, ``J_i(z) - share J0_i > 0`` [Wensing, Kim, Slotine 2018], so
that no sample is flat to rounding; in the body's own scale, ``T^-1 (J_i - share J0_i) T'^-1 > 0`` with ``J0 = T T'``.
Rotor inertias, Coulomb and viscous friction are not negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.identification.estimators.standard import StandardProblem
from excite.posterior.posterior_coordinates import PosteriorCoordinates
from regressors.robot.inertia import pseudo_inertia
from regressors.samples import Array

SHARE = 1e-3  # of its described pseudo-inertia that every body keeps
_FIXED = 1e-12  # slope of a parameter, over its size, that does not count


@dataclass(frozen=True, eq=False)
class PossibleSet:
    """``M_i + sum_k B_ik z_k > 0`` of every body, ``c_j + b_j z > 0`` of every positive parameter.

    Parameters
    ----------
    M : ndarray, shape (bodies, 4, 4)
    B : ndarray, shape (bodies, 4, 4, d)
    c : ndarray, shape (k,)
    b : ndarray, shape (k, d)
    """

    M: Array
    B: Array
    c: Array
    b: Array

    @property
    def size(self) -> int:
        """Number d of coordinates."""
        return int(self.b.shape[1])

    def bodies(self, z: Array) -> Array:
        """Change of each body's matrix by the coordinates, shape (n, bodies, 4, 4)."""
        return np.asarray((z @ self.B.reshape(-1, self.size).T).reshape(len(z), *self.M.shape))

    def margins(self, z: Array) -> Array:
        """Least eigenvalue or value of each constraint, in the parameters' own sizes, shape (n, bodies + k)."""
        least = np.linalg.eigvalsh(self.M + self.bodies(z))[..., 0]
        return np.concatenate([least, self.c + z @ self.b.T], axis=1)

    def contains(self, z: Array) -> NDArray[np.bool_]:
        """Whether each of n points is inside, shape (n,)."""
        return np.asarray(np.all(self.margins(z) > 0.0, axis=1))


def possible_set(standard: StandardProblem, coordinates: PosteriorCoordinates, share: float = SHARE) -> PossibleSet:
    """Possible robots in the coordinates of a posterior.

    Parameters
    ----------
    standard : StandardProblem
    coordinates : PosteriorCoordinates
    share : float
        Of its described pseudo-inertia that every body keeps.
    """
    M, B = np.zeros((len(standard.bodies), 4, 4)), np.zeros((len(standard.bodies), 4, 4, coordinates.size))
    for k, body in enumerate(standard.bodies):
        T = np.linalg.inv(np.linalg.cholesky(body.reference))
        M[k] = T @ pseudo_inertia(coordinates.origin[body.index]) @ T.T - share * np.eye(4)
        B[k] = np.stack([T @ pseudo_inertia(column) @ T.T for column in coordinates.slope[body.index].T], axis=-1)
    scale = standard.scale[standard.positive]
    c, b = coordinates.origin[standard.positive] / scale, coordinates.slope[standard.positive] / scale[:, None]
    free = np.abs(b).max(axis=1, initial=0.0) > _FIXED
    return PossibleSet(M, B, c[free], b[free])
