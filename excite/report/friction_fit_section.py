"""The section of a fit of friction curves."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

from excite.friction.fit.friction_fit import FrictionFit
from excite.report.drawings import drawn
from excite.report.provenance_facts import facts
from excite.report.sections import ReportSection
from excite.report.view_section import section_of
from excite.views.friction_fit_view import friction_fit_view


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
