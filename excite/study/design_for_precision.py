"""The shortest experiment that meets a precision: its period, its motion and the number of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.interruption import signal_answered
from excite.design.optimisation import Progress, search_folder, solve
from excite.design.problem import Problem
from excite.design.starts import KeptStarts, keep_starts
from excite.information.matrix import noise_per_row
from excite.information.precision_forecast import (
    OutOfReach,
    ParameterPrecision,
    PrecisionForecast,
    PrecisionSearch,
    RunInformation,
    SeparationTrial,
    TooWide,
)
from excite.information.target import inverse_half, target_of
from excite.information.weighting import weighting_of
from excite.optimality.sensitivity import best_of, loosened, reformulated, same_motion
from excite.registry import name_of
from excite.study.period_search import PeriodSearch, pareto_front, tried_period
from excite.study.servo_precision import rehearsed
from excite.tasks.installation import Installation
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.robot_of_task import installed_robot, one_model, task_of
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.numerical import one_thread
from regressors.robot.robot import Robot
from regressors.samples import Array

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
    one_model(robot_or_model, options)
    task = task_of(robot_or_model).changed(**options, **({} if precision is None else {"precision": precision}))
    robot = installed_robot(task)
    with search_folder(folder) as place:

        def prepared(formulation: Formulation, name: str) -> KeptStarts:
            (place / name).mkdir(parents=True, exist_ok=True)
            return keep_starts(place / name, formulation, fresh=fresh)

        return search_for_precision(
            robot, task, prepared, lambda made, kept: solve(robot, made, kept, progress), report
        )


def search_for_precision(
    robot: Robot, task: Task, prepare: Prepare, solve: Solve, report: Callable[[str], None] = lambda _: None
) -> Design:
    """Search for the period, then for the best motion at it; see `design_for_precision`.

    Of servos, the motion is searched at the task's period, and its runs are rehearsed.
    """
    if task.model.channel == "command" and isinstance(task.objective.precision, PrecisionTarget):
        formulation = formulate(robot, task)
        design = solve(formulation, prepare(formulation, "servos"))
        return design if design.interrupted else rehearsed(design, task.objective.precision, report)
    task = with_offsets(precise_task(task))
    weighting_of(target_of(robot, task), task)  # what no period can change is refused before any is tried

    def solved(formulation: Formulation, name: str) -> Design:
        period = formulation.task.trajectory.period
        return solve(formulation, prepare(formulation, f"{period:g}s-{name}"))

    search = PeriodSearch(task, lambda at_period: formulate(robot, at_period), solved, report)
    trial, most, obstacles = search.run(), task.objective.max_time, None
    best, run = trial.design, trial.run
    forecast = run.forecast(most)
    if not search.interrupted:
        try:
            obstacles = out_of_reach(best, run, forecast, report)
        except KeyboardInterrupt:
            signal_answered()
            search.interrupted = True
    found = PrecisionSearch(
        asked=run.precision.to_dict(),
        noise=tuple(noise_per_row(task.objective.noise, best.target.model).tolist()),
        max_time=most,
        period=best.task.trajectory.period,
        forecast=forecast,
        trials=tuple(tried_period(each, max(most, forecast.robot_seconds)) for each in search.trials),
        front=pareto_front(search.trials, most),
        out_of_reach=obstacles,
    )
    return replace(
        best,
        interrupted=search.interrupted,
        provenance={**best.provenance, "cpu_seconds": search.seconds},
        precision_search=found,
    )


def with_offsets(task: Task) -> Task:
    """With an offset of every drive among the parameters, which a motion must show lest it hide in others."""
    unsettled = task.model.channel == "effort" and task.model.offset is False
    return task.changed(offset=True) if unsettled else task


def precise_task(task: Task) -> Task:
    """The task whose criterion is the largest half-width over its allowed one."""
    if task.objective.precision is None:
        raise InputError("no precision is asked for; give `precision`, such as 0.05")
    if task.model.channel == "command":
        raise InputError(
            "precision: the intervals of servos follow from their simulated response, not from what is in hand; "
            "`design_for_precision` rehearses them"
        )
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


_WIDER = 1.5  # limits
_LOAD = (2.0, 0.0, 0.0, 0.05)  # mass [kg] and centre [m] in the frame of the last link
_TOGETHER = 0.7  # correlation from which two parameters count as moving together
_PARTNERS = 3


def out_of_reach(
    design: Design, run: RunInformation, forecast: PrecisionForecast, report: Callable[[str], None]
) -> OutOfReach | None:
    """Say which parameters stay too uncertain, what they move with, and what separates them; None if none does."""
    if not (wide := forecast.too_wide):
        return None
    needed = run.fewest_runs() * run.seconds
    with one_thread(), np.errstate(all="ignore"):
        narrower = [*_changes(design, report), (_LOAD_NAME, _with_load(design, run))]
    trials = [SeparationTrial(change, factor, needed / factor**2) for change, factor in narrower]
    trials.sort(key=lambda trial: -trial.narrower)
    return OutOfReach(tuple(_too_wide(run, parameter) for parameter in wide), needed, tuple(trials))


_LOAD_NAME = f"a known load of {_LOAD[0]:g} kg in every other run"


def _too_wide(run: RunInformation, parameter: ParameterPrecision) -> TooWide:
    names = run.target.base.names
    assert parameter.allowed is not None
    if parameter.name not in names:  # the torque of a joint
        return TooWide(parameter.name, parameter.unit, parameter.half_width, parameter.allowed, ())
    k = names.index(parameter.name)
    unit = run.half / np.linalg.norm(run.half, axis=1)[:, None]
    correlation = unit @ unit[k]
    order = [int(j) for j in np.argsort(-np.abs(correlation)) if j != k and abs(correlation[j]) >= _TOGETHER]
    together = tuple((names[j], float(correlation[j])) for j in order[:_PARTNERS])
    return TooWide(parameter.name, parameter.unit, parameter.half_width, parameter.allowed, together)


def _changes(design: Design, report: Callable[[str], None]) -> Iterator[tuple[str, float]]:
    """Each change of limits and of the highest frequency, and how many times narrower the widest half-width becomes."""
    formulation, solver, x = reformulated(design)
    problem = formulation.problem
    report("trying what separates the parameters: the same problem once more")
    x, value = best_of(problem, solver, x, problem.exact_value(x))
    for quantity in ("velocity", "acceleration", "position"):
        changed = _with_wider(problem, quantity)
        if changed is not None:
            report(f"trying what separates the parameters: {quantity} limits {_WIDER:g} times as wide")
            yield f"{quantity} limits {_WIDER:g} times as wide", value / best_of(changed, solver, x, value)[1]
    if (faster := _faster(formulation, problem, x)) is not None:
        report("trying what separates the parameters: twice the highest frequency")
        yield "twice the highest frequency", value / best_of(faster[0], solver, faster[1], value)[1]


def _with_wider(problem: Problem, quantity: str) -> Problem | None:
    """The problem with wider ranges of one quantity of all joints and drives; None if it is not limited."""
    constraints = [limit.function.constraint for limit in problem.limits.linear]
    labels = {label for each in constraints if each.quantity == quantity for label in each.labels}
    linear = tuple(loosened(limit, labels, _WIDER) for limit in problem.limits.linear)
    return replace(problem, limits=replace(problem.limits, linear=linear)) if labels else None


def _faster(formulation: Formulation, problem: Problem, x: Array) -> tuple[Problem, Array] | None:
    """The problem with twice the harmonics, and the same motion in it; None where the family has it not."""
    task = formulation.task
    option, count = task.trajectory.richness
    try:
        changed = task.changed(**{option: 2 * count})
        richer = replace(formulation.blueprint, task=changed).problem(formulation.nonlinear, formulation.stated)
    except InputError:
        return None
    start = same_motion(problem, x, richer)
    return None if start is None else (richer, start)


def _with_load(design: Design, run: RunInformation) -> float:
    """How many times narrower the widest half-width becomes where every other run carries a load that is known.

    The torque of a known load is subtracted, so that the parameters keep their columns; only friction that depends on
    what a drive carries sees it.
    """
    robot = Installation(payload=_LOAD).applied(design.robot)
    target = target_of(robot, design.task)
    columns = [name for name in run.target.base.names if name in target.model.names]
    if len(columns) < len(run.target.base.names):
        return 1.0
    task = design.task
    samples = design.trajectory.samples(target.model.times(task.trajectory.period, task.output.rate))
    noise = formulate(design.robot, task).blueprint.noise
    places = [target.model.names.index(name) for name in columns]
    loaded, own = (
        m.assemble(samples)[:, k] for m, k in ((target.model, places), (run.target.model, run.target.base.index))
    )
    each = np.tile(noise, own.shape[0] // noise.size)[:, None]
    half = inverse_half(np.vstack([loaded / each, own / each]) / np.sqrt(2.0))
    return float(replace(run, half=inverse_half(own / each)).use(1) / replace(run, half=half).use(1))
