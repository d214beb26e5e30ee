"""Damped BFGS approximation of a Hessian, kept as a factor of its inverse."""

from __future__ import annotations

import numpy as np
from scipy.linalg import blas

from regressors.samples import Array

_SMALLEST = 1e-8


class BfgsFactor:
    """Positive definite H, by a matrix J with ``H^-1 = J J'``.

    In whitened coordinates ``w = J^-1 d`` the curvature ``d'Hd`` is ``w'w``, so that a quadratic programme needs no
    factorisation, and an update of J takes n^2 operations.
    """  # g (n,); J (n, n)

    def __init__(self, g: Array) -> None:
        length = max(float(np.linalg.norm(g)), _SMALLEST)
        self.J: Array = np.asfortranarray(np.eye(g.size) / np.sqrt(length))

    def whitened(self, s: Array) -> Array:
        """``J^-1 s``, by a factorisation."""
        return np.asarray(np.linalg.solve(self.J, s))

    def update(self, s: Array, y: Array, w: Array) -> None:
        """BFGS update damped so that H stays positive definite [Powell 1978].

        With ``r = theta y + (1 - theta) H s`` and ``w = J^-1 s``, H becomes ``H - Hs s'H / s'Hs + r r' / s'r`` by
        ``J - s (J'r - sqrt(s'r / w'w) w)' / s'r`` [Brodlie, Gourlay, Greenstadt 1973].
        """  # s, y (n,); w (n,)
        curvature = float(w @ w)  # s'Hs
        if curvature <= 0.0:
            return
        sy = float(s @ y)
        theta = 1.0 if sy >= 0.2 * curvature else 0.8 * curvature / (curvature - sy)
        sr = theta * sy + (1.0 - theta) * curvature
        change = theta * (y @ self.J) + (1.0 - theta - np.sqrt(sr / curvature)) * w
        self.J = blas.dger(-1.0 / sr, s, change, a=self.J, overwrite_a=1)
