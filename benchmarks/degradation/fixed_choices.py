"""The best fixed choice in hindsight: every combination of a table of choices, judged on the unseen log.

The regressor of each cutoff is evaluated once, at every tenth instant, with all columns; choices of terms are subsets
of its columns, delays shift the torques. The best of each cutoff is then judged as `excite.verify` does, by the torques
of the log's own rows.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from subjects import Measurement

from excite.identification.equations import equations_of, measured_regressor
from excite.identification.estimator import Context
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, target_of
from excite.tasks.task import Task
from regressors.errors import ExciteError
from regressors.models.nominal import standard_values
from regressors.readers.library import load_robot
from regressors.robot.columns import OFFSET, ROTOR
from regressors.samples import Array, Samples

CUTOFFS = (2.0, 5.0, 10.0, 20.0, 40.0, 80.0)  # Hz
DELAYS = (0.0, 0.002, 0.004, 0.008)  # s
WIDTHS = (0.0, 0.002, 0.02)  # rad/s over which Coulomb friction changes its sign
TERMS = ("friction", "and offsets", "and rotors", "and both", "and both and sqrt|v|")
EVERY = 10


@dataclass(frozen=True)
class Choice:
    """One fixed choice.

    Parameters
    ----------
    cutoff : float
        Of the positions' low-pass [Hz].
    terms : str
        One of `TERMS`.
    width : float
        [rad/s]
    delay : float
        [s]
    estimator : str
    error : float
        Relative error on the unseen log against its raw torque.
    true_error : float
        The same against the true torque.
    """

    cutoff: float
    terms: str
    width: float
    delay: float
    estimator: str
    error: float
    true_error: float


@dataclass(frozen=True, eq=False)
class Fit:
    """A choice with its coefficients, and its error on the unseen log at every tenth instant."""

    cutoff: float
    terms: str
    width: float
    delay: float
    estimator: str
    beta: Array
    error: float


@dataclass(frozen=True, eq=False)
class Rows:
    """Every tenth instant of one log."""

    part: PreparedLog
    samples: Samples
    given: Measurement

    def measured(self, delay: float) -> Array:
        """Raw torques, shape (N, n); those that act at an instant are recorded later."""
        return _at(self.samples.time + delay, self.part.samples.time, self.part.measured)


def _at(time: Array, known: Array, values: Array) -> Array:
    return np.column_stack([np.interp(time, known, column) for column in values.T])


@cache
def _target(name: str, terms: str, width: float) -> IdentificationTarget:
    rotors, offset = terms != TERMS[0] and terms != TERMS[1], terms not in (TERMS[0], TERMS[2])
    task = Task(name, joint_rotors=rotors, offset=offset)
    return target_of(load_robot(name), task, width)


def best_fixed_choice(name: str, train: Measurement, unseen: Measurement) -> tuple[Choice, list[Choice]]:
    """The best choice on the unseen log, and the best one of every cutoff.

    Parameters
    ----------
    name : str
        Of the robot.
    train, unseen : Measurement
    """
    best = []
    for cutoff in CUTOFFS:
        both = _rows(name, train, cutoff), _rows(name, unseen, cutoff)
        fits = list(_weighted(name, cutoff, *both))
        first = min(fits, key=lambda fit: fit.error)
        finalists = [first, *_physical(name, first, *both)]
        best.append(min((_judged(name, fit, both[1]) for fit in finalists), key=lambda choice: choice.error))
    return min(best, key=lambda choice: choice.error), best


def _rows(name: str, given: Measurement, cutoff: float) -> Rows:
    part = prepare(given.log, load_robot(name), _target(name, TERMS[3], 0.0), Recipe(cutoff=cutoff, rows="all"))
    s = part.samples
    inside = slice(EVERY, s.time.size - EVERY, EVERY)  # so that delays stay within the log
    return Rows(part, Samples(s.time[inside], *(x[inside] for x in (s.q, s.dq, s.ddq, s.dddq))), given)


def _weighted(name: str, cutoff: float, train: Rows, unseen: Rows) -> Iterator[Fit]:
    for width in WIDTHS:
        target = _target(name, TERMS[3], width)
        W, V = (_with_roots(target, rows.samples) for rows in (train, unseen))
        size = np.linalg.norm(W, axis=0)
        size[size == 0] = 1.0  # drives at rest
        problem, V = WeightedProblem(W / size, target.robot.n), V / size
        for terms, delay in itertools.product(TERMS, DELAYS):
            kept = _columns(target, terms, W.shape[1])
            beta = problem.estimate(kept, train.measured(delay))
            error = _relative(unseen.measured(delay), V @ beta)
            yield Fit(cutoff, terms, width, delay, "weighted", beta / size, error)


def _with_roots(target: IdentificationTarget, samples: Samples) -> Array:
    """All columns, and those of ``C' sign(dz) sqrt|dz|``, dz = C dq."""
    W = measured_regressor(target, samples)
    transmission = target.robot.transmission
    assert transmission is not None
    dz = samples.dq @ transmission.coupling.T
    roots = np.sign(dz) * np.sqrt(np.abs(dz))
    return np.hstack([W, np.einsum("kn,tk->tnk", transmission.coupling, roots).reshape(W.shape[0], -1)])


