"""``study.json``: estimates over the growing time of several motions."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from excite.files.figure_names import figure_names
from excite.storage.atomic import write_json
from excite.storage.result_folder import check_not_taken, replace_result, result_folder
from excite.timecourse.time_course import TimeCourse
from excite.timecourse.time_study import TimeStudy
from regressors.samples import Array

SCHEMA = "excite.study/1"
NAME, FIGURE, KIND = "study.json", "estimates_over_time", "study"


def save_time_study(study: TimeStudy, folder: str | Path, *, replace: bool = False) -> list[Path]:
    """Write a study's numbers into a folder, created if it does not exist.

    Parameters
    ----------
    study : TimeStudy
    folder : path
    replace : bool
        Replace existing files, when the new ones are complete.

    Returns
    -------
    list of Path
        ``study.json``.

    Raises
    ------
    InputError
        Files that exist already, or a folder that is being written by another process or cannot be written to.
    """
    folder = Path(folder)
    with result_folder(folder) as run:
        check_free(folder, replace=replace)
        older = figure_names([FIGURE]) if (folder / NAME).exists() else []
        with replace_result(folder, KIND, run=run, older=older) as staged:
            write_json(staged / NAME, time_study_content(study))
    return [folder / NAME]


def check_free(folder: str | Path, names: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a study, or another file of the names, is in the folder and is not to be replaced.

    Parameters
    ----------
    folder : path
    names : collection of str
    replace : bool
    """
    check_not_taken(Path(folder), NAME, "a study", names, replace=replace)


def time_study_content(study: TimeStudy) -> dict[str, Any]:
    """Content of ``study.json``.

    Parameters
    ----------
    study : TimeStudy
    """
    return {
        "schema": SCHEMA,
        "robot": {"name": study.robot, "sha256": study.sha256},
        "below": study.below,
        "courses": [_course(course, study.below) for course in study.courses],
    }


def _course(course: TimeCourse, below: float) -> dict[str, Any]:
    scatter = course.scatter
    return {
        "name": course.name,
        "names": list(course.names),
        "units": list(course.units),
        "time": course.time.tolist(),
        "condition_number": _plain(course.condition_number),
        "time_below": _plain(course.time_below(below)),
        "reference": {"kind": course.reference_kind, "values": _plain(course.reference)},
        "values": _plain(course.values),
        "deviation": _plain(course.deviation),
        "half_width_99": _plain(course.half_width),
        "repetitions": 0 if course.repeated is None else len(course.repeated),
        "scatter": None if scatter is None else _plain(scatter),
        "mean_of_repetitions": None if course.repeated is None else _plain(course.repeated.mean(axis=0)),
        "notes": list(course.notes),
    }


def _plain(values: Array) -> list[Any]:
    """Nested lists; what is not finite becomes null."""
    whole = values.astype(object)
    whole[~np.isfinite(values)] = None
    listed: list[Any] = whole.tolist()
    return listed
