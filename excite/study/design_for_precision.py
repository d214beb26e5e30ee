"""The shortest experiment that meets a precision: its period, its motion and the number of runs."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.kept_starts import KeptStarts, keep_starts
from excite.design.optimisation import Progress, solve
from excite.information.target import target_of
from excite.information.weighting import weighting_of
from excite.registry import name_of
from excite.storage.atomic import Destination
from excite.storage.lock import locked
from excite.study.out_of_reach import OutOfReach, out_of_reach
from excite.study.period_search import PeriodSearch, PrecisionSearch, pareto_front
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.robot_of_task import first_argument, robot_and_task
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.robot.robot import Robot

Prepare = Callable[[Formulation, str], KeptStarts]
Solve = Callable[[Formulation, KeptStarts], Design]


@checked
def design_for_precision(
    robot_or_model: RegressorModel | Robot | Task | str,
    /,
    precision: float | str | PrecisionTarget | Mapping[str, Any] | None = None,
    *,
    folder: str | Path | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> Design:
    """Find the shortest experiment after which the parameters are known as precisely as asked for.

    The robot time is that of the runs of one motion, with approach and return where the task has a home. At each period
    of a ladder the largest half-width over its allowed one is minimised; information adds, so that one search gives the
    number of runs. The best period is then searched as `design_trajectory` does, from the motion found there.

    Parameters
    ----------
    robot_or_model : RegressorModel, Robot, Task or str
        See `excite.design_trajectory`.
    precision : float, str or PrecisionTarget
        Half-width of every parameter's 99 % interval as a share of its described value, such as 0.05 or ``"5%"``, or a
        target; that of the task if not given.
    folder : path, optional
        An existing folder where every start is kept as soon as it ends, so that the same call continues; a temporary
        one if not given.
    fresh : bool
        Remove what an earlier call has left there instead.
    progress : callable, optional
        Called with each start's result.
    report : callable, optional
        Called with a sentence on each period.
    **options
        Options of a `Task`, by name, such as ``noise=0.5``, ``max_time=300.0`` or ``home="robot"``. `period` and
        `harmonics` state the highest frequency of the motion, which stays.

    Returns
    -------
    Design
        `Design.precision` states the runs and every half-width, and whether the target is met within `max_time`;
        `Design.precision_search` the periods that were tried, and the front of robot time against precision.

    Raises
    ------
    InputError
        See `excite.design_trajectory`; or no precision, or another criterion.
    excite.errors.NoFeasibleMotionError
        No period has a motion within the limits.
    KeyboardInterrupt
        Interrupted before any motion was found.
    """
    subject = first_argument(robot_or_model, options, "design_for_precision")
    robot, task = robot_and_task(subject)
    task = task.changed(**options, **({} if precision is None else {"precision": precision}))
    with ExitStack() as stack:
        if folder is None:
            place = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        else:
            place = Path(folder)
            stack.enter_context(locked(Destination(place)))

        def prepared(formulation: Formulation, name: str) -> KeptStarts:
            (place / name).mkdir(parents=True, exist_ok=True)
            return keep_starts(place / name, formulation, fresh=fresh)

        return search_for_precision(
            robot, task, prepared, lambda made, kept: solve(robot, made, kept, progress), report
        )


def search_for_precision(
    robot: Robot, task: Task, prepare: Prepare, solve: Solve, report: Callable[[str], None] = lambda _: None
) -> Design:
    """Search for the period, then for the best motion at it; see `design_for_precision`."""
    task = precise_task(task)
    weighting_of(target_of(robot, task), task)  # what no period can change is refused before any is tried

    def solved(formulation: Formulation, name: str) -> Design:
        period = formulation.task.trajectory.period
        return solve(formulation, prepare(formulation, f"{period:g}s-{name}"))

    search = PeriodSearch(task, lambda at_period: formulate(robot, at_period), solved, report)
    best = search.run().design
    front = pareto_front(search.trials, task.objective.max_time)
    return replace(
        best,
        interrupted=search.interrupted,
        provenance={**best.provenance, "cpu_seconds": search.seconds},
        precision_search=PrecisionSearch(tuple(search.trials), front, _obstacles(best, search, report)),
    )


def _obstacles(best: Design, search: PeriodSearch, report: Callable[[str], None]) -> OutOfReach | None:
    """What keeps the target out of reach; None where it is met, or where there is no time to try."""
    if search.interrupted:
        return None
    try:
        return out_of_reach(best, report)
    except KeyboardInterrupt:
        search.interrupted = True
        return None


def precise_task(task: Task) -> Task:
    """The task whose criterion is the largest half-width over its allowed one."""
    if task.objective.precision is None:
        raise InputError("no precision is asked for; give `precision`, such as 0.05")
    asked = task.objective.precision
    along = isinstance(asked, PrecisionTarget) and asked.torques is not None
    own, given = "trace" if along else "max-deviation", name_of(task.objective.criterion)
    if given not in ("condition", own):
        raise InputError(
            f"criterion {given}: the shortest experiment that meets this precision minimises {own} in units of what is "
            "allowed; leave out the criterion"
        )
    if task.trajectory.grows:
        raise InputError(
            "harmonics: the search for a precision tries periods, with as many harmonics as keep the highest "
            "frequency; give a number of `harmonics`"
        )
    return task.changed(criterion=own, scale="precision")
