"""Weighted equations of one log, and how errors of their right-hand side reach the parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from excite.identification.covariance import divisors
from excite.identification.equations import equations
from excite.identification.factors import GroupFactors
from excite.identification.identification import Identification
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.solution import LinearSolution, solve_triangular_system
from excite.identification.stated_uncertainty import found_columns
from excite.identification.widened_rows import widened
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class LinearEquations:
    """Equations ``y = W beta + C c + e``, each row with a divisor, and columns C of settings found with beta."""

    rows: Observations  # with the columns [W C]
    divisor: Array  # (groups,) noise by which the rows of each group are divided
    count: int  # parameters p of beta, the first columns

    @cached_property
    def factor(self) -> Array:
        """Triangular factor of ``V^1/2 [W C y]``."""
        return GroupFactors.of(self.rows).stacked(self.divisor)

    @cached_property
    def solution(self) -> LinearSolution:
        """Weighted least squares, also of the settings."""
        return solve_triangular_system(self.factor)

    @cached_property
    def root(self) -> Array:
        """Triangular factor of the equations of beta once the settings are eliminated, shape (p, p)."""
        p, k = self.count, self.factor.shape[1] - 1 - self.count
        first = np.concatenate([self.factor[:, p : p + k], self.factor[:, :p]], axis=1)
        return np.asarray(np.linalg.qr(first, mode="r"))[k : k + p, k:]

    def errors(self, changes: Array) -> Array:
        """``(W' V W)^-1 W' V e`` for errors of the right-hand side of shape (m, k), shape (k, p)."""
        half, scores = self.solution.half, np.zeros((self.solution.half.shape[1], changes.shape[1]))
        for block in self.rows.blocks():
            scale = self.divisor[self.rows.group[block], None]
            scores += (self.rows.W[block] @ half / scale).T @ (changes[block] / scale)
        return np.asarray((half @ scores)[: self.count].T)

    def error(self, values: Array) -> Array:
        """Estimate of these equations less given values, shape (p,)."""
        return np.asarray((self.solution.values - values)[: self.count])


def linear_equations(result: Identification, part: PreparedLog, found: frozenset[str]) -> LinearEquations:
    """Equations of a log by the settings and with the weights of an identification."""
    target, recipe, estimate = result.target, result.recipe, result.estimate
    rows = equations(target, [part], recipe)
    for name, column in found_columns(estimate, target, (part,), recipe, found):
        rows = replace(rows, W=widened(rows.W, column), names=(*rows.names, name), units=(*rows.units, "1"))
    return LinearEquations(rows, divisors(estimate), len(result.names))
