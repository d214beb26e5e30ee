"""Execution of ``excite study``, ``predict``, ``bound``, ``compare`` and ``plan``: what motions reach."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import excite
from excite.cli.design_commands import OF_NEXT_MOTION
from excite.cli.main import NOT_HELD
from excite.cli.options import FigureChoice, check_not_typed, robot_file_of, task_of, typed_options
from excite.cli.streams import remark, tell
from excite.cli.summary import show
from excite.design.comparison import Judgement
from excite.design.design_folder import check_no_design, data_files
from excite.design.interruption import current_interruption
from excite.design.start_results import StartResult
from excite.design.task_file import read_task_file, task_from_options
from excite.optimality.design_bound import NAME, stored_bound
from excite.optimality.sensitivity import sensitivity
from excite.storage.records import json_of
from excite.storage.result_folder import figure_names, result_folder
from excite.study.time_study import FIGURE, check_free
from excite.tasks.installation import Installation
from excite.tasks.model_choice import FURTHER_FRICTION, ModelChoice
from excite.views.comparison_view import comparison_view, verdicts
from excite.views.view import view_of
from regressors.numerical import or_none


def study_and_write(robot: str, logs: Sequence[Path], out: Path, figures: FigureChoice, **given: Any) -> None:
    """Follow the estimates of logs and designs over time, and write them."""
    if not given["repeats"]:
        check_not_typed(("executor", "workers"), "is for repetitions: give their number, --repeats N")
    simulation = {name: given.pop(name) for name in ("rate", "encoder", "torque_noise", "seed")}
    designs, parts, force = (given.pop(name) for name in ("designs", "parts", "force"))
    with result_folder(out):
        check_free(out, figure_names([FIGURE], figures.formats), replace=force)
        study = excite.study_over_time(
            robot,
            logs,
            designs=[excite.load_design(folder, parts) for folder in designs],
            simulation=simulation,
            progress=tell,
            **{name: value for name, value in given.items() if value is not None},
        )
        files = [*study.save(out, replace=force), *figures.write(study, out)]
    show(view_of(study), files, content=lambda: json_of(study), all_in="study.json")


def predict_and_write(folder: Path, parts: tuple[str, ...], **given: Any) -> None:
    """Predict what repeats of an experiment will show, and write it beside the design."""
    design = excite.load_design(folder, parts)
    asked = {name: value for name, value in given.items() if value is not None}
    prediction = excite.predict_accuracy(design, progress=tell, **asked)
    files = prediction.save(_place(folder))
    show(view_of(prediction), files, content=lambda: json_of(prediction), all_in=files[0].name)


def bound_and_write(
    folder: Path, criteria: tuple[str, ...], seed: int, parts: tuple[str, ...], force: bool, what_ifs: bool
) -> None:
    """Bound the criteria of a design, or read what was computed of the same problem before."""
    design = excite.load_design(folder, parts)
    known = None if force else stored_bound(design)
    files: list[Path] = []
    remarks: tuple[str, ...] = ()
    if known is not None and {each.name for each in known.criteria} >= set(criteria):
        result, remarks = known, (f"bounds are read from {NAME}; --force computes them again",)
        if known.sensitivity is None and what_ifs:
            result = replace(known, sensitivity=sensitivity(design, tell))
            files = result.save(_place(folder))
    else:
        result = excite.bound(design, criteria, seed=seed, what_ifs=what_ifs, progress=tell)
        others = () if known is None else (each for each in known.criteria if each.name not in criteria)
        result = replace(result, criteria=(*result.criteria, *others))
        files = result.save(_place(folder))
    view = view_of(result)
    show(replace(view, remarks=(*remarks, *view.remarks)), files, content=lambda: json_of(result))
    if (interruption := current_interruption()) is not None and interruption.number is not None:
        sys.exit(interruption.status)  # the bound so far is kept


def _place(folder: Path) -> Path:
    """The folder of a design that may be named by its file."""
    return folder.parent if folder.suffix == ".json" else folder


def compare_designs(designs: Sequence[Path], model: str | None, window: str | None, parts: tuple[str, ...]) -> None:
    """Judge designs by the same metrics, and show them."""
    read = []
    for folder in designs:
        tell(f"reading {folder}")
        read.append(excite.load_design(folder, parts))
    tell("comparing the designs")
    judged = excite.compare(read, model, window)
    known = [bound for each in read if (bound := stored_bound(each)) is not None]
    show(
        comparison_view(judged, known),
        content=lambda: [{"verdict": text, **_plain(j)} for text, j in zip(verdicts(judged), judged, strict=True)],
        next_steps=["--verbose shows every convention of the condition number, and every metric"],
    )


def _plain(judgement: Judgement) -> dict[str, object]:
    goal, criteria = judgement.goal, {name: or_none(value) for name, value in judgement.criteria.items()}
    return {**asdict(judgement), "goal": None if goal is None else or_none(goal), "criteria": criteria}


def plan_from_options(robot: str, **given: Any) -> None:
    """Propose a campaign, or with a precision the next motion; end with the exit status."""
    if given["precision"] is None:
        check_not_typed(OF_NEXT_MOTION, "is for the next motion towards a precision; give --precision too")
        _plan_campaign(robot, given)
    else:
        filed = read_task_file(given["task_file"]) if given["task_file"] else {}
        typed = {**typed_options(), **robot_file_of(given), "robot": robot}
        at_period = {"scale": "precision"} if "period" in typed else {}  # not at the shortest
        task = task_from_options({"model": "differential", **filed, **typed, **at_period})
        sys.exit(plan_next_motion(task, given["of"], given["out"], force=given["force"]))


def _plan_campaign(robot: str, given: Mapping[str, Any]) -> None:
    """Propose the motions that identify every parameter."""
    curves = given["friction_curves"]
    known = None if curves is None else excite.read_friction(Path(curves))
    task = task_of(robot, given, Installation, ModelChoice, friction_curves=known)
    tell("finding the parameters that each selection of drives identifies")
    campaign = excite.plan_campaign(task, given["at_once"])
    drives = ",".join(campaign.steps[0].drives)
    step = f"{_design_command(task, curves)} --drives {drives} --out designs/motion-1"
    show(view_of(campaign), content=lambda: json_of(campaign), next_steps=[step])


def _design_command(task: excite.Task, curves: str | None) -> str:
    """Command that designs for the same robot, chain and parameters."""
    model = task.model
    words = ["excite", "design", task.robot_name, "--model", str(model.model)]
    for flag, value in (
        ("--base", task.base_link),
        *(("--tip", tip) for tip in ((task.tip,) if isinstance(task.tip, str) else task.tip or ())),
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
    show(view_of(step), files, content=lambda: _content(step, out), next_steps=[_next(step, out)])
    return 0 if step.enough else NOT_HELD


def _next(step: excite.NextMotion, out: Path | None) -> str:
    if step.enough:
        return "play the planned motions" if step.planned else "nothing more to play; verify on a log that was not used"
    if out is None:
        return "the same command with --out DIR writes the motion"
    runs = "once" if step.runs == 1 else f"{step.runs} times"
    return f"play {out / 'trajectory.csv'} {runs}, identify from its logs, and plan again with that result in --after"


def _content(step: excite.NextMotion, out: Path | None) -> dict[str, Any]:
    forecast, following, parameters = step.forecast, None, []
    for one in step.parameters:
        known = {name: or_none(value) if isinstance(value, float) else value for name, value in vars(one).items()}
        parameters.append({**known, "enough": one.enough})
    if step.design is not None and forecast is not None:
        own = {name: value for name, value in json_of(forecast).items() if name != "parameters"}
        following = {"out": None if out is None else str(out), "period": step.design.trajectory.duration, **own}
    content = {"robot": step.robot, "enough": step.enough, "planned": list(step.planned)}
    return {**content, "parameters": parameters, "next": following}
