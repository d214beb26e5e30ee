"""Design of a motion: rounds of starts are optimised, and the best is certified."""

from __future__ import annotations

import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from constraints.certificate import LimitUse
from constraints.enclosure import uses_of
from constraints.nonlinear import Limit
from excite.design.approach import approach_and_return
from excite.design.blueprint import TYPICAL_STARTS, search_seconds
from excite.design.design import Design
from excite.design.formulation import LIKELY_CAUSE, Formulation, formulate
from excite.design.initial_guesses import best_random_value
from excite.design.interruption import signal_answered
from excite.design.problem import Problem
from excite.design.search_rounds import COMBINED, Rounds, RunningRounds, design_with_harmonics
from excite.design.start_results import BestStarts, Progress as Progress, StartResult, best_starts
from excite.design.starts import KeptStarts, keep_starts
from excite.design.task_checks import suspecting, unidentifiable
from excite.errors import NoFeasibleMotionError
from excite.information.matrix import MotionMeasures, noise_per_row
from excite.information.nearly_unidentifiable import (
    hardly_excited_note,
    nearly_unidentifiable,
    nearly_unidentifiable_note,
    slow_motion_note,
)
from excite.information.weighting import known_with
from excite.registry import part
from excite.storage.atomic import Destination
from excite.storage.commit import locked
from excite.tasks.criteria import Criterion
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.objective import Objective
from excite.tasks.robot_of_task import installed_robot, one_model, task_of
from excite.tasks.search import Output, Search
from excite.tasks.task import Task
from excite.tasks.trajectory_choice import TrajectoryChoice
from excite.trajectories import Trajectory
from excite.trajectories.family import Family
from regressors.arguments import checked
from regressors.models.model import RegressorModel
from regressors.numerical import numerical_work, one_thread, or_none
from regressors.robot.robot import Robot
from regressors.robot.symbolic.vectorised import evaluation, interpreted_note
from regressors.samples import Array
from regressors.work_prediction import announce

_PACKAGES = ("excite-trajectories", "casadi", "numpy", "scipy", "daqp", "ruckig")
_TIME = 19.6  # typical processor time of a search whose rounds are not stated [s]
_ENDED = "Ctrl-C ends it, and the best so far is saved"
_NONE = "no start has a result: the process of each ended unexpectedly; try fewer `workers`"


