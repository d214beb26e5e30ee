"""Execution of ``excite identify`` and ``verify``: reading, identifying, repeating, judging, writing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import excite
from excite.cli.main import NOT_HELD
from excite.cli.options import FigureChoice, check_not_typed, robot_file_of, typed_options
from excite.cli.progress import interrupted_status, one_interrupt, progress_of_repetitions, stoppable
from excite.cli.streams import in_options, remark, say, tell
from excite.cli.summary import Drawn, print_verdict, print_view, show
from excite.design.design_json import find_design
from excite.design.interruption import signal_answered
from excite.errors import LostWorkersError
from excite.export.models.exported_model import model_of_result
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe, not_repeated
from excite.identification.result import RepeatedParameter, RepetitionSummary
from excite.identification.result_json import (
    CURVES,
    FIGURES,
    REPETITIONS,
    SO_FAR,
    amend_result_file,
    check_free,
    result_content,
)
from excite.identification.servo_result import SERVOS
from excite.identification.servos import identify_servos
from excite.logs.mapping import read_mapping
from excite.registry import CHOSEN, is_addressed, is_own
from excite.storage.records import check_replaceable, json_of
from excite.storage.result_folder import check_not_taken, figure_names, result_folder
from excite.study.repetitions import Repetitions, experiment_of, repeat_experiment
from excite.tasks.further_settings import Tolerances
from excite.tasks.installation import Installation
from excite.tasks.model_choice import ModelChoice
from excite.verification.verification import KIND, Verification
from excite.verification.verify_servos import KIND as SERVO_KIND, ServoVerification, verify_servos
from excite.views.identification_view import identification_view, repetitions_view
from excite.views.servo_view import servo_verification_view, servo_verifications_view, servos_view
from excite.views.verification_view import verification_view, verifications_view
from excite.views.view import View
from regressors.errors import InputError
from regressors.robot.robot import Robot

_LEFT_OUT = (
    "schema", "robot", "task", "measured_condition_number", "motor_sides", "curves", "scatter", "scale", "calibration",
    "noise_deviations", "reference_values",
)  # fmt: skip
_KEPT = {"degrees_of_freedom", "unseen", "notes", "standard", "noise"}  # of the estimate
_GIVEN = (
    "base_link", "tip", "snap_angles", "xacro", "friction_curves", "mapping", "drop", "loaded", "known_mass", "gains",
    "each", "seed",
)  # fmt: skip
_SERVO = "servo"
_OF_TORQUES = (
    "friction_curves", "loaded", "known_mass", "gains", "design_folder", "designs", "choose", "each", "repeat", "seed",
    "executor", "workers",
)  # fmt: skip
_NOT_REPEATED = ("estimator", "standstill", "signals")
_Judged = Verification | ServoVerification


def identify_and_write(robot: str, logs: Sequence[Path], out: Path, **given: Any) -> None:
    """Identify from logs and write a result's folder."""
    of_recipe = {name: value for name, value in typed_options(Recipe).items() if value is not None}
    if typed_options(ModelChoice).get("model") == _SERVO:
        identify_servos_and_write(robot, logs, out, given)
    check_not_typed(("result",), "is for servos: give --model servo too")
    recipe = Recipe(**of_recipe)
    if given["repeat"]:
        recipe.check_repeatable(given["repeat"])
    else:
        check_not_typed(("executor", "workers"), "is for repetitions: give their number, --repeat N")
    tell("reading the logs")
    with result_folder(out):
        figures: FigureChoice = given["figures"]
        check_free(out, (*figure_names(FIGURES, figures.formats), CURVES), replace=given["force"])
        with one_interrupt() as interruption:
            result = _identified(robot, logs, of_recipe, given)
            interruption.ignore()
            files = result.save(out, replace=given["force"])
            if not given["repeat"]:
                _show(result, lambda: [*figures.write(result, out), *files], out)
        status = NOT_HELD if result.doubts else 0
        if given["repeat"]:  # which may take hours: what is known is drawn before
            files = [*figures.write(result, out), *files]
            tell("repeating the experiment in simulation")
            result, repeated = repeat_and_write(result, out, given)
            status = repeated or status
            drawn = figure_names([REPETITIONS], figures.formats) if result.repetitions is not None else []
            _show(result, [*(out / name for name in drawn), *files], out)
    sys.exit(status)


def _show(result: Identification, files: Sequence[Path] | Drawn, out: Path) -> None:
    """Show a result, and how to go on."""
    cures = dict.fromkeys(in_options(doubt.cure) for doubt in result.doubts)
    steps = list(cures) or [f"excite verify {out} OTHER.csv, with a log that was not used here"]

    def content() -> dict[str, Any]:  # the file without what stands there twice, and without the robot and the task
        left_out = {*_LEFT_OUT, *(field.name for field in fields(result.estimate))} - _KEPT
        return {"out": str(out), **{k: v for k, v in result_content(result).items() if k not in left_out}}

    show(identification_view(result), files, content=content, next_steps=steps, all_in="result.json")


