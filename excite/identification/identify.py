"""The way from logs to an identification, as the command line and scripts go it."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from excite.design.designed_motion import DesignedMotion
from excite.identification.estimation import estimate_parameters
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.information.target import friction_of_moving, moving_robot
from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import LogMapping, read_mapping
from excite.logs.sidecar import sidecar_of
from excite.registry import built_in
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves
from regressors.models.model import RegressorModel
from regressors.robot.robot import Robot

if TYPE_CHECKING:
    from excite.identification.estimator import Estimator

_PACKAGES = ("excite-trajectories", "casadi", "clarabel", "numpy", "scipy")
_RECIPE = frozenset(field.name for field in fields(Recipe))
LogLike = Any  # a Log, the name of its file, or a simulation, which has one


def identify(
    model: RegressorModel | Robot | Task | str,
    logs: LogLike | Sequence[LogLike],
    *,
    design: DesignedMotion | None = None,
    friction: FrictionCurves | str | Path | None = None,
    recipe: Recipe | None = None,
    estimator: Estimator | str | None = None,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> Identification:
    """Identify a model's parameters from one log or several.

    Parameters
    ----------
    model : RegressorModel, Robot, Task or str
        What is to be identified; of a robot, or of the name or file of one, the model of the design, or the
        differential one.
    logs : Log, Simulation, path, or a sequence of them
    design : DesignedMotion, optional
        The design that was played: its model and joints are taken where they are not given.
    friction : FrictionCurves or path, optional
        Known beforehand, and subtracted; those that the design was made with if not given, unless friction is to be
        identified.
    recipe : Recipe, optional
        Every choice between the logs and the estimate.
    estimator : Estimator or str, optional
        Instead of the recipe's.
    mapping : LogMapping or path, optional
        How foreign files are laid out.
    drop : iterable of str
        Faulty rows of files to leave out, see `excite.logs.log_reading.read_log`.
    seed : int
        Of what is random later, such as repetitions; kept with the result.
    progress : callable
        Called with what is being done.
    **options
        Options of the recipe, and of the model of a `Task`, by name.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        Logs that do not fit, that are given twice, or too few equations; a design of another robot.
    """
    began, cpu = time.monotonic(), time.process_time()
    robot, task = robot_and_task(model)
    of_recipe = {name: options.pop(name) for name in list(options) if name in _RECIPE}
    if estimator is not None:
        of_recipe["estimator"] = estimator
    recipe = replace(recipe if recipe is not None else Recipe(), **of_recipe)
    if design is not None:
        check_design(robot, design)
        task = _as_designed(model, task, design)
        recipe = _with_period(recipe, design)
    task = task.changed(**options)
    curves, file = _known_friction(friction, design, task, robot)
    commanded = None if design is None else design.trajectory
    recipe.chosen_estimator().check(commanded)
    read = _logs(logs, robot, mapping, tuple(drop), progress)
    with threadpool_limits(1):  # on matrices of this size more threads only wait for each other
        result = estimate_parameters(robot, task, read, recipe, commanded=commanded, friction=curves, progress=progress)
    spent = time.monotonic() - began, time.process_time() - cpu
    return replace(
        result,
        friction_file=file,
        played=None if design is None else _played(design),
        provenance=_provenance(spent, mapping, tuple(drop), seed),
    )


def check_design(robot: Robot, design: DesignedMotion) -> None:
    """Raise `InputError` where a design is of another robot."""
    if design.robot.sha256() != robot.sha256():
        raise InputError(
            f"{design.name} is a design for {design.robot.name} (description {design.robot.sha256()[:12]}), "
            f"not for {robot.name} ({robot.sha256()[:12]})"
        )


def _as_designed(model: object, task: Task, design: DesignedMotion) -> Task:
    """The task with the design's model, where nothing but the robot was given; else with its joints."""
    chosen = design.task.model
    if isinstance(model, Task):
        return task
    if isinstance(model, RegressorModel):
        return task.changed(joints=chosen.joints, drives=chosen.drives)
    plain = replace(chosen, friction_curves=None)
    return task.changed(model=replace(plain, friction=chosen.friction, offset=chosen.offset))


