"""Execution of ``excite friction``: plan runs, or fit curves, and write their folder."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import excite
from excite.cli.friction_command import LIMITED
from excite.cli.main import NOT_HELD
from excite.cli.options import robot_file_of, world_of
from excite.cli.sign_of_life import tell
from excite.cli.task_options import chosen_of
from excite.cli.view_text import brief_table, show_view
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_fit import FIGURE, FRICTION, check_no_fit
from excite.friction.plan.friction_plan import FIGURE as RUNS
from excite.friction.plan.friction_plan import check_no_plan
from excite.friction.plan.schedule import Schedule
from excite.storage.records import json_of
from excite.storage.result_folder import figure_names, result_folder
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import PARTS
from excite.views.friction_fit_view import friction_fit_view
from excite.views.friction_plan_view import friction_plan_view


def plan_and_write(robot: str, out: Path, given: Mapping[str, Any]) -> None:
    """Plan runs, and write them."""
    task = excite.Task(robot, **robot_file_of(given), **chosen_of(PARTS["installation"], given))
    described = installed_robot(task)
    world = world_of(robot, given)
    limits = excite.LimitChoice(**{what: given[what] for what in LIMITED})
    schedule = Schedule(**chosen_of(Schedule, given))
    chosen = {name: given[name] for name in ("joints", "drives", "pose", "balanced", "torque_ramp", "seed")}
    tell("looking for poses and bounding torques")
    with result_folder(out):
        check_no_plan(out, figure_names([RUNS], given["figures"].formats), replace=given["force"])
        plan = excite.plan_friction(described, schedule, limits=limits, world=world, **chosen)
        files = plan.save(out, replace=given["force"])
        files = [*files, *given["figures"].write(plan, out)]
    view = friction_plan_view(plan)
    show_view(
        view,
        files,
        content=lambda: {"out": str(out), **{name: each for name, each in json_of(plan).items() if name != "robot"}},
        facts=[*view.summary, *brief_table(view.tables[0])],
        next_steps=[
            "play each file and record positions and torques, then excite friction fit ROBOT LOG... --plan "
            f"{out} --out DIR"
        ],
        all_in="plan.json",
    )
    if not plan.holds:
        sys.exit(NOT_HELD)


def fit_and_write(name: str, paths: Sequence[Path], out: Path, given: Mapping[str, Any]) -> None:
    """Fit curves to logs and write their folder."""
    settings = FitSettings(**chosen_of(FitSettings, given))
    tell("reading the logs")
    with result_folder(out):
        check_no_fit(out, (FRICTION, *figure_names([FIGURE], given["figures"].formats)), replace=given["force"])
        task = excite.Task(name, **robot_file_of(given), mount=given["mount"], payload=given["payload"])
        robot = installed_robot(task)
        asked = {key: given[key] for key in ("plan", "drives", "mapping", "drop")}
        if given["parameters"] is not None:
            own = given["parts"]
            asked["parameters"] = excite.load_result(given["parameters"], own) if own else given["parameters"]
        fit = excite.fit_friction(robot, list(paths), settings, progress=tell, **asked)
        files = fit.save(out, replace=given["force"])
        files = [*given["figures"].write(fit, out), *files]
    view = friction_fit_view(fit)
    drives = ", ".join(characteristic.drive for characteristic in fit.characteristics)
    show_view(
        view,
        files,
        content=lambda: {"out": str(out), **json_of(fit)},
        facts=[*brief_table(view.tables[0]), *view.summary],
        notes=[*view.remarks, "friction of other drives is identified with the masses"],
        more=[f"note: {FRICTION} has curves of {drives}; friction of other drives is identified with the masses"],
        next_steps=[f"excite identify ROBOT LOG... --friction-curves {out / FRICTION} --out DIR"],
        all_in="fit.json",
    )
