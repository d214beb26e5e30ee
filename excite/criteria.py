"""What a design minimises: functions of the eigenvalues of the information matrix M = W'W / N."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import scipy.linalg

from regressors.samples import Array

_FLOOR = 1e-300


class Criterion(ABC):
    """A function of the eigenvalues of M, with smooth stand-ins for the optimiser.

    Attributes
    ----------
    name : str
        As in ``--criterion``.
    stages : tuple of float
        Sharpness of the stand-ins, solved one after the other with warm starts.
    """

    name: str
    stages: tuple[float, ...]

    @abstractmethod
    def value(self, M: Array) -> float:
        """The criterion itself, as users know it."""

    @abstractmethod
    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """Stand-in to minimise and its gradient ``G = df/dM``, shape (b, b)."""


def condition_number(M: Array) -> float:
    """2-norm condition number of W from ``M = W'W / N``: ``sqrt(max eig M / min eig M)``; infinite if singular."""
    eigenvalues = scipy.linalg.eigvalsh(M, check_finite=False)
    return float(np.sqrt(eigenvalues[-1] / eigenvalues[0])) if eigenvalues[0] > 0 else np.inf


class ConditionNumber(Criterion):
    """2-norm condition number of W.

    The stand-in ``(1/2p) (log tr M^p + log tr M^-p)`` is smooth, never below ``log cond(W)``, and tends to it as the
    sharpness p grows; p = 1 is the logarithm of the Frobenius condition number of M, halved.
    """

    name = "condition"
    stages = (1.0, 4.0, 16.0, 64.0)

    def value(self, M: Array) -> float:
        """``cond(W)``."""
        return condition_number(M)

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """Spectral function ``f`` and ``G = V diag(df/dlambda) V'``."""
        p = sharpness
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False, driver="evd")
        eigenvalues = np.maximum(eigenvalues, _FLOOR)
        high = (eigenvalues / eigenvalues[-1]) ** p
        low = (eigenvalues[0] / eigenvalues) ** p
        high_sum, low_sum = float(high.sum()), float(low.sum())
        spread = np.log(eigenvalues[-1]) - np.log(eigenvalues[0])
        value = 0.5 * ((np.log(high_sum) + np.log(low_sum)) / p + spread)
        slope = 0.5 * (high / high_sum - low / low_sum) / eigenvalues
        return float(value), np.asarray((V * slope) @ V.T)
