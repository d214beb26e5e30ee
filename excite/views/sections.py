"""The sections of a page: the view of each subject, with its figures, its motion, and the commands that repeat it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.campaign import Campaign
from excite.design.comparison import compare
from excite.design.design import Design
from excite.design.friction_runs.friction_plan import FrictionPlan
from excite.design.task_file import task_content
from excite.friction.friction_fit import FrictionFit
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.identification.result_json import CURVES, KIND
from excite.study.time_study import TimeStudy
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from excite.verification.verification import Verification
from excite.views.campaign_view import campaign_view
from excite.views.comparison_view import comparison_view
from excite.views.design_view import design_view
from excite.views.experiment_views import study_view
from excite.views.friction_views import friction_fit_view, friction_plan_view
from excite.views.identification_view import TITLES, identification_view
from excite.views.page_text import PageSection, drawn, pictures
from excite.views.player_data import player_motion
from excite.views.player_log import Appearance, LoggedMotion, looked_at, motion_of_plan, played, source_of
from excite.views.subjects import Filed, Subject
from excite.views.verification_view import verification_view
from excite.views.view import View, view_of
from regressors.errors import ExciteError

_LOOKED_AT = (
    "limits of joints and drives are looked at in the samples of the files; jerks, torques, distances and passages "
    "between poses are as plan.json states them"
)


def section_of(subject: Subject, prefix: str, looks: Appearance, of_page: Sequence[Subject] = ()) -> PageSection:
    """Everything that a page says of a subject; identifiers of its figures begin with the prefix."""
    record, path = (subject.record, subject.path) if isinstance(subject, Filed) else (subject, None)
    if isinstance(record, Campaign):
        return _of_campaign(record, [each for each in of_page if isinstance(each, Design)])
    builders: dict[type, Callable[[Any, str, Appearance, Path | None], PageSection]] = {
        Design: _of_design,
        Identification: _of_identification,
        Verification: _of_verification,
        FrictionPlan: _of_plan,
        FrictionFit: _of_fit,
        TimeStudy: _of_study,
    }
    build = next((build for kind, build in builders.items() if isinstance(record, kind)), None)
    # others have neither a motion nor commands that repeat them
    return _drawn(view_of(record), prefix) if build is None else build(record, prefix, looks, path)


def _drawn(view: View, prefix: str, *commands: Sequence[str], missing: tuple[str, ...] = ()) -> PageSection:
    """The section of a view whose figures are drawn."""
    figures, left_out = drawn(view.figures, prefix)
    return PageSection(view, figures, (*missing, *left_out), commands=tuple(map(shlex.join, commands)))


def _of_design(design: Design, prefix: str, looks: Appearance, path: Path | None) -> PageSection:
    missing = _missing(design)
    view, task = design_view(design, whole=not missing), task_content(design.task)
    view = replace(view, holds=design.feasible, remarks=(*design.believed, *view.remarks))
    folder = "designs/again" if design.folder is None else f"{design.folder}-again"
    again = ["excite", "design", str(task["robot"]), "--task", "task.yaml", "--out", folder]
    compared = ["excite", "compare", str(design.folder or "designs/this"), folder]
    motion = None if missing else player_motion(design, looks.file_of(design.robot, design.task))
    return replace(_drawn(view, prefix, again, compared, missing=missing), task=_task_file(task), motion=motion)


def _missing(design: Design) -> tuple[str, ...]:
    """Why the limits of a design cannot be had as functions, where it names parts that are not given."""
    try:
        _ = design.target, design.nonlinear, design.starts
    except ExciteError as error:
        return (f"figures and the 3D player are left out: {error}",)
    return ()


def _task_file(task: Mapping[str, Any]) -> str:
    """The same task as the text of a task file, an option per line; JSON is YAML."""
    limits = {name: value for name, value in (task.get("limits") or {}).items() if value is not None}
    options = {name: value for name, value in task.items() if value is not None and name != "limits"}
    options |= {"limits": limits} if limits else {}
    lines = (f"{json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in options.items())
    return "{\n  " + ",\n  ".join(lines) + "\n}\n"


def comparison_section(designs: Sequence[Design]) -> PageSection:
    """Several designs under the metrics of the first one, see `excite.design.comparison.compare`."""
    judged = compare(designs)
    again = shlex.join(["excite", "compare", *(j.name for j in judged)])
    return PageSection(comparison_view(judged), commands=(again,))


def _of_identification(result: Identification, prefix: str, looks: Appearance, path: Path | None) -> PageSection:
    known = result.curves.time.size > 0
    gone = f"figures of the logs and the motion are left out: {result.folder} holds no {CURVES}"
    missing = _thinned(result.curves.step) if known else (gone,)
    section = _drawn(identification_view(result), prefix, *commands_of(result), missing=missing)
    if result.folder is not None:
        repeated = pictures(result.folder, KIND, {"repetitions.png": TITLES["repetitions"]})
        section = replace(section, figures=(*section.figures, *repeated))
    if not known:
        return section
    motion, unseen = played(_logged(result), result.robot, result.task, looks)
    return replace(section, motion=motion, missing=(*section.missing, *unseen))


def _logged(result: Identification) -> LoggedMotion:
    """The measured motion, and the rows of each equation, as a file would have them."""
    c = result.curves.stored()
    of_equation = (c.equation == j for j in range(len(result.equations)))
    rows = tuple((c.log[own], c.time[own], c.measured[own], c.predicted[own]) for own in of_equation)
    return LoggedMotion(c.joints, result.log_names, c.motion_time, c.motion_log, c.motion_q, result.equations, rows)


def _thinned(step: int) -> tuple[str, ...]:
    return (f"figures of the logs show every {step}th instant; the tables are of all of them",) * (step > 1)


_VALUES = (
    "rows", "signals", "cutoff", "period", "harmonics", "low_pass", "every", "standstill", "estimator", "covariance",
    "described_within", "delay", "temperature",
)  # fmt: skip
_FLAGS = {"average": "--average", "measured_velocity": "--measured-velocity", "friction_scale": "--scale-friction"}


def commands_of(result: Identification) -> tuple[list[str], list[str]]:
    """Words of the commands that identify from the same logs, and verify."""
    task, provenance, folder = task_content(result.task), result.provenance, str(result.folder or "results/this")
    design = None if result.design is None else result.design.folder
    words = ["excite", "identify", str(task["robot"]), *result.log_names]
    words += ["--design", str(design)] if design else _model(task)
    words += ["--mapping", str(provenance["mapping"])] if provenance.get("mapping") else []
    words += [word for name in provenance.get("drop") or () for word in ("--drop", str(name))]
    again = [*words, *_recipe_options(result.recipe.to_dict()), "--choose", "none", "--out", f"{folder}-again"]
    return again, ["excite", "verify", folder, "OTHER.csv"]


def _model(task: Mapping[str, Any]) -> list[str]:
    """Options of the model, where no design gives them."""
    tips = task.get("tip") or ()
    ends = [("--tip", tip) for tip in ([tips] if isinstance(tips, str) else tips)]
    given = [("--base-link", task.get("base_link")), *ends, ("--model", task.get("model"))]
    words = [word for flag, value in given if value for word in (flag, str(value))]
    words += ["--joints", ",".join(map(str, task["joints"]))] if task.get("joints") else []
    return [*words, *("--no-" + name for name in ("friction", "rotor") if task.get(name) is False)]


def _recipe_options(recipe: Mapping[str, Any]) -> list[str]:
    """Settings that are not the defaults, with all digits."""
    default = Recipe().to_dict()
    values = {name: recipe.get(name) for name in _VALUES if recipe.get(name) != default.get(name)}
    slope = "breakaway" if recipe.get("breakaway") else "sign_width"  # one of them decides where friction turns
    values[slope] = recipe.get(slope)
    known = {f"--{name.replace('_', '-')}": value for name, value in values.items() if value is not None}
    words = [word for flag, value in known.items() for word in (flag, _text(value))]
    return [*words, *(flag for name, flag in _FLAGS.items() if recipe.get(name))]


def _text(value: Any) -> str:
    return ",".join(map(_text, value)) if isinstance(value, list | tuple) else str(value)


_GONE = "figures and the motion are left out: the file of curves, or the result that was verified, is not in the folder"


def _of_verification(v: Verification, prefix: str, looks: Appearance, path: Path | None) -> PageSection:
    view = verification_view(v)
    if len(v.time) and v.robot is not None:
        section = _drawn(view, prefix, missing=_thinned(v.step))
        rows = tuple((_first(v.time), v.time, v.measured[:, j], v.predicted[:, j]) for j in range(len(v.equations)))
        at = v.motion.time
        logged = LoggedMotion(v.motion.joints, (v.log.file,), at, _first(at), v.motion.q, v.equations, rows)
        motion, unseen = played(logged, v.robot, Task(StoredRobot(v.robot.name, v.robot)), looks)
        section = replace(section, motion=motion, missing=(*section.missing, *unseen))
    else:
        section = PageSection(view, missing=(_GONE,) * (path is not None))
    if path is None:
        return section
    again = shlex.join(["excite", "verify", str(path.parent), v.log.file])
    return replace(section, view=replace(view, title=str(path)), commands=(again,))


def _first(time: Any) -> Any:
    """All instants are of the first log."""
    return np.zeros(len(time), dtype=int)


def _of_plan(plan: FrictionPlan, prefix: str, looks: Appearance, path: Path | None) -> PageSection:
    runs = [(c, source_of(plan, c, path)) for c in plan.coordinates]
    if path is not None:
        plan = replace(plan, coordinates=tuple(looked_at(plan, c, source) for c, source in runs))
    view, robot, folder = friction_plan_view(plan), plan.robot.name, str(path.parent) if path else "friction/this"
    if path is not None:
        view = replace(view, title=folder, remarks=(_LOOKED_AT, *view.remarks))
    drives = ",".join(c.label for c in plan.coordinates)
    again = ["excite", "friction", "plan", robot, "--drives", drives, "--out", f"{folder}-again"]
    fit = ["excite", "friction", "fit", robot, "LOG.csv", "--plan", folder, "--out", "friction/this"]
    return replace(_drawn(view, prefix, again, fit), motion=motion_of_plan(plan, runs, looks))


def _of_fit(fit: FrictionFit, prefix: str, looks: Appearance, path: Path | None) -> PageSection:
    view, folder = friction_fit_view(fit), str(path.parent) if path else "friction/this"
    again = ["excite", "friction", "fit", fit.robot, *(log.file for log in fit.logs), "--out", f"{folder}-again"]
    use = ["excite", "identify", fit.robot, "LOG.csv", "--friction-curves", f"{folder}/friction.yaml"]
    return _drawn(replace(view, title=folder if path else view.title), prefix, again, [*use, "--out", "results/this"])


def _of_study(study: TimeStudy, prefix: str, looks: Appearance, path: Path | None) -> PageSection:
    view = study_view(study)
    # logs stand alone, designs behind their option
    words = [word for c in study.courses for word in ([c.name] if Path(c.name).suffix else ["--design", c.name])]
    again = ["excite", "study", study.robot, *words, "--below", f"{100 * study.below:g}", "--out", "studies/again"]
    return _drawn(replace(view, title=str(path.parent) if path else view.title), prefix, again)


def _of_campaign(campaign: Campaign, designs: Sequence[Design]) -> PageSection:
    """A campaign; designs of the page that move drives of its motions are listed."""
    words = ["excite", "design", campaign.robot, "--model", campaign.model, "--drives"]
    drives = enumerate((",".join(step.drives) for step in campaign.steps), 1)
    commands = (shlex.join([*words, each, "--out", f"designs/motion-{k}"]) for k, each in drives)
    return PageSection(campaign_view(campaign, designs), commands=tuple(commands))
