"""Design criteria: functions of the information matrix M = W'W / N.

With equal noise of variance s^2 in the N rows, the covariance of the parameters is ``s^2/N M^-1``; the criterion is the
root of its largest diagonal entry without ``s^2/N``. It is between the mean of the variances (A-optimality) and the
largest variance of any combination (E-optimality), and like these it depends on the units of the parameters. The smooth
approximations are the p-means of variances, of Kiefer's family [Pukelsheim 2006, chapter 6].

[Elfving 1959] G. Elfving, "Design of linear experiments", in: Probability and Statistics, The Harald Cramer Volume.
[Pukelsheim 2006] F. Pukelsheim, "Optimal Design of Experiments", SIAM.

Criteria of predicted torques: V-, I- and G-optimality.

With equal noise of variance s^2 in the N rows, the torque ``y beta`` that estimated parameters predict has the variance
``s^2/N y M^-1 y'``. The criteria are the root of its mean over the rows y of a motion or a set of states,
``tr(M^-1 A)`` with ``A = Y'Y / K`` (V-optimality, I- over a region), and of its largest value (G-optimality), both
without ``s^2/N`` [Atkinson, Donev, Tobias 2007, chapter 10]. They do not depend on the units of parameters, nor on the
choice of base columns.

[Atkinson, Donev, Tobias 2007] "Optimum Experimental Designs, with SAS", Oxford University Press.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import scipy

from regressors.samples import Array

_FLOOR = 1e-300


class Criterion(ABC):
    """A function of M, with smooth approximations for the optimiser.

    Attributes
    ----------
    name : str
        Short name, as in ``criterion="condition"``.
    stages : tuple of float
        Sharpness of the approximations, solved one after the other with warm starts.
    """

    name: str
    stages: tuple[float, ...]

    @abstractmethod
    def value(self, M: Array) -> float:
        """The criterion itself, as users know it."""

    @abstractmethod
    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """Smooth approximation to minimise and its gradient ``G = df/dM``, shape (b, b)."""

    def smooth_and_value(self, M: Array, sharpness: float) -> tuple[float, Array, float]:
        """What `smooth` and `value` return, where one computation serves both."""
        return *self.smooth(M, sharpness), self.value(M)


def condition_number(M: Array) -> float:
    """2-norm condition number of W from ``M = W'W / N``: ``sqrt(max eig M / min eig M)``; infinite if singular."""
    return _condition(scipy.linalg.eigvalsh(M, check_finite=False))


def _condition(eigenvalues: Array) -> float:
    none = np.finfo(float).eps * eigenvalues[-1]  # what is left of zero by rounding
    return float(np.sqrt(eigenvalues[-1] / eigenvalues[0])) if eigenvalues[0] > none else np.inf


class SpectralCriterion(Criterion):
    """A criterion given by a function of the eigenvalues in ascending order."""

    @abstractmethod
    def spectral(self, eigenvalues: Array, sharpness: float) -> tuple[float, Array]:
        """Smooth approximation and its derivative with respect to each eigenvalue.

        Parameters
        ----------
        eigenvalues : ndarray, shape (b,)
            Eigenvalues of M, ascending and positive.
        sharpness : float
        """

    def of_eigenvalues(self, eigenvalues: Array) -> float | None:
        """The criterion from the ascending eigenvalues of M; None where it takes M itself."""
        return None

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """Spectral function ``f`` and ``G = V diag(df/dlambda) V'``."""
        value, G, _ = self._decomposed(M, sharpness)
        return value, G

    def smooth_and_value(self, M: Array, sharpness: float) -> tuple[float, Array, float]:
        """Both by one decomposition, where the criterion needs the eigenvalues only."""
        smooth, G, eigenvalues = self._decomposed(M, sharpness)
        value = self.of_eigenvalues(eigenvalues)
        return smooth, G, self.value(M) if value is None else value

    def _decomposed(self, M: Array, sharpness: float) -> tuple[float, Array, Array]:
        eigenvalues, V = np.linalg.eigh(M)
        value, slope = self.spectral(np.maximum(eigenvalues, _FLOOR), sharpness)
        return value, np.asarray((V * slope) @ V.T), eigenvalues


def _log_power_mean(ratios: Array, p: float) -> tuple[float, Array]:
    """``(1/p) log sum ratios^p`` and each term's share of the sum; ratios are at most 1."""
    powers = ratios**p
    total = float(powers.sum())
    return float(np.log(total)) / p, powers / total


