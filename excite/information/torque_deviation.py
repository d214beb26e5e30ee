"""Criteria of predicted torques: V-, I- and G-optimality.

With equal noise of variance s^2 in the N rows, the torque ``y beta`` that estimated parameters predict has the variance
``s^2/N y M^-1 y'``. The criteria are the root of its mean over the rows y of a motion or a set of states,
``tr(M^-1 A)`` with ``A = Y'Y / K`` (V-optimality, I- over a region), and of its largest value (G-optimality), both
without ``s^2/N`` [Atkinson, Donev, Tobias 2007, chapter 10]. They do not depend on the units of parameters, nor on the
choice of base columns.

[Atkinson, Donev, Tobias 2007] "Optimum Experimental Designs, with SAS", Oxford University Press.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.linalg
import scipy.special

from excite.information.criteria import Criterion
from regressors.samples import Array

_FLOOR = 1e-300


@dataclass(frozen=True, eq=False)
class TorqueCriterion(Criterion):
    """A function of the variances of predicted torques.

    Parameters
    ----------
    rows : ndarray, shape (K, b), optional
        ``Y``, rows of the torques in the columns of M. If not given, a design takes those of its task motion; of M
        alone, each single parameter is one.
    """

    rows: Array | None = None

    def of_rows(self, rows: Array) -> Self:
        """The criterion of given rows, where it has none of its own."""
        return self if self.rows is not None else replace(self, rows=rows)

    @abstractmethod
    def of_variances(self, variances: Array, sharpness: float) -> tuple[float, Array]:
        """Logarithm of the deviation that counts, or an approximation, and each row's share of its slope.

        Parameters
        ----------
        variances : ndarray, shape (K,)
        sharpness : float

        Returns
        -------
        value : float
        share : ndarray, shape (K,)
            ``2 v_k df/dv_k``, of sum 1.
        """

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """``G = -(1/2) sum_k (w_k / v_k) c_k c_k'`` with ``c_k = M^-1 y_k'`` and the shares w of `of_variances`."""
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False, driver="evd")
        half = V / np.sqrt(np.maximum(eigenvalues, _FLOOR))  # M^-1 = half half'
        scaled = half.T if self.rows is None else half.T @ self.rows.T
        deviation = np.linalg.norm(scaled, axis=0)
        value, share = self.of_variances(deviation**2, sharpness)
        C = half @ (scaled * (np.sqrt(share) / np.maximum(deviation, _FLOOR)))
        return value, np.asarray(-0.5 * C @ C.T)

    def _variances(self, M: Array) -> Array | None:
        """Variance of each row's torque; None where M is singular."""
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False)
        if eigenvalues[0] <= 0:
            return None
        rows = V if self.rows is None else self.rows @ V
        return np.asarray(rows**2 @ (1 / eigenvalues))


class TorqueDeviation(TorqueCriterion):
    """Root of the mean variance of predicted torques, ``sqrt(tr(M^-1 A))``."""

    name = "torque-deviation"
    stages: tuple[float, ...] = (1.0,)

    def value(self, M: Array) -> float:
        """``sqrt(tr(M^-1 A))``; infinite if singular."""
        variances = self._variances(M)
        return np.inf if variances is None else float(np.sqrt(variances.mean()))

    def of_variances(self, variances: Array, sharpness: float) -> tuple[float, Array]:
        """Exactly, for any sharpness."""
        return 0.5 * float(np.log(variances.mean())), variances / variances.sum()


class MaxTorqueDeviation(TorqueCriterion):
    """Largest standard deviation of any predicted torque, ``sqrt(max_k y_k M^-1 y_k')``.

    The approximation ``(1/2p) log sum_k v_k^p`` of the variances v is never below its logarithm, and tends to it as p
    grows.
    """

    name = "max-torque-deviation"
    stages: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)

    def value(self, M: Array) -> float:
        """``sqrt(max_k y_k M^-1 y_k')``; infinite if singular."""
        variances = self._variances(M)
        return np.inf if variances is None else float(np.sqrt(variances.max()))

    def of_variances(self, variances: Array, sharpness: float) -> tuple[float, Array]:
        """The approximation of the class."""
        powers = sharpness * np.log(np.maximum(variances, _FLOOR))
        return float(scipy.special.logsumexp(powers)) / (2 * sharpness), np.asarray(scipy.special.softmax(powers))
