"""The section of a study over time: how soon motions determine the parameters."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from excite.files.stored import complete, stored_content
from excite.files.time_study_json import KIND, NAME, SCHEMA
from excite.report.drawings import drawn
from excite.report.provenance_facts import facts
from excite.report.sections import ReportCell, ReportSection, ReportTable, number, percent, unit
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from excite.timecourse.time_course import TimeCourse
from excite.timecourse.time_study import TimeStudy
from regressors.samples import Array


@dataclass(frozen=True)
class StoredTimeStudy:
    """A study read from its file.

    Parameters
    ----------
    path : Path
    study : TimeStudy
        Without the single repetitions, which the file does not have.
    scatters : tuple of ndarray or None
        Standard deviation of the repetitions of each motion at its end, shape (p,).
    """

    path: Path
    study: TimeStudy
    scatters: tuple[Array | None, ...]


def load_time_study(path: Path) -> StoredTimeStudy:
    """Load a ``study.json``.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        Another schema, entries that are missing, or a file that is not the one that was written.
    """
    return read_settled(Destination(path.parent), lambda: _loaded(path))


def _loaded(path: Path) -> StoredTimeStudy:
    content = stored_content(path, SCHEMA)
    with complete(path, "study"):
        courses = tuple(_course(each) for each in content["courses"])
        robot = content["robot"]
        study = TimeStudy(str(robot["name"]), str(robot["sha256"]), courses, float(content["below"]))
        scatters = tuple(_last(each["scatter"]) for each in content["courses"])
        if not courses:
            raise ValueError("no motion")
    if path.name == NAME:
        check_files(path.parent, KIND, (NAME,))
    return StoredTimeStudy(path, study, scatters)


def _course(content: Mapping[str, Any]) -> TimeCourse:
    values, deviation, half = (_array(content[name]) for name in ("values", "deviation", "half_width_99"))
    time, count = _array(content["time"]), len(content["names"])
    if (
        values.shape != (time.size, count)
        or deviation.shape != values.shape
        or half.shape != values.shape
        or not time.size
    ):
        raise ValueError(f"expected {time.size} instants of {count} parameters")
    ratio = half[deviation > 0] / deviation[deviation > 0]
    return TimeCourse(
        name=str(content["name"]),
        names=tuple(map(str, content["names"])),
        units=tuple(map(str, content["units"])),
        time=time,
        values=values,
        deviation=np.where(np.isnan(deviation), np.inf, deviation),
        quantile=float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else np.nan,
        condition_number=np.nan_to_num(_array(content["condition_number"]), nan=np.inf),
        reference=_array(content["reference"]["values"]),
        reference_kind=str(content["reference"]["kind"]),
        notes=tuple(map(str, content["notes"])),
    )


def _array(values: Any) -> Array:
    return np.array(values, dtype=float)


def _last(scatter: Any) -> Array | None:
    return None if scatter is None else _array(scatter)[-1]


def time_study_section(given: StoredTimeStudy | TimeStudy, prefix: str) -> ReportSection:
    """Everything that a page says of a study.

    Parameters
    ----------
    given : StoredTimeStudy or TimeStudy
    prefix : str
        Begins the identifiers of its figures.
    """
    stored = isinstance(given, StoredTimeStudy)
    study = given.study if isinstance(given, StoredTimeStudy) else given
    lasts = [None if c.scatter is None else c.scatter[-1] for c in study.courses]
    scatters = list(given.scatters) if isinstance(given, StoredTimeStudy) else lasts

    def figure() -> Any:
        from excite.plots.time_course_plot import estimates_over_time_figure

        return estimates_over_time_figure(study)

    figures, missing = drawn({"Estimates over time": figure}, prefix)
    repeated = stored and any(each is not None for each in scatters)
    thin = ("the single repetitions are not in the file; their scatter is in the table",) if repeated else ()
    return ReportSection(
        kind="study",
        title=str(given.path.parent) if isinstance(given, StoredTimeStudy) else f"study of {study.robot}",
        verdict=" ".join(_verdict(course, study.below) for course in study.courses),
        asked=(
            ("robot", study.robot), ("motions", ", ".join(course.name for course in study.courses)),
            ("deviation to fall below", f"{100 * study.below:g} %"),
        ),
        assumed=tuple(f"{course.name}: {note}" for course in study.courses for note in course.notes),
        notes=(*thin, *missing),
        tables=(_sizes(study), *(_table(c, study.below, s) for c, s in zip(study.courses, scatters, strict=True))),
        figures=figures,
        facts=facts({}, robot=study.robot, robot_sha256=study.sha256),
        commands=(_command(study),),
    )  # fmt: skip


def _verdict(course: TimeCourse, below: float) -> str:
    times = course.time_below(below)
    known, count = int(np.isfinite(times).sum()), times.size
    all_of = "all" if known == count else f"{known} of"
    begin = f"{course.name} determines {all_of} {count} parameters within {100 * below:g} %"
    after = f" after {float(np.nanmax(times)):.3g} s" if known else ""
    return f"{begin}{after}, of {float(course.time[-1]):.3g} s."


def _sizes(study: TimeStudy) -> ReportTable:
    rows = tuple(
        (
            ReportCell(course.name), number(float(course.time[-1])), number(float(course.condition_number[-1])),
            number(float(np.isfinite(course.time_below(study.below)).sum())), number(float(len(course.names))),
        )
        for course in study.courses
    )  # fmt: skip
    within = f"within {100 * study.below:g} %"
    return ReportTable("Motions", ("motion", "duration [s]", "cond(W)", within, "parameters"), rows, name="courses")


def _table(course: TimeCourse, below: float, scatter: Array | None) -> ReportTable:
    times, true = course.time_below(below), course.reference_kind == "truth"
    rows = tuple(
        (
            ReportCell(name), number(float(course.values[-1, k])), number(float(course.half_width[-1, k])),
            unit(course.units[k]), percent(float(course.relative_deviation[-1, k])), number(float(times[k])),
            number(float(course.reference[k])),
            *(() if scatter is None else (number(float(scatter[k])), number(float(course.deviation[-1, k])))),
        )
        for k, name in enumerate(course.names)
    )  # fmt: skip
    columns = (
        "parameter",
        "final value",
        "half of its interval",
        "unit",
        "relative deviation",
        f"within {100 * below:g} % from [s]",
    )
    known = "true value" if true else "description"
    repeated = () if scatter is None else ("scatter of repetitions", "deviation as stated")
    note = "A dash: never, or not known."
    return ReportTable(f"Parameters by {course.name}", (*columns, known, *repeated), rows, note, "course")


def _command(study: TimeStudy) -> str:
    words = [word for course in study.courses for word in _source(course.name)]
    below = f"{100 * study.below:g}"
    return shlex.join(["excite", "study", study.robot, *words, "--below", below, "--out", "studies/again"])


def _source(name: str) -> list[str]:
    """Logs stand alone, designs behind their option."""
    return [name] if Path(name).suffix else ["--design", name]
