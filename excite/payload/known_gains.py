"""What is known of the gains of drives: factors on the stated ones, with their covariance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError, UnknownName
from regressors.samples import Array

STATED_COMMON = 0.1
"""Standard deviation of what stated gains of all drives are off by alike; those published for a UR10e are by 9 %."""
STATED_EACH = 0.05
"""And of each one: there, factors of single drives scatter by 5 % about the common one."""


DRIFT = 0.007
"""And of each from one day to another: there, those of the joints that carry the arm drift by that over four days."""


@checked
@dataclass(frozen=True, eq=False)
class KnownGains:
    """Factors g by which torques from stated gains are to be multiplied.

    Parameters
    ----------
    drives : tuple of str
    factor : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
        Of the factors.
    origin : str
        Where they are from, in words.
    logs : tuple of str
        Hashes of the logs that they are from.
    """

    drives: tuple[str, ...]
    factor: Array
    covariance: Array
    origin: str
    logs: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        k = len(self.drives)
        if self.factor.shape != (k,) or self.covariance.shape != (k, k):
            raise InputError(f"gains: {k} drives need {k} factors and a covariance of {k} x {k} numbers")
        if not np.all(np.isfinite(self.factor)) or np.any(self.factor <= 0):
            raise InputError(f"gains: factors must be positive numbers, given {self.factor.tolist()}")
        least = np.linalg.eigvalsh((self.covariance + self.covariance.T) / 2)[0] if k else 0.0
        if not np.all(np.isfinite(self.covariance)) or least < -1e-9 * max(float(np.abs(self.covariance).max()), 1e-12):
            raise InputError("gains: the covariance of the factors must be that of real numbers, without negative ones")

    @property
    def deviation(self) -> Array:
        """Standard deviation of each factor, shape (k,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def relative(self) -> Array:
        """Covariance of the factors' relative errors, shape (k, k)."""
        return np.asarray(self.covariance / np.outer(self.factor, self.factor))

    def later(self, logs: Iterable[str]) -> KnownGains:
        """The same for logs of another day, between which gains drift; themselves for logs they are from.

        Parameters
        ----------
        logs : iterable of str
            Hashes of the logs.
        """
        if not self.logs or set(logs) & set(self.logs):
            return self
        origin = f"{self.origin}, which drift by {100 * DRIFT:.1g} % (standard deviation) from log to log"
        return replace(self, covariance=self.covariance + np.diag((DRIFT * self.factor) ** 2), origin=origin)

    def of(self, drives: Sequence[str]) -> KnownGains:
        """Those of some drives, in this order.

        Raises
        ------
        UnknownName
            A drive without a gain.
        """
        for name in drives:
            if name not in self.drives:
                raise UnknownName("drive with a calibrated gain", name, self.drives)
        index = [self.drives.index(name) for name in drives]
        chosen = np.ix_(index, index)
        return KnownGains(tuple(drives), self.factor[index], self.covariance[chosen], self.origin, self.logs)


def stated_gains(drives: Sequence[str], common: float = STATED_COMMON, each: float = STATED_EACH) -> KnownGains:
    """Gains as stated, which may all be off by one factor, and each by one of its own."""
    k = len(drives)
    origin = f"the stated gains are taken as known to {100 * np.hypot(common, each):.2g} % (standard deviation)"
    if common:
        origin += f", of which {100 * common:.2g} % are the same in all drives"
    return KnownGains(tuple(drives), np.ones(k), common**2 * np.ones((k, k)) + each**2 * np.eye(k), origin)