def identify_servos_and_write(robot: str, logs: Sequence[Path], out: Path, given: Mapping[str, Any]) -> NoReturn:
    """Identify servos from commanded and measured positions, and write them into a folder."""
    typed = set(typed_options(ModelChoice, Recipe)) - {"model"}
    check_not_typed((*typed, *_OF_TORQUES), "is not for servos: their model has no such setting")
    with result_folder(out), one_interrupt():
        check_not_taken(out, SERVOS, "servos", replace=given["force"])
        described = robot_file_of(given)
        read = {name: given[name] for name in ("mapping", "drop") if given[name] is not None}
        installation = Installation(**typed_options(Installation))
        arm: Robot | str = robot
        if given["result"] is None:
            read |= {**described, "installation": installation}
        else:
            arm = installation.applied(_identified_arm(given["result"], robot, described))
        result = identify_servos(arm, list(logs), progress=tell, **read)
        files = result.save(out, replace=given["force"])
    steps = [f"excite verify {out} OTHER, with a log that was not used here"]
    show(servos_view(result), files, content=lambda: json_of(result), next_steps=steps, all_in=SERVOS)
    sys.exit(NOT_HELD if result.doubts else 0)


def _identified_arm(folder: Path, robot: str, files: dict[str, Any]) -> Robot:
    """The robot with the bodies that a result stands for, in the place of its description."""
    described = excite.load_robot(robot, files.pop("base_link", None), **files)
    model = model_of_result(excite.load_result(folder))
    if model.robot.joint_names != described.joint_names:
        own, named = ", ".join(model.robot.joint_names), ", ".join(described.joint_names)
        raise InputError(f"the result in {folder} is of {own}, and {robot} has {named}; name the result of this robot")
    for note in model.notes:
        remark(f"excite: note: {note}")
    return model.robot


def _identified(
    robot: str, logs: Sequence[Path], of_recipe: Mapping[str, Any], given: Mapping[str, Any]
) -> excite.Identification:
    typed = typed_options(Installation, ModelChoice)
    typed.pop("friction_curves", None)
    own = {"model": typed["model"]} if is_own(typed.get("model", "")) else {}
    folder = design_folder(given["design_folder"], given["mapping"], given["designs"])
    design = None if folder is None else excite.load_design(folder, given["parts"], **own)
    repeat, choose = bool(given["repeat"]), given["choose"]
    if repeat and given["friction_curves"] is not None:
        raise not_repeated()
    if design is not None and given["friction_curves"] is None and _has_curves(design, typed):
        remark(
            "excite: note: the design is for known friction: its curves are subtracted; --friction identifies "
            "friction, --friction-curves names other curves"
        )
        if repeat:
            raise not_repeated()
    if repeat:  # not what cannot be repeated
        names = (CHOSEN if choose else ()) if isinstance(choose, bool) else choose
        choose = tuple(each for each in names if each not in _NOT_REPEATED)
    return excite.identify(
        robot, list(logs), design=design, choose=choose, progress=tell, **{name: given[name] for name in _GIVEN},
        **typed, **of_recipe,
    )  # fmt: skip


def _has_curves(design: Any, typed: Mapping[str, Any]) -> bool:
    """Whether the friction curves of the design are subtracted."""
    if design.task.known_friction is None or typed.get("friction", False):
        return False
    named = {"model": typed["model"]} if "model" in typed else {}
    return bool(design.task.changed(**named, friction_curves=None).model.channel == "effort")


def design_folder(given: Path | None, mapping: Path | None, places: Sequence[Path]) -> Path | None:
    """Folder of the design that was played."""
    named = None if mapping is None or given is not None else read_mapping(mapping).design
    if mapping is None or named is None:
        return given
    searched = tuple(places) or (mapping.parent, Path("designs"))
    found = find_design(named, searched)
    where = ", ".join(str(place) for place in searched)
    if found is None:
        remark(
            f"excite: note: {mapping} names the design {named[:12]}..., which is not in {where} nor directly below: "
            "its model is not used; --designs names other folders, --design the design itself"
        )
    else:
        remark(f"excite: note: {found} holds the design that {mapping} names; its model is used")
    return found


