"""Names of the last release that are called otherwise now, or are elsewhere; `excite` warns where one is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from excite.design.design import Design
from excite.design.design_json import load_design as read_design
from excite.design.sweeps.run_sweep import run_sweep as run_campaign
from excite.design.sweeps.sweep_table import SweepTable as CampaignTable, load_sweep
from excite.errors import BrokenLimitError, ConicSolverError, LostMotionError, LostWorkersError, NoFeasibleMotionError
from excite.export.exported import Exported
from excite.identification.identification import Identification
from excite.identification.identify import identify
from excite.identification.recipe import Recipe
from excite.identification.result_json import load_result as read_result
from excite.logs.guess.log_guess import LogGuess
from excite.logs.log import Log
from excite.study.posterior_samples import load_posterior
from excite.tasks.limit_choice import LimitChoice as LimitOverrides
from excite.tasks.robot_of_task import check_robot
from excite.tasks.task import Task
from excite.verification.verify import verify as verified
from regressors.errors import TooLargeError
from regressors.models.windows import Window
from regressors.robot.columns import Terms
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot

__all__ = [
    "BrokenLimitError",
    "CampaignTable",
    "ConicSolverError",
    "Exported",
    "LimitOverrides",
    "LogGuess",
    "LostMotionError",
    "LostWorkersError",
    "NoFeasibleMotionError",
    "Terms",
    "TooLargeError",
    "Window",
    "identified",
    "load_campaign",
    "load_posterior",
    "load_sweep",
    "read_design",
    "read_result",
    "run_campaign",
    "save_design",
    "verified",
]

load_campaign = load_sweep


def save_design(design: Design, folder: str | Path, *, force: bool = False) -> list[Path]:
    """``design.save(folder, replace=force)``."""
    return design.save(folder, replace=force)


def identified(
    robot: Robot,
    task: Task,
    logs: Sequence[Log],
    recipe: Recipe | None = None,
    *,
    friction: FrictionCurves | None = None,
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> Identification:
    """``identify(task, logs, recipe=recipe)``."""
    check_robot(robot, task)
    return identify(
        task.changed(robot=robot), logs, recipe=recipe, friction_curves=friction, progress=progress, **options
    )
