"""Initial guesses that combine motions found earlier: exchanged, mirrored and mixed motions of joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from excite.design.initial_guesses import random_motion, shrunk
from excite.design.problem import Problem
from regressors.samples import Array

_WITHIN = 0.999
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
    new = x.copy()
    joint = rng.integers(len(x))
    new[joint] = drawn[joint]
    return new


def _mix(x: Array, drawn: Array, _: Array, rng: np.random.Generator) -> Array:
    """Between a good motion and a random one."""
    share = rng.uniform(0.15, 0.7)
    return (1.0 - share) * x + share * drawn


def _mirror(x: Array, _: Array, __: Array, rng: np.random.Generator) -> Array:
    """One coordinate mirrored; coordinates are about the pose at rest."""
    new = x.copy()
    joint = rng.integers(len(x))
    new[joint] = -new[joint]
    return new


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
    family, centre = problem.family, problem.guess.centre
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
