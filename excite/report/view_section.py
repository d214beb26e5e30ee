"""Sections of a page that are rendered from views."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from excite.friction.fit.friction_fit import FrictionFit
from excite.report.drawings import drawn, no_pictures, pictures
from excite.report.player_log import Appearance, LoggedMotion, played
from excite.report.sections import (
    ReportCell,
    ReportFigure,
    ReportSection,
    ReportTable,
    facts,
    kept,
    number,
    percent,
    unit,
)
from excite.study.time_study import TimeStudy
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from excite.verification.verification import Verification
from excite.views.friction_fit_view import friction_fit_view
from excite.views.study_view import study_view
from excite.views.verification_view import TITLES, verification_view
from excite.views.view import Column, Format, View, ViewTable

_CELLS: dict[Format, Callable[[Any], ReportCell]] = {
    Format.TEXT: lambda value: ReportCell(str(value)),
    Format.UNIT: unit,
    Format.NUMBER: number,
    Format.PERCENT: percent,
    Format.KEPT: kept,
}


def section_of(
    view: View, kind: str, figures: tuple[ReportFigure, ...], missing: tuple[str, ...] = ()
) -> ReportSection:
    """The section of a view."""
    return ReportSection(
        kind=kind,
        title=view.title,
        verdict=view.verdict,
        holds=view.holds,
        asked=view.asked,
        assumed=view.remarks,
        notes=(*view.against, *missing),
        tables=tuple(map(_page_table, view.tables)),
        figures=figures,
        facts=facts({}, **view.facts),
    )


def _page_table(table: ViewTable) -> ReportTable:
    """The table with all of its columns that say something."""
    shown = [k for k in range(len(table.columns)) if any(row[k] is not None for row in table.rows)]
    columns = tuple(table.columns[k] for k in shown)
    rows = tuple(
        tuple(_cell(column, row[k], marked=(j, k) in table.marked) for k, column in zip(shown, columns, strict=True))
        for j, row in enumerate(table.rows)
    )
    headings = tuple(column.heading for column in columns)
    return ReportTable(table.title, headings, rows, table.note, table.name, folded=table.folded)


def _cell(column: Column, value: Any, *, marked: bool) -> ReportCell:
    cell = _CELLS[column.format](value)
    cell = replace(cell, state="bad") if marked else cell
    numbers = column.format in (Format.NUMBER, Format.PERCENT)
    return ReportCell(column.missing) if numbers and cell.value is None and column.missing else cell


def friction_fit_section(fit: FrictionFit, prefix: str, path: Path | None = None) -> ReportSection:
    """Everything that a page says of a fit of friction curves."""
    view = friction_fit_view(fit)
    section = section_of(view, "friction", *drawn(view.figures, prefix))
    folder = "friction/this" if path is None else str(path.parent)
    logs = [log.file for log in fit.logs]
    again = ["excite", "friction", "fit", fit.robot, *logs, "--out", f"{folder}-again"]
    use = ["excite", "identify", fit.robot, "LOG.csv", "--friction-curves", f"{folder}/friction.yaml"]
    return replace(
        section,
        title=section.title if path is None else folder,
        facts=facts(fit.provenance, **view.facts),
        commands=(shlex.join(again), shlex.join([*use, "--out", "results/this"])),
    )


def time_study_section(study: TimeStudy, prefix: str, path: Path | None = None) -> ReportSection:
    """Everything that a page says of a study."""
    view = study_view(study)
    section = section_of(view, "study", *drawn(view.figures, prefix))
    title = section.title if path is None else str(path.parent)
    return replace(section, title=title, verdict=" ".join(view.summary), holds=None, commands=(_command(study),))


def _command(study: TimeStudy) -> str:
    words = [word for course in study.courses for word in _source(course.name)]
    below = f"{100 * study.below:g}"
    return shlex.join(["excite", "study", study.robot, *words, "--below", below, "--out", "studies/again"])


def _source(name: str) -> list[str]:
    """Logs stand alone, designs behind their option."""
    return [name] if Path(name).suffix else ["--design", name]


def verification_section(
    verification: Verification, prefix: str, looks: Appearance, path: Path | None = None
) -> ReportSection:
    """Everything that a page says of a verification."""
    v, view = verification, verification_view(verification)
    if len(v.time) and v.robot is not None:
        figures, missing = drawn(view.figures, prefix)
        motion, unseen = played(_logged(v), v.robot, Task(StoredRobot(v.robot.name, v.robot)), looks)
        part = (f"figures of the logs show every {v.step}th instant; the tables are of all of them",) * (v.step > 1)
        section = replace(section_of(view, "verification", figures, (*part, *unseen, *missing)), motion=motion)
    elif path is None:
        section = section_of(view, "verification", ())
    else:
        titles = {f"{path.stem}_{ending}.png": title for ending, title in TITLES.items()}
        gone = (
            "figures are the pictures in the folder, and the motion does not play: the file of curves, or the result "
            "that was verified, is not there",
            *no_pictures(path.parent, path.stem, titles),
        )
        section = section_of(view, "verification", pictures(path.parent, path.stem, titles), gone)
    if path is None:
        return section
    return replace(section, title=str(path), commands=(shlex.join(["excite", "verify", str(path.parent), v.log.file]),))


def _logged(v: Verification) -> LoggedMotion:
    """The measured motion, and the rows of each equation."""
    first = np.zeros(len(v.time), dtype=int)
    rows = tuple((first, v.time, v.measured[:, j], v.predicted[:, j]) for j in range(len(v.equations)))
    motion = v.motion
    return LoggedMotion(
        motion.joints, (v.log.file,), motion.time, np.zeros(len(motion.time), dtype=int), motion.q, v.equations, rows
    )
