"""An estimate of the parameters, with its uncertainty and assumptions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from excite.identification.observations import Observations
from excite.storage.codec import named
from regressors.samples import Array

CONFIDENCE = 0.99


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimate of p parameters.

    Parameters
    ----------
    method : str
        Registered name of the estimator.
    names, units : tuple of str, length p
    values : ndarray, shape (p,)
        NaN where the parameter is not identifiable.
    covariance : ndarray, shape (p, p)
        Of the values; infinite variances where the parameter is not identifiable.
    noise : ndarray, shape (logs, equations)
        Standard deviation of the residuals of each log's equations, or the known one [units of the equations].
    degrees_of_freedom : int
        Rows less estimated parameters; of Student's t for the intervals.
    unseen : tuple of str
        Parameters that are not identifiable on their own.
    notes : tuple of str
        Assumptions of the method, and remarks on the result.
    standard : mapping of str to float
        Standard parameters of bodies and drives, where the method estimates them.
    history : tuple of (ndarray, ndarray), optional
        Of the recursive method: times, shape (k,) [s], and estimates after them, shape (k, p).
    fit : ndarray, shape (p,), optional
        Values for predictions, also of parameters that are not identifiable on their own; `values` if not given.
    unconstrained : ndarray, shape (p,), optional
        Values for predictions by the same equations without bounds and pull, where the method has them.
    mismatch : ndarray, shape (p, p), optional
        Second moments of the error by friction of other forms than the model's, where the log shows it; not part of the
        covariance, see `excite.identification.biases`.
    """

    listed: ClassVar[bool] = True

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    noise: Array = field(metadata=named("noise_deviations"))
    degrees_of_freedom: int
    unseen: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    standard: Mapping[str, float] = field(default_factory=dict)
    history: tuple[Array, Array] | None = None
    fit: Array | None = None
    unconstrained: Array | None = None
    mismatch: Array | None = None

    @property
    def coefficients(self) -> Array:
        """Values for predictions, shape (p,): `fit`, or `values` with zeros for those not identifiable."""
        return np.nan_to_num(self.values, nan=0.0) if self.fit is None else self.fit

    @property
    def deviation(self) -> Array:
        """Standard deviation of each value, shape (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def half_width(self) -> Array:
        """Half of the 99 % confidence interval of each value, by Student's t, shape (p,)."""
        quantile = scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, max(self.degrees_of_freedom, 1))
        return np.asarray(quantile * self.deviation)

    @property
    def interval(self) -> Array:
        """99 % confidence interval of each value, shape (p, 2)."""
        return np.column_stack([self.values - self.half_width, self.values + self.half_width])

    @property
    def relative_deviation(self) -> Array:
        """Standard deviation over magnitude of each value, shape (p,); infinite where the value is zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(self.values == 0.0, np.inf, self.deviation / np.abs(self.values)))

    def predicted(self, observations: Observations) -> Array:
        """``W beta``, shape (m,), with `coefficients`."""
        return np.asarray(observations.W @ self.coefficients)

    def residual(self, observations: Observations) -> Array:
        """``y - W beta``, shape (m,)."""
        return np.asarray(observations.y - self.predicted(observations))


def noted(estimate: Estimate, *notes: str) -> Estimate:
    """An estimate with further notes."""
    return replace(estimate, notes=(*estimate.notes, *notes))


def allowing_for(estimate: Estimate, errors: Array, *notes: str, covariance: Array | None = None) -> Estimate:
    """Extend the covariance of an estimate by errors beside its noise, ``Cov + G C G'``, and note why.

    G are the changes of the estimate, shape (p,) or (p, k), by errors of covariance C, or else of one and independent.
    """
    G = errors.reshape(len(estimate.names), -1)
    seen = np.isfinite(np.diag(estimate.covariance))
    added = (G if covariance is None else G @ covariance) @ G.T
    return noted(replace(estimate, covariance=estimate.covariance + np.where(np.outer(seen, seen), added, 0.0)), *notes)


def largest_share(estimate: Estimate, changes: Array) -> tuple[int, float]:
    """The parameter that changes most in its deviations, and by how many."""  # changes (p,)
    deviation = estimate.deviation
    known = np.isfinite(deviation) & (deviation > 0)
    share = np.divide(np.abs(changes), deviation, out=np.zeros_like(deviation), where=known)
    worst = int(np.argmax(share))
    return worst, float(share[worst])


def of_seen(covariance: Array, seen: NDArray[np.bool_]) -> Array:
    """Covariance of the parameters that are identifiable: infinite variances of the others, shape (p, p)."""
    kept = np.where(np.outer(seen, seen), covariance, 0.0)
    kept[np.diag_indices_from(kept)] = np.where(seen, np.diag(covariance), np.inf)
    return kept
