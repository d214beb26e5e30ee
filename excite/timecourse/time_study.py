"""A study of several motions over time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from excite.storage.records import read_record, write_record
from excite.storage.result_folder import check_not_taken, result_folder
from excite.timecourse.time_course import TimeCourse
from regressors.errors import InputError

KIND, FIGURE = "study", "estimates_over_time"


@dataclass(frozen=True, eq=False, repr=False)
class TimeStudy:
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
        return [
            {
                "name": course.name,
                "condition_number": float(course.condition_number[-1]),
                "parameters": {
                    name: {
                        "value": float(course.values[-1, k]),
                        "half_width_99": float(course.half_width[-1, k]),
                        "time_below": float(time),
                    }
                    for k, (name, time) in enumerate(zip(course.names, course.time_below(self.below), strict=True))
                },
            }
            for course in self.courses
        ]

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write ``study.json`` with its curves; `excite.plots.write_time_study_figure` draws it.

        Parameters
        ----------
        folder : path
            Created where it is not there.
        replace : bool
            Replace existing files.

        Returns
        -------
        list of Path

        Raises
        ------
        InputError
            Files that exist already, or a folder that cannot be written to.
        """
        with result_folder(Path(folder)):
            check_free(folder, replace=replace)
            return write_record(self, KIND, Path(folder), KIND, [FIGURE])


def check_free(folder: str | Path, names: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a study, or another file of the names, is in the folder and is not to be replaced."""
    check_not_taken(Path(folder), f"{KIND}.json", "a study", names, replace=replace)


def load_time_study(path: str | Path) -> TimeStudy:
    """Load a ``study.json``."""
    return read_record(Path(path), TimeStudy, KIND)