@checked
def design_trajectory(
    robot_or_model: RegressorModel | Robot | Task | str,
    /,
    trajectory: Family | TrajectoryChoice | str | None = None,
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
    one_model(robot_or_model, options)
    parts: dict[str, Any] = {"trajectory": trajectory, "limits": limits, "search": search, "output": output}
    parts["objective" if isinstance(criterion, Objective) else "criterion"] = criterion
    given = {name: value for name, value in parts.items() if value is not None}
    task = task_of(robot_or_model).changed(**given, **options)
    if constraints:
        task = task.changed(constraints=(*task.limits.constraints, *constraints))
    with search_folder(folder) as place:
        return _design(installed_robot(task), task, place, progress, fresh=fresh)


@contextmanager
def search_folder(folder: str | Path | None) -> Iterator[Path]:
    """The folder where a search keeps its starts, locked; a temporary one if none is given."""
    if folder is None:
        with tempfile.TemporaryDirectory() as temporary:
            yield Path(temporary)
    else:
        with locked(Destination(Path(folder))):
            yield Path(folder)


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
    search, starts = formulation.task.search, starts_left(kept)
    if search.adaptive and search.rounds is not None:
        starts = max(search.first + COMBINED * search.rounds + 1 - len(kept.done), 0)
    seconds = search_seconds(formulation.target, formulation.task, starts)
    if kept.count is None and search.rounds is None:
        seconds = _TIME if search.budget is None else search.budget
    announce("the search", seconds, _ENDED)


def starts_left(kept: KeptStarts) -> int:
    """Number of starts that are left, as far as it is known."""
    return max((TYPICAL_STARTS if kept.count is None else kept.count) - len(kept.done), 0)


@numerical_work("the design", LIKELY_CAUSE)
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
    rounds = Rounds(search, _TIME / formulation.problem.seconds)
    running = RunningRounds(rounds, kept, progress, in_processes=search.executor != "serial")
    try:
        execute = part("executor", search.executor)
        following = iter(running)
        if (first := next(following, None)) is not None:
            execute(formulation, chain([first], following), kept.folder, running.report)
        at_end()
    except KeyboardInterrupt:
        interrupted = True
        signal_answered()
    results = best_starts(kept.folder, rounds.planned)
    if not results.best:
        raise KeyboardInterrupt if interrupted else NoFeasibleMotionError(_NONE)
    provenance = {
        "date": date.isoformat(timespec="seconds"),
        "seed": formulation.task.search.seed,
        "problem": formulation.identity.sha256,
        "run": formulation.identity.run,
        "wall_seconds": time.monotonic() - began,
        "cpu_seconds": running.spent,
        "evaluation": evaluation(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "versions": {name: version(name) for name in _PACKAGES},
    }
    if search.budget is not None and not interrupted:  # with the rounds that it was enough for, it gives the same again
        stated = None if search.starts is None else rounds.first
        task = formulation.task.changed(search=replace(search, budget=None, starts=stated, rounds=rounds.count))
        formulation = replace(formulation, task=task)
    with one_thread(), suspecting(robot):
        design = certify(robot, formulation, results, provenance, interrupted=interrupted)
        random = or_none(best_random_value(formulation.problem, search.seed))
    return replace(design, search=replace(rounds.summary, random=random), notes=(*design.notes, *interpreted_note()))


_INSTANTS = 257  # at which the middle of each joint's range is looked for
_SAME = 1e-9  # of the largest number in the equations


def certify(
    robot: Robot,
    formulation: Formulation,
    starts: BestStarts,
    provenance: dict[str, object],
    *,
    interrupted: bool = False,
) -> Design:
    """Evaluate the best start: its metrics, and its limits over continuous time."""
    task, target = formulation.task, formulation.target
    broken: list[LimitUse] = []
    ranked = sorted(starts.best, key=lambda r: (r.value, r.index))
    for result in chain(ranked, _smaller(formulation.problem, ranked)):
        trajectory = formulation.problem.information.trajectory(result.coefficients)
        uses = limits_of(formulation, trajectory)
        if all(use.holds for use in uses):
            break
        broken.append(max(uses, key=lambda use: use.use))
    else:
        raise NoFeasibleMotionError(_closest(broken))
    trajectory, uses = _unwound(robot, formulation, result.coefficients, uses)
    if not np.isfinite(result.value):
        raise NoFeasibleMotionError(unidentifiable(uses))
    samples = trajectory.samples(target.model.times(task.trajectory.period, task.output.rate))
    noise = noise_per_row(task.objective.noise, target.model)
    ends = trajectory.samples(np.array([0.0, trajectory.duration])).q
    transfers = approach_and_return(robot, task, target.robot.joint_names, ends, formulation.transfer_limits)
    hardly = nearly_unidentifiable(target, samples, noise)
    used = {use.quantity: use.use for use in sorted(uses, key=lambda use: use.use)}  # the largest of each
    notes = (
        nearly_unidentifiable_note(hardly, target, task.objective),
        hardly_excited_note(target, samples, task.objective.noise),
        *formulation.notes,
        *(transfers.notes if transfers is not None else ()),
        slow_motion_note(target, samples, used, task.trajectory.period),
        starts.note(interrupted=interrupted),
    )
    return Design(
        robot=robot,
        task=task,
        trajectory=trajectory,
        certified=uses,
        measured=MotionMeasures.of(target, samples, noise),
        minimised_value=result.value,
        noise=tuple(noise.tolist()),
        equations=tuple(target.model.row_labels),
        gap=or_none(target.base.gap),
        prior=known_with(target, task, samples),
        results=starts.best,
        further_starts=starts.further,
        best_start=result.index,
        provenance=provenance,
        notes=tuple(filter(None, notes)),
        interrupted=interrupted,
        approach_and_return=transfers,
        formulated=(target, (*formulation.nonlinear, *formulation.stated)),
        unchecked=formulation.unchecked,
        nearly_unidentifiable=hardly,
        shape=formulation.blueprint.world.world,
    )


_SIZES = 0.999, 0.99


def _smaller(problem: Problem, results: Sequence[StartResult]) -> Iterator[StartResult]:
    """Motions a little nearer to rest, for limits that all break between the instants of the search."""
    for size in _SIZES:
        for result in results:
            x = problem.drawn(result.coefficients, size)
            yield replace(result, x=x.tolist(), value=problem.exact_value(x))


def _unwound(
    robot: Robot, formulation: Formulation, x: Array, uses: tuple[LimitUse, ...]
) -> tuple[Trajectory, tuple[LimitUse, ...]]:
    """The motion without whole turns for nothing, nearer to home or to zero, with its certificate.

    A revolute joint that is a coordinate of its own turns by the whole turns that bring the middle of its range nearest
    to there, within its limits. What is not the same after whole turns, such as a ball screw's ratio or a drive's
    position, shows in the equations or in the certificate: then the motion stays as it was found.
    """
    target, problem = formulation.target, formulation.problem
    if not target.motion.straight:
        return problem.information.trajectory(x), uses
    trajectory, N = problem.information.trajectory(x), target.motion.matrix
    joint = np.argmax(np.abs(N), axis=0)  # of each coordinate
    alone = (np.count_nonzero(N, axis=0) == 1) & (np.count_nonzero(N[joint], axis=1) == 1) & (N.max(axis=0) == 1.0)
    turning = alone & np.array([target.robot.joints[k].kind == "revolute" for k in joint])
    q = trajectory.samples(np.linspace(0.0, trajectory.duration, _INSTANTS)).q[:, joint]
    low, high = q.min(axis=0), q.max(axis=0)
    stated = formulation.task.output.home
    home = robot.home if isinstance(stated, str) else stated
    known = dict.fromkeys(robot.joint_names, 0.0) if home is None else dict(zip(robot.joint_names, home, strict=True))
    near = np.array([known[target.robot.joint_names[k]] for k in joint])
    turns = 2 * np.pi * np.round(((low + high) / 2 - near) / (2 * np.pi))
    limits = target.robot.limits
    within = (low - turns >= limits.lower[joint]) & (high - turns <= limits.upper[joint])
    turns = np.where(turning & within, turns, 0.0)
    if not np.any(turns):
        return trajectory, uses
    moved = problem.information.trajectory(problem.family.moved(x, -turns))
    time = target.model.times(formulation.task.trajectory.period, formulation.task.output.rate)
    samples = trajectory.samples(time)  # of the same velocities, whose signs rounding might change
    before, after = (target.model.assemble(each) for each in (samples, replace(samples, q=samples.q - N @ turns)))
    if not np.allclose(before, after, rtol=0.0, atol=_SAME * float(np.abs(before).max())):
        return trajectory, uses
    certificate = limits_of(formulation, moved)
    return (moved, certificate) if all(use.holds for use in certificate) else (trajectory, uses)


def _closest(broken: list[LimitUse]) -> str:
    """Message on the motion that is closest to feasible: which limit it violates, when, by how much."""
    use = min(broken, key=lambda use: use.use)
    if use.quantity == "loops":
        return (
            "no start ended with a motion that keeps every limit over continuous time; the closest motion has no "
            f"proven {use.label}, near which they do not follow the others; give narrower limits of positions, or "
            "lower velocities"
        )
    beyond = f"{-use.margin:.2g} {use.unit} beyond {use.bound:.4g} {use.unit}"
    return (
        "no start ended with a motion that keeps every limit over continuous time; "
        f"the closest motion exceeds {use.label} at {use.time:.3f} s: {use.extreme:.4g} {use.unit}, {beyond}"
    )


def limits_of(formulation: Formulation, trajectory: Trajectory) -> tuple[LimitUse, ...]:
    """Certificate of every limit for a motion: exact extrema of linear ones, enclosures of the others."""
    nonlinear = (*formulation.nonlinear, *formulation.stated)
    return (*uses_of(trajectory, formulation.limits, nonlinear), *trajectory.proven)
