"""Design of a motion: rounds of starts are optimised, and the best is certified."""

from __future__ import annotations

import os
import platform
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from constraints.nonlinear import Limit
from excite.design.blueprint import TYPICAL_STARTS, search_seconds
from excite.design.certification import certify
from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.interruption import current_interruption
from excite.design.kept_starts import KeptStarts, keep_starts
from excite.design.search_rounds import Rounds, RunningRounds, design_with_harmonics
from excite.design.start_results import StartResult, best_starts
from excite.design.task_checks import suspecting
from excite.errors import NoFeasibleMotionError
from excite.registry import part
from excite.storage.atomic import Destination
from excite.storage.lock import locked
from excite.storage.work_prediction import announce
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.objective import Objective
from excite.tasks.robot_of_task import check_robot, first_argument, robot_and_task
from excite.tasks.search import Output, Search
from excite.tasks.task import Task
from excite.tasks.trajectory_choice import TrajectoryChoice
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.numerical import numerical_work
from regressors.robot.robot import Robot
from regressors.robot.symbolic.vectorised import evaluation, interpreted_note

if TYPE_CHECKING:
    from excite.tasks.criteria import Criterion
    from excite.trajectories.family import Family

_PACKAGES = ("excite-trajectories", "casadi", "numpy", "scipy", "daqp", "ruckig")
Progress = Callable[[StartResult], None]
_ENDED = "Ctrl-C ends it, and the best so far is saved"
_NONE = "no start has a result: the process of each ended unexpectedly; try fewer `workers`"


