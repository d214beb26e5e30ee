"""Execution of ``excite payload``: design the motion, calibrate the gains, identify what the robot holds."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import excite
from excite.cli.interrupts import one_interrupt
from excite.cli.main import NOT_HELD
from excite.cli.messages import in_options
from excite.cli.options import robot_file_of, world_of
from excite.cli.payload_command import LIMITED
from excite.cli.sign_of_life import tell
from excite.cli.streams import remark
from excite.cli.summary import show
from excite.cli.task_options import chosen_of
from excite.cli.view_text import brief_table, print_view, show_view, view_summary
from excite.design.design_folder import check_no_design, design_content
from excite.payload.known_gains import save_gains
from excite.payload.payload_result import check_no_payload
from excite.storage.records import json_of
from excite.storage.result_folder import result_folder
from excite.tasks.further_settings import CONTROLLERS, PayloadMotionSettings
from excite.tasks.installation import Installation
from excite.views.payload_view import payload_motion_view, payload_view
from excite.views.view import Column, Format, View, ViewTable


def _robot_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of the API for how the robot is read and installed."""
    return {**robot_file_of(given), "installation": Installation(**chosen_of(Installation, given))}


def _logs_of(given: Mapping[str, Any]) -> excite.LogChoice:
    """How the logs are read."""
    names = ("mapping", "drop", "rows", "without_rows", "cutoff", "low_pass")
    return excite.LogChoice(*(given[name] for name in names))


def _frame_of(given: Mapping[str, Any]) -> tuple[float, ...] | None:
    """Origin and angles of a frame."""
    frame: tuple[float, ...] | None = given["frame"]
    return None if frame is None else frame + (0.0,) * (6 - len(frame))


def design_and_write(robot: str, out: Path, given: Mapping[str, Any]) -> None:
    """Find a motion that shows the payload, and write it."""
    limits = {name: given[name] for name in LIMITED if given[name] is not None}
    limits |= {"world": world_of(robot, given)} if given["world"] is not None else {}
    chosen = {name: value for name, value in chosen_of(PayloadMotionSettings, given).items() if name != "box"}
    with result_folder(out):
        check_no_design(out, ("trajectory.csv",), replace=given["force"])
        tell("looking for the best motion")
        with one_interrupt() as interruption:
            motion = excite.design_payload_motion(
                robot,
                given["box"],
                limits=excite.LimitChoice(**limits),
                frame=_frame_of(given),
                seed=given["seed"],
                rate=given["rate"],
                **_robot_of(given),
                **chosen,
            )
            interruption.ignore()
            files = motion.design.save(out, replace=given["force"])
            files = [*given["figures"].write(motion.design, out), *files]
    for note in motion.notes:
        remark(f"excite: note: {in_options(note)}")
    design, box = motion.design, motion.box

    def content() -> dict[str, Any]:
        left_out = ("schema", "robot", "solver", "conventions")
        shown = {k: v for k, v in design_content(design).items() if k not in left_out}
        return {
            "out": str(out), **shown, "pose": motion.pose.tolist(), "box": box, "payload_notes": list(motion.notes)
        }  # fmt: skip

    view = payload_motion_view(motion)
    steps = [
        f"{'' if box is None else _stays(box)}drive to the first pose, play trajectory.csv slowly, then without and "
        "with the load, and record both for 'excite payload identify'"
    ]
    show(view_summary(view, files, steps, "design.json"), content, lambda: print_view(view, files, steps))
    sys.exit(0 if design.feasible else NOT_HELD)


def _stays(box: Any) -> str:
    """Where the tool point stays."""
    ends = (("-inf" if low is None else f"{low:.3g}", "inf" if high is None else f"{high:.3g}") for low, high in box)
    sides = (f"{axis} {low} to {high}" for axis, (low, high) in zip("xyz", ends, strict=True))
    return f"the tool point stays in {', '.join(sides)} m; "


def calibrate_and_write(robot: str, out: Path, given: Mapping[str, Any]) -> None:
    """Calibrate the gains of the drives, and write their factors."""
    mass = given["mass"]
    tell("reading the logs and calibrating")
    with save_gains(out, replace=given["force"]) as write:
        calibrated = excite.calibrate_gains(
            robot,
            list(given["loaded"]),
            list(given["without"]),
            mass,
            kind="common" if given["common"] else "each",
            logs=_logs_of(given),
            **_robot_of(given),
        )
        write(calibrated.gains, robot=calibrated.robot, mass=mass)
    show_view(
        _gains_view(calibrated),
        [out],
        content=lambda: {"out": str(out), **calibrated.content()},
        next_steps=[f"excite payload identify ROBOT --with LOG --without LOG --gains {out} --out DIR"],
    )


def _gains_view(calibrated: excite.CalibratedGains) -> View:
    gains, factors = calibrated.gains, calibrated.gains.factor
    columns = (
        Column("drive", Format.TEXT, brief=True), Column("factor", brief=True, digits=4),
        Column("99 %, +-", brief=True, digits=2),
    )  # fmt: skip
    deviations = (calibrated.quantile * gains.deviation).tolist()
    rows = tuple(zip(gains.drives, factors.tolist(), deviations, strict=True))
    return View(
        title=f"gains of {calibrated.robot}",
        verdict=f"Gains of {calibrated.robot} are {factors.min():.3f} to {factors.max():.3f} times those stated",
        summary=(
            f"with stated gains, the load of {calibrated.known_mass:g} kg appears as {calibrated.stated_mass:.4g} kg",
        ),
        remarks=tuple(calibrated.notes),
        tables=(ViewTable("gains", "Factors of the stated gains", columns, rows),),
    )


def identify_and_write(robot: str, out: Path, given: Mapping[str, Any]) -> None:
    """Identify a payload, and write it in the forms of controllers."""
    chosen = {"all": CONTROLLERS, "none": ()}.get(given["controller"], (given["controller"],))
    wrench = bool(given["wrench"])
    tell("reading the logs and identifying")
    with result_folder(out):
        check_no_payload(out, chosen, replace=given["force"])
        payload = excite.identify_payload(
            robot,
            list(given["loaded"] or given["wrench"]),
            without=list(given["without"]),
            wrench=wrench,
            logs=_logs_of(given),
            frame=_frame_of(given),
            **{name: given[name] for name in ("result", "gains", "gain_deviation", "frame_name", "rated")},
            **_robot_of(given),
        )
        files = payload.save(out, controllers=chosen, replace=given["force"])
    view, texts = payload_view(payload), payload.texts(chosen)
    show_view(
        view,
        files,
        content=lambda: {"out": str(out), **json_of(payload), "controllers": texts},
        facts=[*view.summary, *brief_table(view.tables[0], most=len(view.tables[0].rows))],
        more=[f"\n{name}:\n{each['text'].rstrip()}" for name, each in texts.items()],
        next_steps=["give mass and centre to the controller; the files hold them in its form"],
        all_in="payload.json",
    )
    sys.exit(NOT_HELD if payload.doubts else 0)
