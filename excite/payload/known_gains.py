"""What is known of the gains of drives: factors with their covariance, and their file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from excite.storage.result_folder import settle_files, write_file
from regressors.arguments import checked
from regressors.errors import InputError, check_names, percent
from regressors.readers.documents import read_document, validate
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
        origin = f"{self.origin}, which drift by {percent(DRIFT, 1)} (standard deviation) from log to log"
        return replace(self, covariance=self.covariance + np.diag((DRIFT * self.factor) ** 2), origin=origin)

    def of(self, drives: Sequence[str]) -> KnownGains:
        """Those of some drives, in this order.

        Raises
        ------
        UnknownName
            A drive without a gain.
        """
        check_names("drive with a calibrated gain", drives, self.drives)
        index = [self.drives.index(name) for name in drives]
        chosen = np.ix_(index, index)
        return KnownGains(tuple(drives), self.factor[index], self.covariance[chosen], self.origin, self.logs)


def stated_gains(drives: Sequence[str], common: float = STATED_COMMON, each: float = STATED_EACH) -> KnownGains:
    """Gains as stated, which may all be off by one factor, and each by one of its own."""
    k = len(drives)
    origin = f"the stated drive gains are taken as known to {percent(np.hypot(common, each))} (standard deviation)"
    if common:
        origin += f", of which {percent(common)} are the same in all drives"
    return KnownGains(tuple(drives), np.ones(k), common**2 * np.ones((k, k)) + each**2 * np.eye(k), origin)


SCHEMA = "excite.gains/1"
_HEAD = (
    "# Measured torques, or currents times the stated gains, are to be multiplied by `factor`; `deviation` is its",
    "# standard deviation. `correlation` is that between the factors, in the order of the drives.",
)
_LARGEST = 1e6


class _Drive(BaseModel, extra="forbid", allow_inf_nan=False):
    factor: float
    deviation: float


class _Gains(BaseModel, extra="forbid", allow_inf_nan=False):
    form: str = Field(alias="schema")
    robot: str = ""
    known_mass: float | None = None
    drives: dict[str, _Drive]
    correlation: list[list[float]] | None = None
    logs: list[str] = []


def write_gains(gains: KnownGains, path: Path, *, robot: str, mass: float, replace: bool = False) -> None:
    """Write a file of gains."""
    deviation = gains.deviation
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.nan_to_num(gains.covariance / np.outer(deviation, deviation))
    np.fill_diagonal(correlation, 1.0)
    lines = [*_HEAD, f"schema: {SCHEMA}", f"robot: {json.dumps(robot)}", f"known_mass: {mass!r}", "drives:"]
    for name, factor, own in zip(gains.drives, gains.factor.tolist(), deviation.tolist(), strict=True):
        lines.append(f"  {json.dumps(name)}: {{factor: {factor!r}, deviation: {own!r}}}")
    lines.append("correlation:")
    lines += [f"  - {json.dumps([round(x, 12) for x in row])}" for row in correlation.tolist()]
    lines.append(f"logs: {json.dumps(list(gains.logs))}")
    write_file(path, ("\n".join(lines) + "\n").encode(), replace=replace)


def read_gains(path: Path) -> KnownGains:
    """Read a file of gains."""
    settle_files(path)
    document = read_document(path, "gains")
    content: Any = validate(document, _Gains)
    if content.form != SCHEMA:
        raise InputError(f"{path}: expected schema {SCHEMA}, given {str(content.form)[:40]}")
    drives = tuple(content.drives)
    factor = np.array([drive.factor for drive in content.drives.values()])
    deviation = np.array([drive.deviation for drive in content.drives.values()])
    k = len(drives)
    correlation = np.eye(k) if content.correlation is None else np.array(content.correlation, dtype=object)
    if correlation.shape != (k, k):
        raise InputError(f"{path}: the correlation of {k} drives needs {k} rows of {k} numbers")
    if k == 0 or np.any(deviation < 0) or np.any(np.abs(factor) > _LARGEST) or np.any(deviation > _LARGEST):
        raise InputError(f"{path}: factors and deviations must be positive numbers up to {_LARGEST:g}, of some drives")
    covariance = np.asarray(correlation, dtype=float) * np.outer(deviation, deviation)
    try:
        return KnownGains(drives, factor, covariance, f"drive gains as calibrated in {path}", tuple(content.logs))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
