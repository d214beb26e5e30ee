"""The section of an identification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from excite.files.result_json import CURVES, KIND
from excite.files.task_file import task_content
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.report.drawings import drawn, no_pictures, pictures
from excite.report.identify_commands import commands_of
from excite.report.player_log import Appearance, LoggedMotion, played
from excite.report.provenance_facts import facts
from excite.report.sections import ReportFigure, ReportSection, text_of
from excite.report.task_text import asked
from excite.report.view_section import section_of
from excite.views.identification_view import TITLES, identification_view


def result_section(result: Identification, prefix: str, looks: Appearance) -> ReportSection:
    """Everything that a page says of an identification."""
    view = identification_view(result)
    figures, missing = drawn(view.figures, prefix)
    motion, unseen = _player(result, looks) if result.curves.time.size else (None, ())
    from_folder, notes = _pictures(result)
    return replace(
        section_of(view, "identification", (*figures, *from_folder), (*notes, *unseen, *missing)),
        verdict=" ".join(f"{sentence}." for sentence in (view.verdict, *view.summary)),
        motion=motion,
        asked=(*asked(task_content(result.task), ("robot", "model")), *_recipe(result.recipe)),
        facts=facts(result.provenance, robot=result.robot.name, **_hashes(result)),
        commands=commands_of(result, str(result.folder or "results/this")),
    )


def _player(result: Identification, looks: Appearance) -> tuple[Mapping[str, Any] | None, tuple[str, ...]]:
    """The motion in the player, with its torques; a note where it cannot be had."""
    return played(_logged(result), result.robot, result.task, looks)


def _logged(result: Identification) -> LoggedMotion:
    """The measured motion, and the rows of each equation, as a file would have them."""
    c = result.curves.stored()
    of_equation = (c.equation == j for j in range(len(result.equations)))
    rows = tuple((c.log[own], c.time[own], c.measured[own], c.predicted[own]) for own in of_equation)
    return LoggedMotion(c.joints, result.log_names, c.motion_time, c.motion_log, c.motion_q, result.equations, rows)


def _pictures(result: Identification) -> tuple[tuple[ReportFigure, ...], tuple[str, ...]]:
    """Figures that the folder has in place of those that cannot be drawn, and what is said about them."""
    if result.folder is None:
        return (), ()
    if result.curves.time.size:
        step = result.curves.step
        part = (f"figures of the logs show every {step}th instant; the tables are of all of them",) * (step > 1)
        return pictures(result.folder, KIND, {"repetitions.png": TITLES["repetitions"]}), part
    titles = {f"{name}.png": title for name, title in TITLES.items() if name != "parameters"}
    gone = (
        f"figures of the logs are the pictures in the folder, and the motion does not play: there is no {CURVES}, "
        "which is written since this version"
    )
    return pictures(result.folder, KIND, titles), (gone, *no_pictures(result.folder, KIND, titles))


def _recipe(recipe: Recipe) -> tuple[tuple[str, str], ...]:
    default = Recipe().to_dict()
    return tuple(
        (name.replace("_", " "), text_of(value))
        for name, value in recipe.to_dict().items()
        if value is not None and value != default.get(name)
    )


def _hashes(result: Identification) -> dict[str, Any]:
    logs = {f"log {log.file} sha256": log.sha256 for log in result.facts.logs}
    design = None if result.design is None else result.design.file
    return {"robot_sha256": result.robot.sha256(), "design": design, **logs}