class ConditionNumber(SpectralCriterion):
    """2-norm condition number of W.

    The approximation ``(1/2p) (log tr M^p + log tr M^-p)`` is smooth, never below ``log cond(W)``, and tends to it as
    the sharpness p grows; p = 1 is the logarithm of the Frobenius condition number of W.
    """

    name = "condition"
    stages: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)

    def value(self, M: Array) -> float:
        """``cond(W)``."""
        return condition_number(M)

    def of_eigenvalues(self, eigenvalues: Array) -> float | None:
        """``cond(W)``."""
        return _condition(eigenvalues)

    def spectral(self, eigenvalues: Array, sharpness: float) -> tuple[float, Array]:
        """The smooth approximation of the class."""
        high, high_share = _log_power_mean(eigenvalues / eigenvalues[-1], sharpness)
        low, low_share = _log_power_mean(eigenvalues[0] / eigenvalues, sharpness)
        spread = float(np.log(eigenvalues[-1]) - np.log(eigenvalues[0]))
        return 0.5 * (high + low + spread), 0.5 * (high_share - low_share) / eigenvalues


class FrobeniusCondition(ConditionNumber):
    """Frobenius condition number of W, ``sqrt(tr M tr M^-1)`` [Vandanjon, Gautier, Desbats 1995]."""

    name = "frobenius"
    stages = (1.0,)

    def value(self, M: Array) -> float:
        """``|W|_F |W^+|_F``."""
        return float(np.exp(self.smooth(M, 1.0)[0]))

    def of_eigenvalues(self, eigenvalues: Array) -> float | None:
        """``|W|_F |W^+|_F``."""
        return float(np.exp(self.spectral(np.maximum(eigenvalues, _FLOOR), 1.0)[0]))

    def spectral(self, eigenvalues: Array, sharpness: float) -> tuple[float, Array]:
        """The exact logarithm for any sharpness."""
        return super().spectral(eigenvalues, 1.0)


def _largest_deviation(eigenvalues: Array) -> float:
    return float(eigenvalues[0] ** -0.5) if eigenvalues[0] > 0 else np.inf


class SmallestSingularValue(SpectralCriterion):
    """Largest uncertainty of any combination of parameters, ``1 / sigma_min(W / sqrt N)``.

    The approximation ``(1/2p) log tr M^-p`` is never below its logarithm, and tends to it as p grows.
    """

    name = "sigma-min"
    stages = (1.0, 4.0, 16.0, 64.0)

    def value(self, M: Array) -> float:
        """``1 / sqrt(min eig M)``; infinite if singular."""
        return _largest_deviation(scipy.linalg.eigvalsh(M, check_finite=False))

    def of_eigenvalues(self, eigenvalues: Array) -> float | None:
        """``1 / sqrt(min eig M)``."""
        return _largest_deviation(eigenvalues)

    def spectral(self, eigenvalues: Array, sharpness: float) -> tuple[float, Array]:
        """The smooth approximation of the class."""
        low, share = _log_power_mean(eigenvalues[0] / eigenvalues, sharpness)
        return 0.5 * (low - float(np.log(eigenvalues[0]))), -0.5 * share / eigenvalues


class Determinant(SpectralCriterion):
    """Volume of the confidence ellipsoid, D-optimality: ``det(M)^(-1/2b)``, the geometric mean of its half-axes."""

    name = "logdet"
    stages = (1.0,)

    def value(self, M: Array) -> float:
        """``det(M)^(-1/2b)``; infinite if singular."""
        sign, logarithm = np.linalg.slogdet(M)
        return float(np.exp(-0.5 * logarithm / M.shape[0])) if sign > 0 else np.inf

    def spectral(self, eigenvalues: Array, sharpness: float) -> tuple[float, Array]:
        """``-(1/2b) log det M``."""
        b = eigenvalues.size
        return -0.5 * float(np.mean(np.log(eigenvalues))), -0.5 / (b * eigenvalues)


class Trace(SpectralCriterion):
    """Sum of the parameters' variances, A-optimality: ``sqrt(tr M^-1)``."""

    name = "trace"
    stages = (1.0,)

    def value(self, M: Array) -> float:
        """``sqrt(tr M^-1)``."""
        return float(np.exp(self.smooth(M, 1.0)[0]))

    def spectral(self, eigenvalues: Array, sharpness: float) -> tuple[float, Array]:
        """``(1/2) log tr M^-1``."""
        inverse = 1.0 / eigenvalues
        total = float(inverse.sum())
        return 0.5 * float(np.log(total)), -0.5 * inverse / total * inverse


