"""How errors of torques, and bounds that are reached, reach the parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from excite.identification.covariance import divisors
from excite.identification.equations import equations, right_sides
from excite.identification.estimator import Context, LinearSolution, solve_triangular_system
from excite.identification.identification import Identification
from excite.identification.observations import GroupFactors, Observations
from excite.identification.preparation import PreparedLog
from excite.identification.stated_uncertainty import found_columns
from excite.identification.streamed_rows import widened
from excite.study.torque_noise import TorqueNoise
from regressors.models.nominal import standard_values
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


FREE = ("weighted", "least-squares", "recursive", "huber")  # linear in the measurements, or nearly so


def bounded_estimates(
    result: Identification,
    linear: LinearEquations,
    values: Array,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Array:
    """What an estimator makes of measurements whose weighted least-squares estimates are given, shape (k, p).

    The rows are condensed to p equations ``R beta = R values`` with ``R'R = W' V W``, of noise one.
    """  # values (k, p)
    if result.estimate.method in FREE:
        return values
    estimator, target = result.recipe.chosen_estimator(), result.target
    context = Context(target, result.prepared, result.recipe, standard_values(target.robot))
    p, root, rows = linear.count, linear.root, linear.rows
    first: np.ndarray = np.zeros(p, dtype=np.intp)
    condensed = replace(
        rows,
        W=root,
        y=np.zeros(p),
        names=rows.names[:p],
        units=rows.units[:p],
        equation=first,
        equations=rows.equations[:1],
        log=first,
        time=np.zeros(p),
        noise=np.ones((1, 1)),
    )
    bounded = []
    for k, one in enumerate(values, 1):
        bounded.append(estimator.estimate(replace(condensed, y=root @ one), context).coefficients)
        progress(k, len(values))
    return np.array(bounded)


_NUMBERS = 2**23  # of noise that is held at once


def torque_errors(
    result: Identification,
    noise: TorqueNoise,
    count: int,
    seed: int,
    found: frozenset[str] = frozenset(),
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Array:
    """Errors ``(W' V W)^-1 W' V F n`` of an estimate, shape (count, p).

    F brings torques to the rows of the equations: their low-pass and decimation, and the windows of the model.
    """
    (part,), target, recipe = result.prepared, result.target, result.recipe
    N, n = part.measured.shape
    linear = linear_equations(result, part, found)
    rng, errors = np.random.default_rng([seed, 0]), []
    block = max(1, min(count, _NUMBERS // (N * n)))
    for first in range(0, count, block):
        samples = [noise.draw(part.samples.time, n, rng) for _ in range(min(block, count - first))]
        errors.append(linear.errors(right_sides(target, part, recipe, np.array(samples))))
        progress(min(first + block, count), count)
    return np.concatenate(errors)
