"""The section of a study over time."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

from excite.report.drawings import drawn
from excite.report.sections import ReportSection
from excite.report.view_section import section_of
from excite.timecourse.time_study import TimeStudy
from excite.views.study_view import study_view


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
