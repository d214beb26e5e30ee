"""A study of several motions over time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from excite.registry import built_in
from excite.timecourse.time_course import TimeCourse


@dataclass(frozen=True, eq=False, repr=False)
class TimeStudy:
    """Time courses of several motions of one robot.

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

    robot: str
    sha256: str
    courses: tuple[TimeCourse, ...]
    below: float

    def __repr__(self) -> str:
        """One line."""
        return f"<TimeStudy of {self.robot}: {', '.join(course.name for course in self.courses)}>"

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write ``study.json``; `excite.plots.write_time_study_figure` draws it.

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
        files: list[Path] = built_in("writer", "time study")(self, folder, replace=replace)
        return files
