"""Fitting of friction curves to logs, for the command line and scripts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from excite.design.friction_runs.friction_plan import FrictionPlan, load_friction_plan
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.friction_fit import FrictionFit, characteristics
from excite.friction.plan_match import PlannedRuns, planned_runs
from excite.friction.points import RigidModel, described_model, identified_model
from excite.identification.identification import Identification
from excite.identification.procedure import LogLike, read_logs
from excite.identification.result_json import load_result
from excite.logs.event import segments
from excite.logs.log_checks import check_log
from excite.logs.mapping import LogMapping
from excite.tasks.reference import MotionSource
from excite.tasks.robot_of_task import robot_and_task
from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.numerical import numerical_work, one_thread
from regressors.robot.robot import Robot, transmission_of


class Played(Protocol):
    """A simulation, which knows what it played."""

    @property
    def source(self) -> MotionSource | None:
        """Motion that was played, and where it is from."""


PlanLike = FrictionPlan | MotionSource | Played | str | Path
_PACKAGES = ("excite-trajectories", "numpy", "scipy")


@checked
@numerical_work(
    "the friction fit",
    "speeds or torques of very different sizes are the likely cause: "
    "check the units of the log, `window` and `exponent`",
)
def fit_friction(
    robot: Robot | str,
    logs: LogLike | Sequence[LogLike],
    settings: FitSettings | None = None,
    *,
    plan: PlanLike | None = None,
    parameters: Identification | str | Path | None = None,
    drives: Sequence[str] | None = None,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> FrictionFit:
    """Fit friction curves to logs of runs at constant speed.

    Parameters
    ----------
    robot : Robot or str
        A robot, or the name or file of one.
    logs : Log, frame, dict of columns, Simulation, path, or a sequence of them
    settings : FitSettings, optional
    plan : FrictionPlan, MotionSource, Simulation or path, optional
        The plan that was played, its folder, one of its motions or files, or a simulation of it.
    parameters : Identification or path, optional
        Identified parameters for subtracting gravity, instead of those of the robot's description.
    drives : sequence of str, optional
        By name or number; those that move in the logs if not given.
    mapping, drop
        See `excite.identification.identify.identify`.
    progress : callable
        Called with a description of each step.
    **options
        Of `FitSettings`, by name.

    Returns
    -------
    FrictionFit

    Raises
    ------
    InputError
        See `excite.friction.friction_fit.characteristics`.
    """
    settings = replace(settings if settings is not None else FitSettings(), **options)
    robot, _ = robot_and_task(robot)
    robot.check_open("a fit of friction curves")
    with one_thread():
        model = _rigid(robot, parameters, settings)
        read = read_logs(logs, robot, mapping, tuple(drop), progress)
        for part in (part for log in read for part in segments(log)):
            check_log(part, robot, may_rest=True)  # a drive that breaks away moves by microns
        runs = _plan(robot, plan)
        progress("fitting curves to windows of constant speed")
        curves = characteristics(robot, read, settings, model, _wanted(robot, drives, runs, plan), runs)
        source = model(robot).source if any(curve.gravity == "model" for curve in curves) else None
    provenance = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {package: version(package) for package in _PACKAGES},
    }
    fitted = tuple(log.reference for log in read)
    return FrictionFit(robot.name, robot.sha256(), fitted, settings, curves, source, provenance)


def _rigid(
    robot: Robot, parameters: Identification | str | Path | None, settings: FitSettings
) -> Callable[[Robot], RigidModel]:
    """Model without friction for the robot of a log."""
    if parameters is None:
        return described_model
    if settings.gravity == "symmetric":
        raise InputError("`parameters` is for `gravity='model'`; symmetric windows need no model")
    result = load_result(parameters) if isinstance(parameters, str | Path) else parameters
    model = identified_model(result, robot)
    return lambda _: model


def _plan(robot: Robot, plan: PlanLike | None) -> Mapping[str, PlannedRuns] | None:
    """Planned runs of each drive."""
    if plan is None:
        return None
    planned = plan if isinstance(plan, FrictionPlan) else load_friction_plan(_folder(plan))
    if planned.robot.sha256() != robot.sha256():
        raise InputError(f"{_name(plan)} is a plan for {planned.robot.name}, not for {robot.name} as given here")
    return planned_runs(planned, _name(plan))


def _folder(plan: MotionSource | Played | str | Path) -> Path:
    """Where a plan is, also where one of its files is given."""
    if isinstance(plan, str | Path):
        return Path(plan)
    source = plan if isinstance(plan, MotionSource) else plan.source
    if not isinstance(source, MotionSource) or not source.planned or source.file is None:
        raise InputError("`plan`: expected a friction plan, given a motion that comes from none")
    return source.file.parent


def _name(plan: PlanLike) -> str:
    """What a plan is called in messages."""
    return "the plan" if isinstance(plan, FrictionPlan) else str(_folder(plan))


def _wanted(
    robot: Robot, drives: Sequence[str] | None, runs: Mapping[str, PlannedRuns] | None, plan: PlanLike | None
) -> tuple[str, ...] | None:
    """Names of the drives that were asked for, by name or number."""
    if drives is None:
        return None
    numbers = {str(number): drive.name for number, drive in enumerate(transmission_of(robot).drives, 1)}
    names = tuple(numbers.get(name, name) for name in drives)
    if plan is not None and runs is not None:
        check_names(f"drive in {_name(plan)}", names, runs)
    return names
