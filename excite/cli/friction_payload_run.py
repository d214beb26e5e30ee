"""Execution of ``excite friction`` and ``excite payload``: plan runs, fit curves, find what a robot holds."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

import excite
from constraints.geometry import World
from excite.cli.friction_commands import OF_RUNS
from excite.cli.main import NOT_HELD
from excite.cli.options import chosen_of, robot_file_of, task_of
from excite.cli.progress import one_interrupt
from excite.cli.streams import tell
from excite.cli.summary import console, print_view, show
from excite.design.design_folder import check_no_design, shown_content
from excite.design.friction_runs.friction_plan import FIGURE as RUNS, check_no_plan
from excite.design.friction_runs.schedule import Schedule
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.friction_fit import FIGURE, FRICTION, check_no_fit
from excite.payload.known_gains import write_gains
from excite.payload.payload_result import check_no_payload
from excite.storage.records import json_of
from excite.storage.result_folder import check_free, figure_names, result_file, result_folder
from excite.tasks.further_settings import CONTROLLERS, PayloadMotionSettings
from excite.tasks.installation import Installation
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.search import Output, Search
from excite.views.experiment_views import gains_view, payload_motion_view, payload_view
from excite.views.friction_views import friction_fit_view, friction_plan_view


def plan_runs_and_write(robot: str, out: Path, **given: Any) -> None:
    """Plan runs, and write them."""
    task, world = task_of(robot, given, Installation), _world_of(robot, given)
    limits = LimitChoice(**{what: given[what] for what in OF_RUNS})
    schedule = Schedule(**chosen_of(given, Schedule))
    chosen = {name: given[name] for name in ("joints", "drives", "pose", "balanced", "torque_ramp", "seed")}
    tell("looking for poses and bounding torques")
    with result_folder(out):
        check_no_plan(out, figure_names([RUNS], given["figures"].formats), replace=given["force"])
        plan = excite.plan_friction(task, schedule, limits=limits, world=world, **chosen)
        files = [*plan.save(out, replace=given["force"]), *given["figures"].write(plan, out)]
    fit = f"excite friction fit ROBOT LOG... --plan {out} --out DIR"
    show(
        friction_plan_view(plan),
        files,
        content=lambda: {"out": str(out), **{name: each for name, each in json_of(plan).items() if name != "robot"}},
        next_steps=[f"play each file and record positions and torques, then {fit}"],
        all_in="plan.json",
    )
    sys.exit(0 if plan.holds else NOT_HELD)


def _world_of(robot: str, given: Mapping[str, Any]) -> World | None:
    """The world that ``--world`` names, with the shape of a robot."""
    if given["world"] is None:
        return None
    snap_angles = given["snap_angles"] is not False
    return excite.read_world(given["world"], robot, given["base_link"], given["tip"], snap_angles=snap_angles)


def fit_and_write(robot: str, logs: Sequence[Path], out: Path, **given: Any) -> None:
    """Fit curves to logs and write their folder."""
    settings = FitSettings(**chosen_of(given, FitSettings))
    tell("reading the logs")
    with result_folder(out):
        check_no_fit(out, (FRICTION, *figure_names([FIGURE], given["figures"].formats)), replace=given["force"])
        described = installed_robot(task_of(robot, given, mount=given["mount"], payload=given["payload"]))
        asked = {key: given[key] for key in ("plan", "drives", "mapping", "drop")}
        if given["parameters"] is not None:
            own = given["parts"]
            asked["parameters"] = excite.load_result(given["parameters"], own) if own else given["parameters"]
        fit = excite.fit_friction(described, list(logs), settings, progress=tell, **asked)
        files = fit.save(out, replace=given["force"])
        files = [*given["figures"].write(fit, out), *files]
    show(
        friction_fit_view(fit),
        files,
        content=lambda: {"out": str(out), **json_of(fit)},
        next_steps=[f"excite identify ROBOT LOG... --friction-curves {out / FRICTION} --out DIR"],
        all_in="fit.json",
    )


def _robot_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of the API for how the robot is read and installed."""
    return {**robot_file_of(given), "installation": Installation(**chosen_of(given, Installation))}


def _logs_of(given: Mapping[str, Any]) -> excite.LogChoice:
    """How the logs are read."""
    names = ("mapping", "drop", "rows", "without_rows", "cutoff", "low_pass")
    return excite.LogChoice(*(given[name] for name in names))


