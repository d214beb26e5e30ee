"""Statistics of an estimator over many repetitions: bias, spread, and coverage of its confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.stats

from excite.identification.estimate import CONFIDENCE
from regressors.samples import Array


class Repetition(NamedTuple):
    """One repetition."""

    error: Array  # (b,) estimate less true value
    deviation: Array  # (b,) standard deviation that the estimator predicts, from this repetition's residuals
    noise: Array  # (r,) standard deviation of each equation's residuals


@dataclass(frozen=True, eq=False)
class Repetitions:
    """Estimates of the same b parameters in R repetitions of an experiment."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    beta: Array  # (b,) True values
    estimates: Array  # (R, b)
    # (R, b) standard deviation that the estimator predicts in each repetition, from that repetition's residuals
    predicted: Array
    noise: Array  # (R, r) standard deviation of each equation's residuals
    degrees_of_freedom: int  # of Student's t for the intervals
    seed: int
    interrupted: bool = False  # whether Ctrl-C ended the repetitions before the last one

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