class MaxDeviation(Criterion):
    """Largest standard deviation of any single parameter, ``sqrt(max_k (M^-1)_kk)``.

    The approximation ``(1/2p) log sum_k ((M^-1)_kk)^p`` is never below its logarithm, and tends to it as p grows; p = 1
    is A-optimality.
    """

    name = "max-deviation"
    stages = (1.0, 4.0, 16.0, 64.0)

    def value(self, M: Array) -> float:
        """``sqrt(max_k (M^-1)_kk)``; infinite if singular."""
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False)
        return float(np.sqrt((V**2 @ (1 / eigenvalues)).max())) if eigenvalues[0] > 0 else np.inf

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """The smooth approximation of the class, with ``G = -(1/2) sum_k (w_k / v_k) c_k c_k'``.

        v_k is entry k of the diagonal of ``M^-1``, c_k its column k, and ``w_k = v_k^p / sum v^p``.
        """
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False, driver="evd")
        half = V / np.sqrt(np.maximum(eigenvalues, _FLOOR))  # M^-1 = half half'
        deviation = np.linalg.norm(half, axis=1)
        powers = 2 * sharpness * np.log(deviation)
        C = half @ (half / deviation[:, None]).T  # c_k over the deviation of parameter k, in column k
        value = float(scipy.special.logsumexp(powers)) / (2 * sharpness)
        return value, np.asarray(-0.5 * (C * scipy.special.softmax(powers)) @ C.T)


@dataclass(frozen=True, eq=False)
class TorqueCriterion(Criterion):
    """A function of the variances of predicted torques."""

    # (K, b) ``Y``, rows of the torques in the columns of M. If not given, a design takes those of its task motion; of M
    # alone, each single parameter is one
    rows: Array | None = field(default=None, repr=False)

    def of_rows(self, rows: Array) -> Self:
        """The criterion of given rows, where it has none of its own."""
        return self if self.rows is not None else replace(self, rows=rows)

    @abstractmethod
    def of_variances(self, variances: Array, sharpness: float) -> tuple[float, Array]:
        """Logarithm f of the deviation that counts, or an approximation, and shares ``2 v_k df/dv_k``, of sum 1."""

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """``G = -(1/2) sum_k (w_k / v_k) c_k c_k'`` with ``c_k = M^-1 y_k'`` and the shares w of `of_variances`."""
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False, driver="evd")
        half = V / np.sqrt(np.maximum(eigenvalues, _FLOOR))  # M^-1 = half half'
        scaled = half.T if self.rows is None else half.T @ self.rows.T
        deviation = np.linalg.norm(scaled, axis=0)
        value, share = self.of_variances(deviation**2, sharpness)
        C = half @ (scaled * (np.sqrt(share) / np.maximum(deviation, _FLOOR)))
        return value, np.asarray(-0.5 * C @ C.T)

    def _variances(self, M: Array) -> Array:
        """Variance of each row's torque; infinite where M is singular."""
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False)
        if eigenvalues[0] <= 0:
            return np.array([np.inf])
        rows = V if self.rows is None else self.rows @ V
        return np.asarray(rows**2 @ (1 / eigenvalues))


class TorqueDeviation(TorqueCriterion):
    """Root of the mean variance of predicted torques, ``sqrt(tr(M^-1 A))``."""

    name = "torque-deviation"
    stages: tuple[float, ...] = (1.0,)

    def value(self, M: Array) -> float:
        """``sqrt(tr(M^-1 A))``; infinite if singular."""
        return float(np.sqrt(self._variances(M).mean()))

    def of_variances(self, variances: Array, sharpness: float) -> tuple[float, Array]:
        """Exactly, for any sharpness."""
        return 0.5 * float(np.log(variances.mean())), variances / variances.sum()


class MaxTorqueDeviation(TorqueCriterion):
    """Largest standard deviation of any predicted torque, ``sqrt(max_k y_k M^-1 y_k')``.

    The approximation ``(1/2p) log sum_k v_k^p`` of the variances v tends to its logarithm from above as p grows.
    """

    name = "max-torque-deviation"
    stages: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)

    def value(self, M: Array) -> float:
        """``sqrt(max_k y_k M^-1 y_k')``; infinite if singular."""
        return float(np.sqrt(self._variances(M).max()))

    def of_variances(self, variances: Array, sharpness: float) -> tuple[float, Array]:
        """The approximation of the class."""
        powers = sharpness * np.log(np.maximum(variances, _FLOOR))
        return float(scipy.special.logsumexp(powers)) / (2 * sharpness), np.asarray(scipy.special.softmax(powers))