def repeat_and_write(result: Identification, out: Path, given: Mapping[str, Any]) -> tuple[Identification, int]:
    """Repeat an identification in simulation, add the statistics to its result, and draw them beside it."""
    count, where = given["repeat"], {"executor": given["executor"], "workers": given["workers"]}
    shown = progress_of_repetitions(count)
    waits = is_addressed("executor", given["executor"])  # for Dask, while which a signal is heeded at once
    try:
        with one_interrupt(), shown if waits else stoppable(shown, "stopping after the repetitions at work") as report:
            experiment = experiment_of(result, count)
            repeated_runs = repeat_experiment(experiment, count, given["seed"], report, **where, kept=out / SO_FAR)
            result = replace(result, kept=result.facts, repetitions=summary_of(repeated_runs))
            amend_result_file(out, result)
    except KeyboardInterrupt:
        signal_answered()
        say("excite: interrupted; the result is saved, without repetitions")
        return result, interrupted_status()
    except InputError as error:
        raise InputError(f"{error}; the result in {out} is saved, without repetitions") from error
    except LostWorkersError as error:
        saved = f"the result in {out} is saved, without repetitions"
        raise LostWorkersError(*error.args, saved + _continued(out)) from error
    given["figures"].write(repetitions_view(result, repeated_runs), out)
    if repeated_runs.interrupted:
        done = f"with {repeated_runs.count} of {count} repetitions"
        say(f"excite: interrupted; the result is saved, {in_options(done + _continued(out))}")
        return result, interrupted_status()
    return result, 0


def _continued(out: Path) -> str:
    return "; with `force`, the same command goes on" if (out / SO_FAR).exists() else ""


def summary_of(repeated: Repetitions) -> RepetitionSummary:
    """Statistics of repetitions, as a result keeps them."""
    numbers = (repeated.deviation, repeated.predicted_deviation, repeated.bias, repeated.bias_error, repeated.coverage)
    rows = zip(repeated.names, repeated.units, *(each.tolist() for each in numbers), strict=True)
    return RepetitionSummary(repeated.count, repeated.seed, tuple(RepeatedParameter(*row) for row in rows))


def verify_and_write(folder: Path, logs: Sequence[Path], out: Path | None, figures: FigureChoice, **given: Any) -> None:
    """Judge a result on logs, or servos, and write each verdict."""
    kind, target = KIND, out or folder
    views: tuple[Callable[..., View], Callable[..., View]] = verification_view, verifications_view
    if (folder / SERVOS).exists():
        of_torques = ("torque", "motion", "horizon", "rows", "signals", "temperature", "part")
        check_not_typed(of_torques, "is not for servos: they are judged by their motion")
        kind, views = SERVO_KIND, (servo_verification_view, servo_verifications_view)
        chosen = {name: given[name] for name in ("mapping", "drop", "training_too")}
        judge: Callable[..., _Judged] = partial(verify_servos, folder, **chosen)
        step = "identify from more logs, of the kinds of motion that matter"
    else:
        tolerances = Tolerances(given.pop("torque"), given.pop("motion"))
        result = excite.load_result(folder, given.pop("parts"))
        target = out or result.folder or folder
        judge = partial(excite.verify, result, tolerances=tolerances, **given)
        step = "'excite verify ... --verbose' shows what limits each joint"
    (of_one, of_all), stems = views, _stems(logs)
    with result_folder(target):
        for stem in stems:
            check_replaceable(target, kind, stem)
        judged = []
        for log in logs:
            tell(f"judging {folder} on {log}")
            judged.append(judge(log))
        each = list(map(of_one, judged, stems))
        _show_judged(judged, each, of_all(judged) if len(each) > 1 else each[0], target, figures, step)


def _show_judged(
    judged: Sequence[_Judged], views: Sequence[View], view: View, target: Path, figures: FigureChoice, step: str
) -> NoReturn:
    """Save each verdict under the name of its view, and print the one on all."""
    files = [file for each, own in zip(judged, views, strict=True) for file in each.save(target, name=own.filed)]

    def drawn() -> list[Path]:
        return [*(file for own in views for file in figures.write(own, target)), *files]

    def details() -> None:
        for own in views:
            print_verdict(own)
            print_view(own)
        print_view(View(view.title, view.verdict), drawn())

    show(
        view,
        drawn,
        content=lambda: list(map(json_of, judged)),
        next_steps=[] if view.holds else [step],
        all_in="verification-*.json",
        details=details if len(judged) > 1 else None,
    )
    sys.exit(0 if view.holds else NOT_HELD)


def _stems(logs: Sequence[Path]) -> list[str]:
    """Name of each log's files; logs of the same name in different folders are numbered."""
    names = [path.stem for path in logs]
    counts = [names[: k + 1].count(name) for k, name in enumerate(names)]
    return [f"verification-{name}" + f"-{count}" * (count > 1) for name, count in zip(names, counts, strict=True)]
