"""Feasible initial guesses for an optimisation: random motions, and those of [KD96]."""

from __future__ import annotations

import numpy as np

from excite.design.problem import Problem
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
    x = problem.family.resting(problem.guess.centre, rng)
    for joint in rng.permutation(n):
        direction = problem.family.coordinate_step(x, int(joint), rng.normal(size=size))
        step = problem.longest_step(x, direction)
        x = x + rng.uniform(0.6, 0.95) * (step if np.isfinite(step) else _UNBOUNDED) * direction
    return x


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
    positions = problem.guess.motion
    assert positions is not None
    time = np.linspace(0.0, problem.family.duration, len(positions))
    near = problem.family.nearest(time, positions)
    return problem.drawn(near, min(1.0, _WITHIN * problem.reach(near)))


def candidates(problem: Problem, index: int, rng: np.random.Generator) -> list[Array]:
    """Initial guesses among which one start of the search chooses."""
    drawn = [promising_motion(problem, rng) for _ in range(_CANDIDATES)]
    guess = problem.guess
    if guess.motion is None and "random" in guess.shapes:
        return [shrunk(problem, x) for x in drawn]
    shaped = shaped_motion(problem, guess.shapes) if guess.motion is None else nearest_motion(problem)
    if index == 0:
        return [shrunk(problem, shaped)]
    return [shrunk(problem, problem.inside(shaped + _MIXTURE * (x - shaped))) for x in drawn]


def shrunk(problem: Problem, x: Array) -> Array:
    """The motion scaled towards the pose at rest until the nonlinear limits hold too."""
    if problem.nonlinear_hold(x):
        return x
    for part in _PARTS:
        smaller = problem.drawn(x, part)
        if problem.nonlinear_hold(smaller):
            return smaller
    return problem.drawn(x, _PARTS[-1])