def _with_period(recipe: Recipe, design: DesignedMotion) -> Recipe:
    """The recipe with the period of the design's motion, where it can use it and has none."""
    periodic = design.trajectory.family.name == "fourier"
    useful = recipe.average or (periodic and recipe.signals == "fourier")
    return replace(recipe, period=design.trajectory.duration) if useful and recipe.period is None else recipe


def _known_friction(
    given: FrictionCurves | str | Path | None, design: DesignedMotion | None, task: Task, robot: Robot
) -> tuple[FrictionCurves | None, Path | None]:
    """Friction curves that were named, or else those that the design was made with, and their file."""
    if given is not None:
        curves, file = (given, None) if isinstance(given, FrictionCurves) else (_read(given, robot), Path(given))
        return friction_of_moving(curves, robot, moving_robot(robot, task)), file
    made_for = None if design is None else design.task.known_friction
    if design is None or made_for is None or task.model.friction or task.model.channel != "effort":
        return None, None
    file = None if design.folder is None else design.folder / "design.json"
    return friction_of_moving(made_for, robot, moving_robot(robot, task)), file


def _read(path: str | Path, robot: Robot) -> FrictionCurves:
    curves: FrictionCurves = built_in("reader", "friction")(Path(path))
    try:
        curves.check(robot)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return curves


def _logs(
    given: LogLike | Sequence[LogLike],
    robot: Robot,
    mapping: LogMapping | str | Path | None,
    drop: tuple[str, ...],
    progress: Callable[[str], None],
) -> list[Log]:
    """Logs, each of its own content, with what is known to be true of simulated ones."""
    layout = read_mapping(Path(mapping)) if isinstance(mapping, str | Path) else mapping
    logs: dict[str, Log] = {}
    for one in given if isinstance(given, list | tuple) else (given,):
        if isinstance(one, str | Path):
            progress(f"reading {one}")
        log = log_of(one, robot, layout, drop)
        if log.sha256 in logs:
            raise InputError(f"{log.source} has the same content as {logs[log.sha256].source}: a log counts once")
        logs[log.sha256] = log
    return list(logs.values())


def log_of(given: LogLike, robot: Robot | None, mapping: LogMapping | None = None, drop: tuple[str, ...] = ()) -> Log:
    """A log with its hash, from itself, its file, or a simulation.

    Parameters
    ----------
    given : Log, path, or Simulation
    robot : Robot, optional
        That moved; what the file beside a log says is not looked at if not given.
    mapping : LogMapping, optional
    drop : tuple of str
        See `excite.logs.log_reading.read_log`.

    Raises
    ------
    InputError
        No log, or one of another robot.
    """
    if isinstance(given, str | Path):
        log = read_log(Path(given), None, mapping, drop)
        beside = None if robot is None else sidecar_of(given, robot)
        return log if beside is None else replace(log, truth=beside.get("truth"))
    measured = getattr(given, "measured", given)
    if not isinstance(measured, Log):
        raise InputError(f"expected a log, the name of its file, or a simulation; given {type(given).__name__}")
    return replace(measured, sha256=measured.identity)


def _played(design: DesignedMotion) -> Mapping[str, Any]:
    file = None if design.folder is None else design.folder / "design.json"
    return {
        "file": None if file is None else str(file),
        "sha256": None if file is None else sha256(file.read_bytes()).hexdigest(),
        "folder": None if design.folder is None else str(design.folder),
        "condition_number": design.condition_number,
    }


def _provenance(spent: tuple[float, float], mapping: object, drop: tuple[str, ...], seed: int) -> Mapping[str, Any]:
    wall, cpu = spent
    file = Path(mapping) if isinstance(mapping, str | Path) else None
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": seed,
        "mapping": None if file is None else {"file": str(file), "sha256": sha256(file.read_bytes()).hexdigest()},
        "drop": list(drop),
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "python": platform.python_version(),
        "versions": {package: version(package) for package in _PACKAGES},
    }
