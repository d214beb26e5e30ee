"""The way from what is asked for to the best motion: starts run, the best one is judged."""

from __future__ import annotations

import os
import platform
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from constraints.bounds.certificate import LimitUse, limit_uses
from constraints.bounds.enclosure import enclosed
from constraints.limit import Limit
from excite.design.approach import approach_and_return
from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.multistart import RUNNING, StartResult, read_starts
from excite.errors import NoFeasibleMotionError
from excite.information.metrics import measures, noise_per_row, predictions, singular_spectrum
from excite.information.weighting import known_with
from excite.registry import part
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.objective import Objective
from excite.tasks.output import Output
from excite.tasks.robot_of_task import check_robot, robot_and_task
from excite.tasks.search import Search
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.robot.robot import Robot

if TYPE_CHECKING:
    from excite.information.criteria import Criterion
    from excite.trajectories.family import Family

_PACKAGES = ("excite-trajectories", "casadi", "numpy", "scipy", "daqp", "ruckig")
Progress = Callable[[StartResult], None]


def design_trajectory(
    model: RegressorModel | Robot | Task | str,
    trajectory: Family | str | None = None,
    *,
    criterion: Criterion | Objective | str | None = None,
    constraints: Sequence[Limit | str] = (),
    limits: LimitChoice | None = None,
    search: Search | None = None,
    output: Output | None = None,
    folder: str | Path | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Design:
    """Find the motion that shows a model's parameters best, within the limits of its robot.

    Parameters
    ----------
    model : RegressorModel, Robot, Task or str
        What is to be identified; of a robot, or of the name or file of one, the differential model. A task says all of
        it.
    trajectory : Family or str, optional
        Family of motions; Fourier series if not given.
    criterion : Criterion, Objective or str, optional
        What is minimised; the condition number if not given.
    constraints : sequence of Limit or str
        Limits beside those of the robot's joints and drives, which always hold.
    limits : LimitChoice, optional
        Limits of joints that replace those of the description.
    search : Search, optional
        Starts, seed, solver, and where they run.
    output : Output, optional
        Sampling rate, way from home and back, rehearsals.
    folder : path, optional
        An existing folder where every start is kept as soon as it ends; a temporary one if not given.
    progress : callable, optional
        Called with each start's result.
    **options
        Further options of a `Task`, by name, such as ``joints=("1", "3")`` or ``noise=0.5``.

    Returns
    -------
    Design
        The best motion; after an interruption (Ctrl-C), the best so far.

    Raises
    ------
    InputError
        See `excite.design.formulation.formulate`; or a task for another robot.
    NoFeasibleMotionError
        The search ended without a motion inside the limits.
    KeyboardInterrupt
        Interrupted before any motion was found.
    """
    parts: dict[str, Any] = {"limits": limits, "search": search, "output": output}
    if isinstance(trajectory, Task):
        robot, task = _robot_and_task(model, trajectory)
    else:
        parts["trajectory"] = trajectory
        robot, task = robot_and_task(model)
    parts["objective" if isinstance(criterion, Objective) else "criterion"] = criterion
    given = {name: value for name, value in parts.items() if value is not None}
    task = task.changed(**given, **options)
    if constraints:
        task = task.changed(constraints=(*task.limits.constraints, *constraints))
    formulation = formulate(robot, task)
    if folder is not None:
        return solve(robot, formulation, Path(folder), progress)
    with tempfile.TemporaryDirectory() as temporary:
        return solve(robot, formulation, Path(temporary), progress)


def _robot_and_task(robot: Any, task: Task) -> tuple[Robot, Task]:
    """As this function was called before: with a robot, and a task that names it."""
    warnings.warn("design_trajectory(robot, task) is now design_trajectory(task)", DeprecationWarning, stacklevel=3)
    if not isinstance(robot, Robot):
        raise InputError(f"expected a robot beside the task, given {type(robot).__name__}")
    check_robot(robot, task)
    return robot, task


def solve(robot: Robot, made: Formulation, folder: Path, progress: Progress | None = None) -> Design:
    """Run the starts of a checked problem and certify the best motion; see `design_trajectory`."""
    began, cpu, date = time.monotonic(), _own_cpu(), datetime.now(UTC)
    interrupted = False
    done: list[StartResult] = []

    def report(result: StartResult) -> None:
        done.append(result)
        if progress is not None:
            progress(result)

    try:
        execute = part("executor", made.task.search.executor)
        execute(made, list(range(made.task.search.starts)), folder, report)
    except KeyboardInterrupt:
        interrupted = True
    results = read_starts(folder)
    if not results:
        raise KeyboardInterrupt
    pooled = sum(result.cpu for result in done) if made.task.search.executor != "serial" else 0.0
    provenance = _provenance(made, date, time.monotonic() - began, _own_cpu() - cpu + pooled)
    with threadpool_limits(1):
        return certify(robot, made, tuple(results), provenance, interrupted=interrupted)


def _own_cpu() -> float:
    return time.process_time()


def _provenance(made: Formulation, date: datetime, wall: float, cpu: float) -> dict[str, object]:
    return {
        "date": date.isoformat(timespec="seconds"),
        "seed": made.task.search.seed,
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "versions": {name: version(name) for name in _PACKAGES},
    }


def certify(
    robot: Robot,
    made: Formulation,
    results: tuple[StartResult, ...],
    provenance: dict[str, object],
    *,
    interrupted: bool = False,
) -> Design:
    """Judge the best start by the yardsticks and its limits over continuous time.

    Parameters
    ----------
    robot : Robot
    made : Formulation
    results : tuple of StartResult
        At least one.
    provenance : dict
    interrupted : bool

    Raises
    ------
    NoFeasibleMotionError
        No start ended inside the limits.
    """
    broken: list[LimitUse] = []
    for result in sorted(results, key=lambda r: (r.value, r.index)):
        trajectory = made.problem.information.trajectory(result.coefficients)
        uses = limits_of(made, trajectory)
        if all(use.holds for use in uses):
            break
        broken.append(max(uses, key=lambda use: use.use))
    else:
        raise NoFeasibleMotionError(_closest(broken))
    if not np.isfinite(result.value):
        raise NoFeasibleMotionError(
            "no start found a motion within the limits that shows every parameter: they leave too little room to move"
        )
    samples = trajectory.samples(made.target.model.times(made.task.trajectory.period, made.task.output.rate))
    noise = noise_per_row(made.task.objective.noise, made.target.model)
    ends = trajectory.samples(np.array([0.0, trajectory.duration])).q
    ways = approach_and_return(robot, made.task, made.target.robot.joint_names, ends, made.way_limits)
    notes = (*made.notes, *(ways.notes if ways is not None else ()))
    if interrupted:
        ended = sum(r.status != RUNNING for r in results)
        notes = (*notes, f"interrupted: best of {ended} finished and {len(results) - ended} unfinished starts")
    return Design(
        robot=robot,
        task=made.task,
        target=made.target,
        trajectory=trajectory,
        criteria=measures(made.target, samples, noise),
        limits=uses,
        predicted=predictions(made.target, samples, noise),
        prior=known_with(made.target, made.task, samples),
        spectrum=singular_spectrum(made.target, samples),
        rows=made.target.model.assemble(samples).shape[0],
        starts=results,
        best_start=result.index,
        provenance=provenance,
        notes=notes,
        interrupted=interrupted,
        ways=ways,
        nonlinear=made.nonlinear,
    )


def _closest(broken: list[LimitUse]) -> str:
    """What the least bad of several motions breaks: the limit, when, and by how much."""
    use = min(broken, key=lambda use: use.use)
    beyond = f"{-use.margin:.2g} {use.unit} beyond {use.bound:.4g} {use.unit}"
    return (
        "no start ended with a motion that keeps every limit over continuous time; "
        f"the closest one breaks {use.label} at {use.time:.3f} s: {use.extreme:.4g} {use.unit}, {beyond}"
    )


def limits_of(made: Formulation, trajectory: Trajectory) -> tuple[LimitUse, ...]:
    """Certificate of every limit for a motion: exact extrema of linear ones, enclosures of the others."""
    linear = tuple(use for limit in made.limits for use in limit_uses(limit, trajectory.extrema(limit)))
    if not made.nonlinear:
        return linear
    found = [enclosed(limit, trajectory.samples, trajectory.duration, trajectory.jerk) for limit in made.nonlinear]
    return (*linear, *(use for limit, part in zip(made.nonlinear, found, strict=True) for use in part.uses(limit)))
