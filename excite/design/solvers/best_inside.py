"""The best point inside the limits, for solvers whose iterates may leave them."""

from __future__ import annotations

import numpy as np

from excite.design.problem import Problem
from excite.design.solvers.solver import Watcher
from regressors.samples import Array

_INSIDE = 1.0 - 1e-12


class BestInside:
    """Best of the iterates of a solver, each pulled towards the start until it is inside the limits."""

    def __init__(self, problem: Problem, start: Array, watch: Watcher | None) -> None:
        self.problem, self.start, self.watch = problem, start, watch
        self.best, self.best_value = start, np.inf
        self.history: list[float] = []
        self.evaluations = 0
        self.offer(start)

    def offer(self, x: Array) -> None:
        """Keep x, pulled towards the start as far as the limits require, if it is the best so far."""
        reach = min(1.0, _INSIDE * self.problem.longest_step(self.start, x - self.start))
        inside = self.start + reach * (x - self.start)
        value = self.problem.criterion_value(self.problem.point(inside, self.problem.criterion.stages[0]))
        if value < self.best_value:
            self.best, self.best_value = inside, value
        self.history.append(value)
        if self.watch is not None:
            self.watch(inside, value)
