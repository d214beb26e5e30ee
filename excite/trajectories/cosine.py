"""Cosine series: back and forth along the same path, at rest at both ends.

``q(t) = c + sum_k a_k cos(k w t)`` with w = 2 pi / T; ``dq(0) = 0`` for every a, ``ddq(0) = -w^2 sum_k k^2 a_k = 0``.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from excite.trajectories.fourier import Fourier
from regressors.arguments import checked
from regressors.samples import Array


@checked
class Cosine(Fourier):
    """Fourier series that are even about the middle of the motion: the second half is the first one reversed.

    Parameters
    ----------
    period : float
        Period T [s].
    harmonics : int
        Number of cosines K, at least 2.
    """

    name = "cosine"

    def __init__(self, period: float, harmonics: int) -> None:
        super().__init__(period, harmonics)
        self.size = harmonics

    @property
    def described(self) -> str:
        """Number of cosines, as text."""
        return f"{self.harmonics} cosines"

    def _rest_basis(self) -> Array:
        """Orthonormal coefficients (c, a_1 .. a_K, 0 .. 0) of motions at rest at t = 0, shape (2K + 1, K)."""
        K = self.harmonics
        order = np.arange(1, K + 1)
        weight = np.concatenate([[1.0], 1.0 / order])
        ends = np.concatenate([[0.0], order**2])[None] * weight
        return np.vstack([weight[:, None] * scipy.linalg.null_space(ends), np.zeros((K, K))])
