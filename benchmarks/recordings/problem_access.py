"""The design problems as `points.py` evaluates them: all that it knows of the package's inside is here.

Where the package names or divides these things otherwise, only this file has to follow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import excite
from excite.design.formulation import formulate
from excite.design.grid_limits import GridConstraint
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem

HERE = Path(__file__).parent
Array = np.ndarray


def problem_of(robot: str, options: Mapping[str, Any]) -> Problem:
    """The problem of a task.

    Parameters
    ----------
    robot : str
        Built-in name, or a file of ``inputs``.
    options : mapping
        Of `excite.Task`, as plain values; ``acceleration`` is that of its limits, ``world`` a file of ``inputs``.
    """
    source = str(HERE / "inputs" / robot) if "." in robot else robot
    limits = excite.LimitChoice(acceleration=options.get("acceleration"), jerk=options.get("jerk"))
    plain = {name: value for name, value in options.items() if name not in ("acceleration", "jerk", "world")}
    world = excite.read_world(HERE / "inputs" / options["world"], source) if "world" in options else None
    task = excite.Task(source, limits=limits, world=world, **plain)
    return formulate(excite.load_robot(source), task).problem


def drawn(problem: Problem, rng: np.random.Generator) -> Array:
    """A random motion within the limits that are linear in the motion."""
    return random_motion(problem, rng)


@dataclass(frozen=True)
class Objective:
    """The criterion at one x.

    Parameters
    ----------
    value : float
        Smooth, as optimised.
    gradient : ndarray, shape (x.size,)
    criterion : float
        The criterion itself.
    """

    value: float
    gradient: Array
    criterion: float


def objective(problem: Problem, x: Array, sharpness: float) -> Objective:
    """Smooth objective of a given sharpness, its gradient, and the criterion."""
    point = problem.point(x, sharpness)
    return Objective(point.value, problem.gradient(point).ravel(), problem.criterion_value(point))


def reported(problem: Problem, x: Array) -> float:
    """The criterion as results report it, with the exact sign of friction."""
    return problem.exact_value(x)


def sharpnesses(problem: Problem) -> tuple[float, float]:
    """Of the first and the last stage of the search."""
    return problem.criterion.stages[0], problem.criterion.stages[-1]


class Imposed:
    """One imposed limit on the grid: bounds on k functions at N instants.

    Parameters
    ----------
    limit : GridConstraint
    """

    def __init__(self, limit: GridConstraint) -> None:
        self._limit = limit

    @property
    def bounds(self) -> Array:
        """Lower and upper ones as imposed, shape (2, k)."""
        return np.array([self._limit.lower, self._limit.upper])

    def values(self, x: Array) -> Array:
        """Of the functions, shape (k, N)."""
        return self._limit.values(x)

    def changes(self, x: Array, d: Array, instants: Array) -> Array:
        """Jacobian at x times a direction d, at some instants, shape (k, instants)."""
        shape = self._limit.lower.size, instants.size
        function, place = (i.ravel() for i in np.indices(shape))
        return (self._limit.tangent(x, instants)(function, place) @ d.ravel()).reshape(shape)

    def rows(self, x: Array, functions: Array, instants: Array) -> Array:
        """Rows of the Jacobian at x of one function each at one instant each, shape (rows, x.size)."""
        return self._limit.tangent(x, instants)(functions, np.arange(instants.size))


def imposed(problem: Problem) -> dict[str, Imposed]:
    """All imposed limits by the label of their first function."""
    limits = problem.limits
    return {limit.function.constraint.labels[0]: Imposed(limit) for limit in (*limits.linear, *limits.nonlinear)}