def _frame_of(given: Mapping[str, Any]) -> tuple[float, ...] | None:
    """Origin and angles of a frame."""
    frame: tuple[float, ...] | None = given["frame"]
    return None if frame is None else frame + (0.0,) * (6 - len(frame))


def design_and_write(robot: str, out: Path, **given: Any) -> None:
    """Find a motion that shows the payload, and write it."""
    limits = {**chosen_of(given, LimitChoice), "world": _world_of(robot, given)}
    with result_folder(out):
        check_no_design(out, ("trajectory.csv",), replace=given["force"])
        tell("looking for the best motion")
        with one_interrupt() as interruption:
            motion = excite.design_payload_motion(
                robot,
                limits=LimitChoice(**limits),
                frame=_frame_of(given),
                **_robot_of(given),
                **chosen_of(given, PayloadMotionSettings, Search, Output),
            )
            interruption.ignore()
            files = motion.design.save(out, replace=given["force"])
            files = [*given["figures"].write(motion.design, out), *files]
    design, box = motion.design, motion.box

    def content() -> dict[str, Any]:
        own = {"pose": motion.pose.tolist(), "box": box, "payload_notes": list(motion.notes)}
        return {"out": str(out), **shown_content(design), **own}

    steps = [
        f"{'' if box is None else _stays(box)}drive to the first pose, play trajectory.csv slowly, then without and "
        "with the load, and record both for 'excite payload identify'"
    ]
    show(payload_motion_view(motion), files, content=content, next_steps=steps, all_in="design.json")
    sys.exit(0 if design.feasible else NOT_HELD)


def _stays(box: Any) -> str:
    """Where the tool point stays."""
    ends = (("-inf" if low is None else f"{low:.3g}", "inf" if high is None else f"{high:.3g}") for low, high in box)
    sides = (f"{axis} {low} to {high}" for axis, (low, high) in zip("xyz", ends, strict=True))
    return f"the tool point stays in {', '.join(sides)} m; "


def calibrate_and_write(robot: str, out: Path, **given: Any) -> None:
    """Calibrate the gains of the drives, and write their factors."""
    tell("reading the logs and calibrating")
    with result_file(out):
        check_free(out, replace=given["force"])
        calibrated = excite.calibrate_gains(
            robot,
            list(given["loaded"]),
            list(given["without"]),
            given["mass"],
            kind="common" if given["common"] else "each",
            logs=_logs_of(given),
            **_robot_of(given),
        )
        write_gains(calibrated.gains, out, robot=calibrated.robot, mass=given["mass"], replace=given["force"])
    steps = [f"excite payload identify ROBOT --with LOG --without LOG --gains {out} --out DIR"]
    show(gains_view(calibrated), [out], content=lambda: {"out": str(out), **calibrated.content()}, next_steps=steps)


def identify_and_write(robot: str, out: Path, **given: Any) -> None:
    """Identify a payload, and write it in the forms of controllers."""
    if bool(given["loaded"]) == bool(given["wrench"]):
        raise click.UsageError("give the logs of the motion with the load, as --with or as --wrench")
    chosen = {"all": CONTROLLERS, "none": ()}.get(given["controller"], (given["controller"],))
    tell("reading the logs and identifying")
    with result_folder(out):
        check_no_payload(out, chosen, replace=given["force"])
        payload = excite.identify_payload(
            robot,
            list(given["loaded"] or given["wrench"]),
            without=list(given["without"]),
            wrench=bool(given["wrench"]),
            logs=_logs_of(given),
            frame=_frame_of(given),
            **{name: given[name] for name in ("result", "gains", "gain_deviation", "frame_name", "rated")},
            **_robot_of(given),
        )
        files = payload.save(out, controllers=chosen, replace=given["force"])
    view, texts = payload_view(payload), payload.texts(chosen)
    steps = ["give mass and centre to the controller; the files hold them in its form"]

    def details() -> None:
        print_view(view, files, steps)
        for name, each in texts.items():
            console().print(f"\n{name}:\n{each['text'].rstrip()}", soft_wrap=True)

    def content() -> dict[str, Any]:
        return {"out": str(out), **json_of(payload), "controllers": texts}

    show(view, files, content=content, next_steps=steps, all_in="payload.json", details=details)
    sys.exit(NOT_HELD if payload.doubts else 0)
