"""Initial guesses of a search: random motions, those of [KD96], combinations, and earlier designs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.design import Design
from excite.design.problem import Problem
from excite.design.start_results import RANDOM_MOTIONS
from excite.information.target import IdentificationTarget
from excite.registry import OwnPart, is_own
from excite.storage.atomic import Destination, read_json
from excite.storage.commit import settle
from excite.tasks.stored_files import InitialDesign, UnopenedFile
from excite.tasks.task import Task
from excite.trajectories.closed import stored_motion
from regressors.errors import InputError
from regressors.samples import Array

_UNBOUNDED = 1.0
_REACH = 0.95
_WITHIN = 0.999
_MIXTURE = 0.3
_CANDIDATES = 3
_PARTS = tuple(0.8**k for k in range(1, 60))


def random_motion(problem: Problem, rng: np.random.Generator) -> Array:
    """Coefficients of a random motion strictly inside the limits.

    A random direction from the resting pose, scaled joint by joint to a random fraction of what the limits allow, so
    that joints with wide limits use them.
    """
    n, size = problem.shape
    x = problem.family.resting(problem.centre, rng)
    for joint in rng.permutation(n):
        direction = problem.family.coordinate_step(x, int(joint), rng.normal(size=size))
        step = problem.longest_step(x, direction)
        x = x + rng.uniform(0.6, 0.95) * (step if np.isfinite(step) else _UNBOUNDED) * direction
    return x


def best_random_value(problem: Problem, seed: int) -> float:
    """Least criterion among random motions within the limits, which a design is compared with."""
    rng = np.random.default_rng(seed)
    return min(problem.exact_value(shrunk(problem, random_motion(problem, rng))) for _ in range(RANDOM_MOTIONS))


def promising_motion(problem: Problem, rng: np.random.Generator, trials: int = 6) -> Array:
    """Best of a few random motions in the smoothest stage of the criterion."""
    motions = [random_motion(problem, rng) for _ in range(trials)]
    return min(motions, key=lambda x: problem.point(x, problem.criterion.stages[0]).value)


def _cosine(u: Array, _: int) -> Array:
    return 0.5 * (1.0 - np.cos(2 * np.pi * u))


def _quintic(u: Array, _: int) -> Array:
    """Back and forth, in each direction a polynomial of fifth order from rest to rest."""
    s = 1.0 - np.abs(2.0 * u - 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


_SINES = (
    ((-0.7, 0.4 + 0.5, 1.7), (0.8, 0.1, 0.8)),
    ((1.8, 0.4 + 0.5, 1.7), (1.3, 0.1 + 0.5, 0.3)),
    ((1.0, 0.45 + 0.5, 1.4), (0.4, 0.4, 0.4), (0.7, 0.8, 0.6)),
    ((-1.2, 0.45, 1.7), (1.8, 0.15 + 0.5, 0.7)),
    ((2.6, 0.15 + 0.5, 2.0), (1.1, 0.45, 0.2)),
)


def _sines(u: Array, coordinate: int) -> Array:
    """Sums of sines, initial guess for the load in [KD96] section 5.4: ``sum A sin(pi phase + frequency alpha)``."""
    alpha = 2 * np.pi * (u - 1.0)
    terms = _SINES[coordinate % len(_SINES)]
    return np.asarray(sum(a * np.sin(np.pi * phase + frequency * alpha) for a, phase, frequency in terms))


_SHAPES = {"cosine": _cosine, "quintic": _quintic, "sines": _sines}


def shaped_motion(problem: Problem, kinds: tuple[str, ...]) -> Array:
    """Motion of given shapes, projected onto the family and as large as the limits allow."""
    k, size = problem.shape
    time = problem.family.grid(64 * size)
    shapes = [_SHAPES[kinds[j % len(kinds)]](time / problem.family.duration, j) for j in range(k)]
    wanted = problem.family.nearest(time, np.column_stack([shape - np.mean(shape) for shape in shapes]))
    return problem.enlarged(wanted, _REACH, _UNBOUNDED)


def nearest_motion(problem: Problem) -> Array:
    """Motion of the family nearest to the problem's initial motion, scaled into the limits.

    Least squares over the whole motion, then scaling towards the resting pose as far as the linear limits require.
    """
    positions = problem.initial
    assert positions is not None
    time = np.linspace(0.0, problem.family.duration, len(positions))
    near = problem.family.nearest(time, positions)
    return problem.drawn(near, min(1.0, _WITHIN * problem.reach(near)))


def candidates(problem: Problem, index: int, rng: np.random.Generator) -> list[Array]:
    """Initial guesses among which one start of the search chooses."""
    drawn = [promising_motion(problem, rng) for _ in range(_CANDIDATES)]
    if problem.initial is None and "random" in problem.shapes:
        return [shrunk(problem, x) for x in drawn]
    shaped = shaped_motion(problem, problem.shapes) if problem.initial is None else nearest_motion(problem)
    if index == 0:
        return [shrunk(problem, shaped)]
    return [shrunk(problem, problem.inside(shaped + _MIXTURE * (x - shaped))) for x in drawn]


def shrunk(problem: Problem, x: Array) -> Array:
    """The motion scaled towards the pose at rest until the nonlinear limits hold too."""
    if problem.nonlinear_hold(x):
        return x
    smaller = (problem.drawn(x, part) for part in _PARTS)
    return next((each for each in smaller if problem.nonlinear_hold(each)), problem.drawn(x, _PARTS[-1]))


_INSTANTS = 16  # per coefficient, where motions are combined as positions
_CHILDREN = 6

Combine = Callable[[Array, Array, Array, np.random.Generator], Array]


def _exchange(x: Array, _: Array, other: Array, rng: np.random.Generator) -> Array:
    """Some coordinates of another good motion."""
    taken = rng.random(len(x)) < 0.5
    if taken.all() or not taken.any():
        taken[rng.integers(len(x))] ^= True
    return np.where(taken[:, None], other, x)


def _blend(x: Array, _: Array, other: Array, rng: np.random.Generator) -> Array:
    """Between two good motions."""
    share = rng.uniform(0.3, 0.7)
    return (1.0 - share) * x + share * other


def _renew(x: Array, drawn: Array, _: Array, rng: np.random.Generator) -> Array:
    """One coordinate of a random motion."""
    return np.where(np.arange(len(x))[:, None] == rng.integers(len(x)), drawn, x)


def _mix(x: Array, drawn: Array, _: Array, rng: np.random.Generator) -> Array:
    """Between a good motion and a random one."""
    share = rng.uniform(0.15, 0.7)
    return (1.0 - share) * x + share * drawn


def _mirror(x: Array, _: Array, __: Array, rng: np.random.Generator) -> Array:
    """One coordinate mirrored; coordinates are about the pose at rest."""
    return np.where(np.arange(len(x))[:, None] == rng.integers(len(x)), -x, x)


def _disturb(x: Array, _: Array, __: Array, rng: np.random.Generator) -> Array:
    """Every coordinate changed at random, by a part of its own size."""
    size = np.sqrt(np.mean(x**2, axis=1, keepdims=True))
    return np.asarray(x + rng.uniform(0.1, 0.5) * size * rng.normal(size=x.shape))


_WITH_OTHER: tuple[Combine, ...] = (_exchange, _blend)
_ALONE: tuple[Combine, ...] = (_renew, _mix, _mirror, _disturb)


def combinations(
    problem: Problem, parents: Sequence[Array], rng: np.random.Generator, count: int = _CHILDREN
) -> list[Array]:
    """Motions within the limits that combine good ones with each other and with random ones."""
    return [shrunk(problem, _into_limits(problem, _combined(problem, parents, rng))) for _ in range(count)]


def _combined(problem: Problem, parents: Sequence[Array], rng: np.random.Generator) -> Array:
    family, centre = problem.family, problem.centre
    ways = (*_WITH_OTHER, *_ALONE) if len(parents) > 1 else _ALONE
    combine = ways[rng.integers(len(ways))]
    first = int(rng.integers(len(parents)))
    second = (first + 1 + int(rng.integers(max(len(parents) - 1, 1)))) % len(parents)
    motions = parents[first], random_motion(problem, rng), parents[second]
    if family.linear:
        x, drawn, other = (motion - problem.rest for motion in motions)
        return np.asarray(problem.rest + combine(x, drawn, other, rng))
    time = family.grid(_INSTANTS * family.size)
    x, drawn, other = ((family.motion(motion, time, 0) - centre).T for motion in motions)
    return family.nearest(time, combine(x, drawn, other, rng).T + centre)


def _into_limits(problem: Problem, x: Array) -> Array:
    reach = problem.reach(x)
    return x if reach >= 1.0 else problem.drawn(x, _WITHIN * reach)


_SAMPLES = 1001


def with_initial_design(task: Task) -> Task:
    """The task with the motion itself of the design that it begins with, so that a result can hold it."""
    begin = task.search.begin
    if begin is None or isinstance(begin, InitialDesign):
        return task
    if isinstance(begin, UnopenedFile):
        raise begin.missing()
    if isinstance(begin, Design):
        return task.changed(begin=InitialDesign(begin.name, begin.series, begin.trajectory))
    return task.changed(begin=InitialDesign(str(begin), _series(Path(begin))))


def initial_motion(target: IdentificationTarget, task: Task) -> Array | None:
    """Positions of the moving coordinates in the design that a task starts from; None if it names none.

    The motion keeps its shape over the task's period.
    """
    if task.search.begin is None:
        return None
    begin: InitialDesign = with_initial_design(task).search.begin
    names = tuple(begin.trajectory.get("joints", ()))
    wanted = target.robot.joint_names if target.motion.straight else target.motion.labels
    if names != wanted:
        raise InputError(
            f"{begin.name} moves {', '.join(names)}; the motion to begin with must move {', '.join(wanted)}"
        )
    trajectory = begin.motion or stored_motion(begin.trajectory, target.robot)
    q = trajectory.samples(np.linspace(0.0, trajectory.duration, _SAMPLES)).q
    return target.motion.coordinates(q)


def _series(folder: Path) -> dict[str, Any]:
    """Entries of a design's file that define its motion."""
    path = folder / "design.json"
    settle(Destination(folder))
    if not path.exists():
        raise InputError(f"{folder} is no design folder: there is no {path}")
    content = read_json(path)
    series, task = content.get("trajectory"), content.get("task")
    family = task.get("trajectory") if isinstance(task, dict) else None
    if isinstance(family, str) and is_own(family):
        raise OwnPart("trajectory", family).missing()
    if not isinstance(series, dict):
        raise InputError(f"{path}: not a complete design: 'trajectory' is missing")
    return series
