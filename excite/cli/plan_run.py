"""Execution of ``excite plan``: a campaign of partial motions, or what is known, what is missing, the next motion."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import excite
from excite.cli.main import NOT_HELD
from excite.cli.messages import in_options
from excite.cli.options import robot_file_of
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark
from excite.cli.task_options import chosen_of
from excite.cli.view_text import brief_table, show_view
from excite.design.design_folder import check_no_design, data_files
from excite.design.start_results import StartResult
from excite.design.task_file import read_task_file, task_from_options
from excite.storage.records import json_of
from excite.tasks.model_choice import FURTHER_FRICTION
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.task import PARTS
from excite.views.campaign_view import campaign_view
from excite.views.view import Column, Format, View, ViewTable, some_of

_NAMED = 6  # parameters of a motion that the summary names


def plan_campaign(robot: str, given: Mapping[str, Any]) -> None:
    """Propose the motions that identify every parameter."""
    curves = given["friction_curves"]
    asked = {**chosen_of(PARTS["installation"], given), **chosen_of(PARTS["model"], given)}
    asked["friction_curves"] = None if curves is None else excite.read_friction(Path(curves))
    task = excite.Task(robot, **robot_file_of(given), **asked)
    tell("finding the parameters that each selection of drives identifies")
    campaign = excite.plan_campaign(task, given["at_once"])
    view = campaign_view(campaign)
    rows = tuple((*row[:-1], some_of(row[-1].split(", "), _NAMED)) for row in view.tables[0].rows)
    drives = ",".join(campaign.steps[0].drives)
    step = f"{_design_command(task, curves)} --drives {drives} --out designs/motion-1"
    show_view(
        view,
        content=lambda: json_of(campaign),
        facts=[*view.summary, *brief_table(replace(view.tables[0], rows=rows))],
        notes=(),
        next_steps=[step],
        more=[f"next: {step}"],
    )


def _design_command(task: excite.Task, curves: str | None) -> str:
    """Command that designs for the same robot, chain and parameters."""
    model = task.model
    words = ["excite", "design", task.robot_name, "--model", str(model.model)]
    for flag, value in (
        ("--base", task.base_link),
        ("--tip", task.tip),
        ("--no-snap-angles", not task.snap_angles),
        ("--xacro", task.xacro),
        ("--no-friction", not model.friction),
        ("--friction-curves", curves),
        ("--offset", bool(model.offset)),  # a plain flag, since it always was one
        *((f"--{name.replace('_', '-')}", _drives(getattr(model, name))) for name in FURTHER_FRICTION[1:]),
        ("--no-rotor", not model.rotor),
        ("--stribeck-speed", f"{model.stribeck_speed:g}" if model.stribeck else None),
    ):
        words += [flag] if value else []
        words += [value] if isinstance(value, str) else []
    return shlex.join(words)


def _drives(chosen: bool | tuple[str, ...]) -> str | None:
    """Drives as they are typed, such as ``1,3``."""
    return ("all" if chosen else None) if isinstance(chosen, bool) else ",".join(chosen)


def next_motion_task(robot: str, typed: Mapping[str, Any], task_file: Path | None) -> excite.Task:
    """The task of a file and of options, which win over it."""
    filed = read_task_file(task_file) if task_file else {}
    at_period = {"scale": "precision"} if "period" in typed else {}  # not at the shortest
    return task_from_options({"model": "differential", **filed, **typed, **at_period, "robot": robot})


def plan_next_motion(task: excite.Task, of: str, out: Path | None, *, force: bool) -> int:
    """Show whether what is in hand is enough; write the next motion where it is not, and a folder is given."""
    if out is not None:
        check_no_design(out, data_files(task), replace=force)
    tell("weighing what is in hand")
    best = math.inf

    def progress(start: StartResult) -> None:
        nonlocal best
        if start.value < best:
            best = start.value
            remark(f"excite: start {start.index} ended, best so far {best:.4g}")

    step = excite.next_motion(task, of=of, progress=progress, report=lambda text: remark(f"excite: {text}"))
    files = step.design.save(out, replace=force) if step.design is not None and out is not None else []
    view = _next_motion_view(step)
    (table,), missing = view.tables, {parameter.name for parameter in step.missing}
    rows = tuple(row for row in table.rows if not missing or row[0] in missing)
    columns = (replace(table.columns[0], heading="missing" if missing else "known"), *table.columns[1:])
    show_view(
        view,
        files,
        content=lambda: _content(step, out),
        facts=[*view.summary, *brief_table(replace(table, columns=columns, rows=rows))],
        notes=[*view.remarks, *(in_options(note) for note in (() if step.design is None else step.design.notes))],
        next_steps=[_next(step, out)],
    )
    return 0 if step.enough else NOT_HELD


def _next_motion_view(step: excite.NextMotion) -> View:
    """View of what is in hand, and of what the next motion would bring."""
    count = sum(math.isfinite(parameter.allowed) for parameter in step.parameters)
    planned = f", once {', '.join(step.planned)} is played" if step.planned else ""
    columns = (
        Column("parameter", Format.TEXT, brief=True),
        Column("value", brief=True, digits=4),
        *(Column(name, brief=True) for name in ("half-width", "allowed", "then")),
        Column("unit", Format.TEXT, brief=True),
    )
    title = "Half-widths of the intervals, in hand and after the next motion"
    rows = tuple((p.name, p.value, p.half_width, p.allowed, p.expected, p.unit) for p in step.parameters)
    return View(
        title=f"what is known of {step.robot}",
        verdict=f"Enough: stop. All {count} parameters of {step.robot} are known as precisely as asked for{planned}"
        if step.enough
        else f"{len(step.missing)} of {count} parameters of {step.robot} are not known as precisely as asked for",
        holds=step.enough,
        summary=_runs(step),
        remarks=_not_asked(step),
        tables=(ViewTable("in-hand", title, columns, rows),),
    )


def _not_asked(step: excite.NextMotion) -> tuple[str, ...]:
    """Parameters that a share of every one leaves out, since nothing is known of their size."""
    names = [parameter.name for parameter in step.parameters if not math.isfinite(parameter.allowed)]
    asked = step.task.objective.precision
    if not names or not isinstance(asked, PrecisionTarget) or asked.share is None:
        return ()
    return (
        f"nothing is asked of {some_of(names)}: their size is not described, and what was measured of them may be "
        "zero; a YAML file for --precision can state it, under scales",
    )


def _runs(step: excite.NextMotion) -> tuple[str, ...]:
    forecast = step.forecast
    if forecast is None or step.design is None:
        return ()
    runs = f"{forecast.runs} run{'s' * (forecast.runs > 1)}"
    expected = "expected to be enough" if forecast.met else "which are not enough yet"
    return (f"next motion: {step.design.trajectory.duration:g} s, {runs}, {forecast.robot_seconds:g} s; {expected}",)


def _next(step: excite.NextMotion, out: Path | None) -> str:
    if step.enough:
        return "play the planned motions" if step.planned else "nothing more to play; verify on a log that was not used"
    if out is None:
        return "the same command with --out DIR writes the motion"
    runs = "once" if step.runs == 1 else f"{step.runs} times"
    return f"play {out / 'trajectory.csv'} {runs}, identify from its logs, and plan again with that result in --after"


def _content(step: excite.NextMotion, out: Path | None) -> dict[str, Any]:
    forecast = step.forecast
    return {
        "robot": step.robot,
        "enough": step.enough,
        "planned": list(step.planned),
        "parameters": [
            {name: _finite(value) for name, value in vars(parameter).items()} | {"enough": parameter.enough}
            for parameter in step.parameters
        ],
        "next": None
        if step.design is None or forecast is None
        else {
            "out": None if out is None else str(out),
            "period": step.design.trajectory.duration,
            **{name: value for name, value in forecast.to_dict().items() if name != "parameters"},
        },
    }


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
