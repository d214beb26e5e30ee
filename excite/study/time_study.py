"""Estimates from the part of a motion that has passed, of several motions over time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from excite.storage.records import NUMBERS, Saved, short, write_record
from excite.storage.result_folder import check_not_taken
from regressors.errors import InputError
from regressors.samples import Array

KIND, FIGURE = "study", "estimates_over_time"


@dataclass(frozen=True, eq=False, repr=False)
class TimeStudy(Saved):
    """Time courses of several motions of one robot; the same when it is loaded.

    Parameters
    ----------
    robot : str
        Its name.
    sha256 : str
        Hash of its description.
    courses : tuple of TimeCourse
    below : float
        Share of their magnitude that the deviations are to fall below.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"ends": lambda study: study.ends}

    robot: str
    sha256: str
    courses: tuple[TimeCourse, ...]
    below: float

    def __post_init__(self) -> None:
        """Check that there is a motion."""
        if not self.courses:
            raise InputError("a study is of one motion or more, given none")

    def __repr__(self) -> str:
        """One line."""
        return f"<TimeStudy of {self.robot}: {', '.join(course.name for course in self.courses)}>"

    @property
    def ends(self) -> list[dict[str, Any]]:
        """Of each motion the parameters at its end, and from when on they are determined [s]."""
        ends = []
        for course in self.courses:
            numbers = (course.values[-1], course.half_width[-1], course.time_below(self.below))
            parameters = {
                name: {"value": value, "half_width_99": half, "time_below": time}
                for name, value, half, time in zip(course.names, *(x.tolist() for x in numbers), strict=True)
            }
            condition = float(course.condition_number[-1])
            ends.append({"name": course.name, "condition_number": condition, "parameters": parameters})
        return ends

    def _written(self, place: Path, *, replace: bool) -> list[Path]:
        check_free(place, replace=replace)
        return write_record(self, KIND, place, KIND, [FIGURE])


def check_free(folder: str | Path, names: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a study, or another file of the names, is in the folder and is not to be replaced."""
    check_not_taken(Path(folder), f"{KIND}.json", "a study", names, replace=replace)


@dataclass(frozen=True, eq=False)
class TimeCourse:
    """Estimates of p parameters from the rows up to each of K instants of one motion.

    Parameters
    ----------
    name : str
        Log or design.
    names, units : tuple of str, length p
    time : ndarray, shape (K,)
        Since the first row that is used [s].
    values : ndarray, shape (K, p)
        NaN while the rows so far do not identify the parameters.
    deviation : ndarray, shape (K, p)
        Standard deviations as stated; infinite where the value is NaN.
    quantile : float
        Half of the 99 % interval over the standard deviation.
    condition_number : ndarray, shape (K,)
        cond(W(t)) of the rows so far, not weighted; infinite where they have not full rank.
    reference : ndarray, shape (p,)
        True values, or those of the robot's description; NaN where unknown.
    reference_kind : {"truth", "description"}
    repeated : ndarray, shape (R, K, p), optional
        Values from repetitions with other noise; a file has the first of them only.
    scatter : ndarray, shape (K, p), optional
        Standard deviation of the values of all repetitions.
    repetitions : int
        Their number.
    notes : tuple of str
        Assumptions.
    """

    name: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    values: Array
    deviation: Array
    quantile: float
    condition_number: Array
    reference: Array
    reference_kind: str
    repeated: Array | None = None
    scatter: Array | None = None
    repetitions: int = 0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that the curves are of as many instants and parameters."""
        shape = (self.time.size, len(self.names))
        if not self.time.size or self.values.shape != shape or self.deviation.shape != shape:
            raise InputError(f"expected values and deviations of {shape[1]} parameters at {shape[0]} instants")

    def __repr__(self) -> str:
        """One line."""
        return f"<TimeCourse {self.name}: {len(self.names)} parameters at {self.time.size} instants>"

    @property
    def half_width(self) -> Array:
        """Half of the 99 % intervals, shape (K, p)."""
        return np.asarray(self.quantile * self.deviation)

    @property
    def size(self) -> Array:
        """Magnitude that deviations are compared with: the truth's where it is known, else of the last value, (p,)."""
        known = np.isfinite(self.reference) & (self.reference_kind == "truth")
        return np.abs(np.where(known, self.reference, self.values[-1]))

    @property
    def relative_deviation(self) -> Array:
        """Standard deviation over magnitude, shape (K, p); infinite where there is no value."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.deviation / self.size
        return np.asarray(np.where(np.isfinite(ratio), ratio, np.inf))

    def with_repetitions(self, values: Array, notes: tuple[str, ...]) -> TimeCourse:
        """The same with the values of repetitions, shape (R, K, p), and notes on them."""
        return replace(
            self, repeated=values, scatter=np.std(values, axis=0, ddof=1), repetitions=len(values), notes=notes
        )

    def stored(self) -> TimeCourse:
        """What a file keeps: the first repetitions, with seven digits."""
        if self.repeated is None:
            return self
        return replace(self, repeated=short(self.repeated[: max(1, NUMBERS // self.repeated[0].size)]))

    def time_below(self, share: float) -> Array:
        """Instant from which on each relative deviation stays below a share, shape (p,) [s]; NaN where it never does.

        Parameters
        ----------
        share : float
            0.05 for 5 %.
        """
        below: NDArray[np.bool_] = self.relative_deviation <= share
        stays = np.logical_and.accumulate(below[::-1], axis=0)[::-1]
        first = np.argmax(stays, axis=0)
        return np.where(stays[-1], self.time[first], np.nan)
