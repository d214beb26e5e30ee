"""A design: the motion that was found, what it makes of every limit and criterion, and how it was found."""

from __future__ import annotations

import os
import platform
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from constraints.bounds.certificate import LimitUse, limit_uses
from constraints.bounds.enclosure import enclosed
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import Ways, ways_of
from excite.design.formulation import Formulation, formulate
from excite.design.multistart import EXECUTORS, RUNNING, StartResult, read_starts
from excite.errors import NoFeasibleMotionError
from excite.information.metrics import Prediction, measures, noise_per_row, predictions, singular_spectrum
from excite.information.target import Subject
from excite.information.weighting import Known, known_with
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import EXCITE, Carried, Piece, PlayedMotion
from regressors.models.base import Base
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_PACKAGES = ("excite-trajectories", "casadi", "numpy", "scipy", "daqp", "ruckig")


@dataclass(frozen=True, eq=False)
class Design:
    """One designed motion with its certificate.

    Parameters
    ----------
    robot : Robot
        The whole robot, as described.
    task : Task
    subject : Subject
        What is to be identified.
    trajectory : Trajectory
        Of the moving robot's joints.
    criteria : dict of str to float
        See `excite.information.metrics.CONVENTIONS`.
    limits : tuple of LimitUse
        Over continuous time.
    predicted : tuple of Prediction
    spectrum : ndarray, shape (b,)
        Singular values of W, largest first.
    rows : int
        Number of rows of W.
    starts : tuple of StartResult
    best_start : int
    provenance : dict
    notes : tuple of str
    prior : tuple of Known
        Base parameters as known before the experiment and after it; none if nothing is known before.
    interrupted : bool
        True if the search was stopped before its end.
    ways : Ways, optional
        From home and back, where the task has one.
    nonlinear : tuple of NonlinearConstraint
        Limits of torques, the tool and distances, functions of the joints that move.
    """

    robot: Robot
    task: Task
    subject: Subject
    trajectory: Trajectory
    criteria: dict[str, float]
    limits: tuple[LimitUse, ...]
    predicted: tuple[Prediction, ...]
    spectrum: Array
    rows: int
    starts: tuple[StartResult, ...]
    best_start: int
    provenance: dict[str, object]
    notes: tuple[str, ...] = ()
    prior: tuple[Known, ...] = ()
    interrupted: bool = False
    ways: Ways | None = None
    nonlinear: tuple[NonlinearConstraint, ...] = ()

    @property
    def moving(self) -> Robot:
        """The robot that the model is written for, with the task's limits."""
        return self.subject.robot

    @property
    def base(self) -> Base:
        """Left-to-right base of the model."""
        return self.subject.base

    @property
    def condition_number(self) -> float:
        """cond(W) in the left-to-right base, SI, unscaled."""
        return self.criteria["condition_number"]

    @property
    def feasible(self) -> bool:
        """True if every limit holds over continuous time, to 1e-9 of its bound, on the ways from and to home too."""
        return all(use.holds for uses in (self.limits, *self.way_limits.values()) for use in uses)

    @property
    def way_limits(self) -> dict[str, tuple[LimitUse, ...]]:
        """Limits on the ways from home and back, per segment; none without a home."""
        return {} if self.ways is None else self.ways.limits

    @property
    def samples(self) -> Samples:
        """The motion at the task's rate."""
        return self.trajectory.sampled(self.task.rate)

    @property
    def played(self) -> PlayedMotion:
        """The whole motion of every joint: the way in, the exciting motion, the way out."""
        robot = self.task.limits.applied(self.robot)
        motion = Carried(self.trajectory, robot, self.moving.joint_names)
        steps = round(self.trajectory.duration * self.task.rate)
        if self.ways is None:
            return PlayedMotion((Piece(EXCITE, motion, steps),))
        return self.ways.played(motion, steps)


Progress = Callable[[StartResult], None]


def design_trajectory(
    robot: Robot, task: Task | None = None, *, folder: Path | None = None, progress: Progress | None = None
) -> Design:
    """Find the motion that shows a robot's parameters best, within its limits.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task, optional
        Defaults for this robot if not given.
    folder : Path, optional
        An existing folder where every start is kept as soon as it ends; a temporary one if not given.
    progress : callable, optional
        Called with each start's result.

    Returns
    -------
    Design
        The best motion; after an interruption (Ctrl-C), the best so far.

    Raises
    ------
    InputError
        See `excite.design.formulation.formulate`.
    KeyboardInterrupt
        Interrupted before any motion was found.
    """
    made = formulate(robot, task if task is not None else Task(robot=robot.name))
    if folder is not None:
        return solve(robot, made, folder, progress)
    with tempfile.TemporaryDirectory() as temporary:
        return solve(robot, made, Path(temporary), progress)


def solve(robot: Robot, made: Formulation, folder: Path, progress: Progress | None = None) -> Design:
    """Run the starts of a checked problem and certify the best motion; see `design_trajectory`."""
    began, cpu, date = time.monotonic(), _own_cpu(), datetime.now(UTC)
    noise_per_row(made.task.noise, made.subject.model)
    interrupted = False
    done: list[StartResult] = []

    def report(result: StartResult) -> None:
        done.append(result)
        if progress is not None:
            progress(result)

    try:
        EXECUTORS[made.task.executor](made, list(range(made.task.starts)), folder, report)
    except KeyboardInterrupt:
        interrupted = True
    results = read_starts(folder)
    if not results:
        raise KeyboardInterrupt
    pooled = sum(result.cpu for result in done) if made.task.executor == "process" else 0.0
    provenance = _provenance(made, date, time.monotonic() - began, _own_cpu() - cpu + pooled)
    with threadpool_limits(1):
        return certify(robot, made, tuple(results), provenance, interrupted=interrupted)


def _own_cpu() -> float:
    return time.process_time()


def _provenance(made: Formulation, date: datetime, wall: float, cpu: float) -> dict[str, object]:
    return {
        "date": date.isoformat(timespec="seconds"),
        "seed": made.task.seed,
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
    samples = trajectory.samples(made.subject.model.times(made.task.period, made.task.rate))
    noise = noise_per_row(made.task.noise, made.subject.model)
    ends = trajectory.samples(np.array([0.0, trajectory.duration])).q
    ways = ways_of(robot, made.task, made.subject.robot.joint_names, ends, made.way_limits)
    notes = (*made.notes, *(ways.notes if ways is not None else ()))
    if interrupted:
        ended = sum(r.status != RUNNING for r in results)
        notes = (*notes, f"interrupted: best of {ended} finished and {len(results) - ended} unfinished starts")
    return Design(
        robot=robot,
        task=made.task,
        subject=made.subject,
        trajectory=trajectory,
        criteria=measures(made.subject, samples, noise),
        limits=uses,
        predicted=predictions(made.subject, samples, noise),
        prior=known_with(made.subject, made.task, samples),
        spectrum=singular_spectrum(made.subject, samples),
        rows=made.subject.model.assemble(samples).shape[0],
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