def _columns(target: IdentificationTarget, terms: str, count: int) -> NDArray[np.bool_]:
    """Which columns a choice of terms keeps."""
    kinds = np.array([target.base.columns[k].kind for k in target.base.index])
    kept = np.ones(count, dtype=bool)
    kept[kinds.size :] = terms == TERMS[4]
    kept[: kinds.size] &= (kinds != ROTOR) | (terms in TERMS[2:])
    kept[: kinds.size] &= (kinds != OFFSET) | (terms not in (TERMS[0], TERMS[2]))
    return kept


class WeightedProblem:
    """Weighted least squares of many right-hand sides and subsets of columns, from the Gram matrix of each joint.

    Parameters
    ----------
    W : ndarray, shape (N n, b)
        Columns of unit length.
    n : int
        Number of joints.
    """

    def __init__(self, W: Array, n: int) -> None:
        self._blocks = W.reshape(-1, n, W.shape[1]).transpose(1, 0, 2)
        self._grams = np.array([block.T @ block for block in self._blocks])

    def estimate(self, kept: NDArray[np.bool_], y: Array) -> Array:
        """Least squares, then once more with each joint's rows divided by the deviation of its residuals, (b,)."""
        beta, weight = np.zeros(kept.size), np.ones(y.shape[1])
        right = np.array([block.T @ column for block, column in zip(self._blocks, y.T, strict=True)])
        for _ in range(2):
            gram = np.tensordot(weight, self._grams, 1)[np.ix_(kept, kept)]
            beta[kept] = np.linalg.lstsq(gram, (weight @ right)[kept], rcond=1e-12)[0]
            residuals = y - np.column_stack([block @ beta for block in self._blocks])
            weight = 1 / (np.var(residuals, axis=0) + 1e-18)
        return beta


def _physical(name: str, like: Fit, train: Rows, unseen: Rows) -> Iterator[Fit]:
    """The physically consistent estimate with the same terms, as far as the package has them."""
    terms = like.terms if like.terms != TERMS[4] else TERMS[3]
    target, recipe = _target(name, terms, like.width), Recipe(cutoff=like.cutoff, estimator="physical")
    part = replace(train.part, samples=train.samples, measured=train.measured(like.delay))
    try:
        observations = equations_of(target, part, recipe)
        context = Context(target, (part,), recipe, standard_values(target.robot), None)
        beta = recipe.chosen_estimator().estimate(observations, context).coefficients
    except ExciteError:
        return
    error = _relative(unseen.measured(like.delay), measured_regressor(target, unseen.samples) @ beta)
    yield Fit(like.cutoff, terms, like.width, like.delay, "physical", beta, error)


def _judged(name: str, fit: Fit, unseen: Rows) -> Choice:
    """The fit's errors against the raw torques of the log's rows, and against the true ones."""
    log, motion = unseen.part.log, unseen.part.samples
    rows = np.unique(np.clip(np.searchsorted(log.time, unseen.samples.time - 1e-9), 0, log.count - 1))
    time = log.time[rows] - fit.delay
    at = Samples(time, *(_at(time, motion.time, x) for x in (motion.q, motion.dq, motion.ddq, np.zeros_like(motion.q))))
    if fit.estimator == "physical":
        predicted = measured_regressor(_target(name, fit.terms, fit.width), at) @ fit.beta
    else:
        predicted = _with_roots(_target(name, TERMS[3], fit.width), at) @ fit.beta
    assert log.effort is not None
    true = _at(log.time[rows], unseen.given.time, unseen.given.effort)
    errors = [_relative(x, predicted) for x in (log.effort[rows], true)]
    return Choice(fit.cutoff, fit.terms, fit.width, fit.delay, fit.estimator, *errors)


def _relative(y: Array, predicted: Array) -> float:
    return float(np.linalg.norm(y - predicted.reshape(y.shape)) / np.linalg.norm(y))
