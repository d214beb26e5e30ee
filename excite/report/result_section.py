"""The section of a page on an identification."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from excite.files.result_json import CURVES, KIND
from excite.files.task_file import task_content
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.report.drawings import drawn, no_pictures, pictures
from excite.report.player_log import Appearance, LoggedMotion, played
from excite.report.sections import ReportFigure, ReportSection, asked, facts, text_of
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


_VALUES = (
    "rows", "signals", "cutoff", "period", "harmonics", "low_pass", "every", "standstill", "estimator", "covariance",
    "pull", "described_within", "delay", "temperature",
)  # fmt: skip
_FLAGS = {"average": "--average", "measured_velocity": "--measured-velocity", "friction_scale": "--scale-friction"}


def commands_of(result: Identification, folder: str) -> tuple[str, ...]:
    """Commands that identify from the same logs, and verify."""
    task, provenance = task_content(result.task), result.provenance
    design = None if result.design is None else result.design.folder
    words = ["excite", "identify", str(task["robot"]), *result.log_names]
    words += ["--design", str(design)] if design else _model(task)
    words += ["--mapping", str(provenance["mapping"])] if provenance.get("mapping") else []
    words += [word for name in provenance.get("drop") or () for word in ("--drop", str(name))]
    again = [*words, *_recipe_options(result.recipe.to_dict()), "--choose", "none", "--out", f"{folder}-again"]
    return shlex.join(again), shlex.join(["excite", "verify", folder, "OTHER.csv"])


def _model(task: Mapping[str, Any]) -> list[str]:
    """Options of the model, where no design gives them."""
    chain = [(f"--{name.replace('_', '-')}", task.get(name)) for name in ("base_link", "tip", "model")]
    words = [word for flag, value in chain if value is not None for word in (flag, str(value))]
    words += ["--joints", ",".join(map(str, task["joints"]))] if task.get("joints") else []
    return [*words, *("--no-" + name for name in ("friction", "rotor") if task.get(name) is False)]


def _recipe_options(recipe: Mapping[str, Any]) -> list[str]:
    """Settings that are not the defaults, with all digits."""
    default = Recipe().to_dict()
    values = {name: recipe.get(name) for name in _VALUES if recipe.get(name) != default.get(name)}
    slope = "breakaway" if recipe.get("breakaway") else "sign_width"  # one of them decides where friction turns
    values[slope] = recipe.get(slope)
    words = [
        word
        for name, value in values.items()
        if value is not None
        for word in (f"--{name.replace('_', '-')}", _text(value))
    ]
    return [*words, *(flag for name, flag in _FLAGS.items() if recipe.get(name))]


def _text(value: Any) -> str:
    return ",".join(map(_text, value)) if isinstance(value, list | tuple) else str(value)
