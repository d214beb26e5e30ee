"""Statistics of an estimator over many repetitions: bias, spread, and coverage of its confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.stats

from excite.identification.estimate import CONFIDENCE
from regressors.samples import Array


class Repetition(NamedTuple):
    """One repetition.

    Parameters
    ----------
    error : ndarray, shape (b,)
        Estimate less true value.
    deviation : ndarray, shape (b,)
        Standard deviation that the estimator predicts, from this repetition's residuals.
    noise : ndarray, shape (r,)
        Standard deviation of each equation's residuals.
    """

    error: Array
    deviation: Array
    noise: Array


@dataclass(frozen=True, eq=False)
class Repetitions:
    """Estimates of the same b parameters in R repetitions of an experiment.

    Parameters
    ----------
    names, units : tuple of str, length b
    beta : ndarray, shape (b,)
        True values.
    estimates : ndarray, shape (R, b)
    predicted : ndarray, shape (R, b)
        Standard deviation that the estimator predicts in each repetition, from that repetition's residuals.
    noise : ndarray, shape (R, r)
        Standard deviation of each equation's residuals.
    degrees_of_freedom : int
        Of Student's t for the intervals.
    seed : int
    interrupted : bool
        Whether Ctrl-C ended the repetitions before the last one.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    beta: Array
    estimates: Array
    predicted: Array
    noise: Array
    degrees_of_freedom: int
    seed: int
    interrupted: bool = False

    @property
    def count(self) -> int:
        """Number of repetitions, R."""
        return len(self.estimates)

    @property
    def deviation(self) -> Array:
        """Sample standard deviation of the estimates, shape (b,)."""
        return np.asarray(np.std(self.estimates, axis=0, ddof=1))

    @property
    def predicted_deviation(self) -> Array:
        """Root mean square of the predicted deviations, shape (b,)."""
        return np.asarray(np.sqrt(np.mean(self.predicted**2, axis=0)))

    @property
    def bias(self) -> Array:
        """Mean error, shape (b,)."""
        return np.asarray(np.mean(self.estimates - self.beta, axis=0))

    @property
    def bias_error(self) -> Array:
        """Standard deviation of `bias`, shape (b,)."""
        return np.asarray(self.deviation / np.sqrt(self.count))

    @property
    def covered(self) -> Array:
        """Whether each 99 % interval holds the true value, shape (R, b)."""
        quantile = scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, self.degrees_of_freedom)
        return np.asarray(np.abs(self.estimates - self.beta) <= quantile * self.predicted)

    @property
    def coverage(self) -> Array:
        """Share of the 99 % intervals that hold the true value, shape (b,)."""
        return np.asarray(np.mean(self.covered, axis=0))