@checked
def design_trajectory(
    robot_or_model: RegressorModel | Robot | Task | str | None = None,
    /,
    trajectory: Family | TrajectoryChoice | Task | str | None = None,
    *,
    criterion: Criterion | Objective | str | None = None,
    constraints: Sequence[Limit | str] = (),
    limits: LimitChoice | None = None,
    search: Search | None = None,
    output: Output | None = None,
    folder: str | Path | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Design:
    """Find the motion that identifies a model's parameters best, within the limits of its robot.

    Parameters
    ----------
    robot_or_model : RegressorModel, Robot, Task or str
        Model to identify; the differential model where a robot, or its name or file, is given, unless ``model`` names
        another one. A task contains all options.
    trajectory : Family, TrajectoryChoice or str, optional
        Family of motions; Fourier series if not given.
    criterion : Criterion, Objective or str, optional
        Criterion to minimise; the condition number if not given.
    constraints : sequence of Limit or str
        Limits beside those of the robot's joints and drives, which always hold.
    limits : LimitChoice, optional
        Limits of joints that replace those of the description.
    search : Search, optional
        Starts, seed, solver, and where they run.
    output : Output, optional
        Sampling rate, approach from home and return, rehearsals.
    folder : path, optional
        An existing folder where every start is kept as soon as it ends; a temporary one if not given. Starts of the
        same problem that an earlier call has finished there are not computed again.
    fresh : bool
        Remove the starts in that folder instead.
    progress : callable, optional
        Called with each start's result.
    **options
        Further options of a `Task`, by name, such as ``model="energy"``, ``joints=("1", "3")`` or ``noise=0.5``.

    Returns
    -------
    Design
        The best motion; after an interruption (Ctrl-C), the best so far.

    Raises
    ------
    InputError
        See `excite.design.formulation.formulate`; or the task is for another robot, or the folder holds starts of
        another problem.
    excite.errors.NoFeasibleMotionError
        The search ended without a motion inside the limits.
    excite.errors.LostWorkersError
        Worker processes end again and again; the same call continues from the finished starts.
    KeyboardInterrupt
        Interrupted before any motion was found.
    """
    subject = first_argument(robot_or_model, options, "design_trajectory")
    parts: dict[str, Any] = {"limits": limits, "search": search, "output": output}
    if isinstance(trajectory, Task):
        robot, task = _robot_and_task(subject, trajectory)
    else:
        parts["trajectory"] = trajectory
        robot, task = robot_and_task(subject)
    parts["objective" if isinstance(criterion, Objective) else "criterion"] = criterion
    given = {name: value for name, value in parts.items() if value is not None}
    task = task.changed(**given, **options)
    if constraints:
        task = task.changed(constraints=(*task.limits.constraints, *constraints))
    if folder is not None:
        with locked(Destination(Path(folder))):
            return _design(robot, task, Path(folder), progress, fresh=fresh)
    with tempfile.TemporaryDirectory() as temporary:
        return _design(robot, task, Path(temporary), progress, fresh=fresh)


def _design(robot: Robot, task: Task, folder: Path, progress: Progress | None, *, fresh: bool) -> Design:
    """Search in a folder, for the number of harmonics too where the task leaves it open."""

    def prepared(formulation: Formulation, other: bool = False) -> KeptStarts:
        return keep_starts(folder, formulation, fresh=fresh or other)

    if task.trajectory.grows:
        return design_with_harmonics(robot, task, prepared, lambda made, kept: solve(robot, made, kept, progress))
    formulation = formulate(robot, task)
    kept = prepared(formulation)
    announce_search(formulation, kept)
    return solve(robot, formulation, kept, progress)


def announce_search(formulation: Formulation, kept: KeptStarts) -> None:
    """Say how long the starts that are left will take, where that is long."""
    announce("the search", search_seconds(formulation.target, formulation.task, starts_left(kept)), _ENDED)


def starts_left(kept: KeptStarts) -> int:
    """Number of starts that are left, as far as it is known."""
    return max((TYPICAL_STARTS if kept.count is None else kept.count) - len(kept.done), 0)


def _robot_and_task(robot: Any, task: Task) -> tuple[Robot, Task]:
    """Accept the deprecated call with a robot, and a task that names it."""
    warnings.warn("design_trajectory(robot, task) is now design_trajectory(task)", DeprecationWarning, stacklevel=4)
    if not isinstance(robot, Robot):
        raise InputError(f"expected a robot beside the task, given {type(robot).__name__}")
    check_robot(robot, task)
    return robot, task


@numerical_work(
    "the design",
    "values of very different sizes are the likely cause: "
    "check `period`, `noise`, `prior` and the limits of the joints",
)
def solve(
    robot: Robot,
    formulation: Formulation,
    starts: KeptStarts | Path,
    progress: Progress | None = None,
    at_end: Callable[[], None] = lambda: None,
) -> Design:
    """Run the starts of a checked problem that are left, and certify the best motion; see `design_trajectory`."""
    kept = starts if isinstance(starts, KeptStarts) else keep_starts(starts, formulation)
    began, date = time.monotonic(), datetime.now(UTC)
    interrupted, search = False, formulation.task.search
    rounds = Rounds(search)
    running = RunningRounds(rounds, kept, progress, in_processes=search.executor != "serial")
    try:
        execute = part("executor", search.executor)
        following = iter(running)
        if (first := next(following, None)) is not None:
            execute(formulation, chain([first], following), kept.folder, running.report)
        at_end()
    except KeyboardInterrupt:
        interrupted = True
        if (answered := current_interruption()) is not None:
            answered.caught()
    results = best_starts(kept.folder, rounds.planned)
    if not results.best:
        raise KeyboardInterrupt if interrupted else NoFeasibleMotionError(_NONE)
    provenance = _provenance(formulation, date, time.monotonic() - began, running.spent)
    formulation = replace(formulation, task=_with_rounds(formulation.task, rounds, interrupted=interrupted))
    with threadpool_limits(1), suspecting(robot):
        design = certify(robot, formulation, results, provenance, interrupted=interrupted)
    return replace(design, search=rounds.summary, notes=(*design.notes, *interpreted_note()))


def _with_rounds(task: Task, rounds: Rounds, *, interrupted: bool) -> Task:
    """The task with the rounds that a budget was enough for, so that it gives the same motion again."""
    if task.search.budget is None or interrupted:
        return task
    return task.changed(search=replace(task.search, budget=None, rounds=rounds.count))


def _provenance(formulation: Formulation, date: datetime, wall: float, cpu: float) -> dict[str, object]:
    return {
        "date": date.isoformat(timespec="seconds"),
        "seed": formulation.task.search.seed,
        "problem": formulation.identity.sha256,
        "run": formulation.identity.run,
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "evaluation": evaluation(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "versions": {name: version(name) for name in _PACKAGES},
    }
