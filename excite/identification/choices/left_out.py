"""Choices by left-out blocks of time: candidates, and errors of torques that an estimate was made without."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import scipy

from regressors.errors import InputError, percent
from regressors.robot.symbolic.vectorised import SparseRow
from regressors.samples import Array, Index


@dataclass(frozen=True)
class Candidate:
    """One candidate of a choice."""

    value: Any  # as in the settings
    error: float  # relative error of the torques that were left out, over all equations
    # mean over the equations of the logarithm of that error's root mean square, see
    # `excite.identification.choices.left_out.LeftOut.score`; the least is best
    score: float


@dataclass(frozen=True)
class Choice:
    """A choice with its candidates.

    Parameters
    ----------
    name : str
        Setting that was chosen.
    value : bool, float, str, tuple or None
    candidates : tuple of Candidate
        Those that were scored, on the same rows.
    reason : str
        One sentence for the summary.
    unit : str, optional
        Of the value.
    interval : tuple of float, optional
        99 % interval of a value that was estimated.
    intervals : tuple of tuple of float
        Those of each joint or log, where these have values of their own.
    """

    name: str
    value: Any
    candidates: tuple[Candidate, ...]
    reason: str
    unit: str | None = None
    interval: tuple[float, float] | None = None
    intervals: tuple[tuple[float, float], ...] = ()


COUNT = 5
_GAP = 0.2  # of a block
_LONGEST_GAP = 0.5  # [s]


def time_blocks(times: Sequence[Array], count: int = COUNT) -> list[Index]:
    """Number of the block that each instant lies in; -1 in the gaps.

    Neighbouring instants have nearly the same motion and noise; a block that is predicted from its neighbours across a
    gap shows more honestly how well another motion would be predicted [Roberts et al. 2017].
    """  # times (N,)
    each = max(2, -(-count // len(times)))
    numbers = []
    for k, time in enumerate(times):
        if not time.size:
            numbers.append(np.empty(0, dtype=np.intp))
            continue
        edges = np.linspace(time[0], time[-1], each + 1)
        half = min(_GAP * (edges[1] - edges[0]), _LONGEST_GAP) / 2
        block = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, each - 1)
        inner = block > 0
        near = (np.abs(time - edges[block]) < half) & inner
        near |= (np.abs(time - edges[block + 1]) < half) & (block < each - 1)
        numbers.append(np.where(near, -1, block + k * each))
    return numbers


@dataclass(frozen=True, eq=False)
class BlockStatistics:
    """``[W y]' [W y]`` of every block and equation."""

    products: Array  # (B, r, p + 1, p + 1)
    counts: Index  # (B,) instants

    @classmethod
    def of(
        cls, W: Sequence[Sequence[SparseRow]], y: Sequence[Array], blocks: Sequence[Index], width: int
    ) -> BlockStatistics:
        """Sums of the logs' rows; of each equation the columns are given that may not be zero."""
        products, counts = [], []
        for Wk, yk, block in zip(W, y, blocks, strict=True):
            rows = [np.flatnonzero(block == number) for number in np.unique(block[block >= 0])]
            products.append(_products(Wk, yk, [_as_slice(index) for index in rows], width))
            counts += [index.size for index in rows]
        if len(counts) < 2:
            raise InputError("too few rows to leave blocks of them out")
        return cls(np.concatenate(products), np.array(counts))

    @cached_property
    def total(self) -> Array:
        """Sum over the blocks, shape (r, p + 1, p + 1)."""
        return np.asarray(self.products.sum(axis=0))

    def information(self, weights: Array) -> Array:
        """What the rows tell of each column beside the others, of weighted equations, shape (p,)."""
        both = weighted_sum(self.total, weights)[:-1, :-1]
        size = np.sqrt(np.where(np.diag(both) > 0, np.diag(both), 1.0))
        left = np.linalg.inv(both / np.outer(size, size) + _RIDGE * np.eye(size.size))
        return np.asarray(size**2 / np.diag(left))

    def of_columns(self, columns: Sequence[int]) -> BlockStatistics:
        """Statistics of some of the columns."""
        kept = np.append(np.asarray(columns, dtype=np.intp), self.products.shape[2] - 1)
        return BlockStatistics(self.products[:, :, kept[:, None], kept], self.counts)


def _products(W: Sequence[SparseRow], y: Array, blocks: Sequence[slice | Index], width: int) -> Array:
    """``[W y]' [W y]`` of the rows of each block, shape (B, r, p + 1, p + 1)."""
    products = np.zeros((len(blocks), len(W), width + 1, width + 1))
    for j, (used, entries) in enumerate(W):
        for product, which in zip(products[:, j], blocks, strict=True):
            rows, measured = entries[:, which], y[which, j]
            product[used[:, None], used] = rows @ rows.T
            product[used, -1] = product[-1, used] = rows @ measured
            product[-1, -1] = measured @ measured
    return products


def _as_slice(index: Index) -> slice | Index:
    """Ascending numbers as a slice, where they follow each other."""
    first, last = int(index[0]), int(index[-1]) + 1
    return slice(first, last) if last - first == index.size else index


NEGLIGIBLE = 1e-4  # of an equation's torque: smaller errors count as that
_SMALLEST = 1e-8  # squared size of an equation that counts, of that of the largest
_RIDGE = 1e-9  # of a column's length: what the other blocks do not determine stays small
_ROUNDS = 3

# parameters (..., p) from weighted sums of `[W y]' [W y]`, shape (..., p + 1, p + 1)
Estimate = Callable[[Array], Array]
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Squared errors in left-out blocks."""

    squares: Array  # (B, r) sums over the rows of each block and equation, errors below `NEGLIGIBLE` counted as that
    instants: int  # of all blocks
    sizes: Array  # (r,) sums of the squared measurements

    @property
    def score(self) -> float:
        """``(1/r) sum_j log(rms_j)``: an equation counts by the ratio of its errors, whatever its size."""
        return float(np.mean(np.log(self.squares.sum(axis=0) / self.instants)) / 2)

    @property
    def error(self) -> float:
        """Relative error over all equations."""
        return float(np.sqrt(self.squares.sum() / self.sizes.sum()))

    @property
    def weights(self) -> Array:
        """Inverse mean squares of the equations, shape (r,)."""
        return np.asarray(self.instants / self.squares.sum(axis=0))

    @property
    def percent(self) -> str:
        """Relative error over all equations in words."""
        return percent(self.error, 3)

    def is_better(self, than: LeftOut, worth: float, errors: float = 1.0) -> bool:
        """True if the score is better by more than a worth, and than some standard errors [Breiman et al. 1984]."""
        gain, deviation = self.gain_over(than)
        return gain > max(errors * deviation, worth)

    def gain_over(self, other: LeftOut) -> tuple[float, float]:
        """By how much the score is better than another, and the standard error of that (jackknife over the blocks)."""
        mine, theirs = (each.squares.sum(axis=0) - each.squares for each in (self, other))
        gains = np.log(theirs / mine).mean(axis=1) / 2  # without one block after the other
        return other.score - self.score, jackknife(gains)


def best_of(scores: Mapping[Value, LeftOut]) -> Value:
    """The candidate of the least score."""
    return min(scores, key=lambda value: scores[value].score)


def candidates_of(scores: Mapping[Any, LeftOut]) -> tuple[Candidate, ...]:
    """Candidates with their scores, as a choice lists them."""
    return tuple(Candidate(value, errors.error, errors.score) for value, errors in scores.items())


def jackknife(without: Array) -> float:
    """Standard error of what was found without one block after the other, shape (B,)."""
    return float(np.sqrt((without.size - 1) / without.size * np.sum((without - without.mean()) ** 2)))


def left_out(
    statistics: BlockStatistics,
    estimate: Estimate | None = None,
    weights: Array | None = None,
    *,
    judged: BlockStatistics | None = None,
) -> LeftOut:
    """Predict every block from the others, estimated by least squares if not otherwise."""  # weights (r,)
    judged = statistics if judged is None else judged
    measured = judged.products[:, :, -1, -1].sum(axis=0)
    sizes = np.maximum(measured, _SMALLEST * (measured.max() or 1.0))
    floor = NEGLIGIBLE**2 * sizes[None, :] * (statistics.counts / statistics.counts.sum())[:, None]
    weights = statistics.counts.sum() / sizes if weights is None else weights
    for _ in range(_ROUNDS):
        x = np.ones((statistics.counts.size, judged.products.shape[-1]))
        x[:, :-1] = -_estimates(statistics, weights, estimate)
        squares = ((judged.products @ x[:, None, :, None])[..., 0] @ x[:, :, None])[..., 0]
        result = LeftOut(np.maximum(squares, 0.0) + floor, int(statistics.counts.sum()), sizes)
        if np.all(np.abs(np.log(result.weights / weights)) < 0.1):
            break
        weights = result.weights
    return result


_DOUBT = 0.05  # probability of calling one parameter different that is not


def differ(one: BlockStatistics, other: BlockStatistics, weights: Array) -> bool:
    """Whether two sets of rows estimate half of the parameters clearly differently, by the scatter over the blocks."""
    change = _estimates(other, weights) - _estimates(one, weights)  # without one block after the other
    found = np.subtract(*(least_squares_of_products(weighted_sum(each.total, weights)) for each in (other, one)))
    deviation = np.array([jackknife(column) for column in change.T])
    most = scipy.special.stdtrit(len(change) - 1, 1 - _DOUBT / 2)
    return bool(np.count_nonzero(np.abs(found) > most * deviation) > found.size / 2)


def _estimates(statistics: BlockStatistics, weights: Array, estimate: Estimate | None = None) -> Array:
    """Estimates without one block after the other, shape (B, p)."""
    weighted = weighted_sum(statistics.products, weights)
    return (estimate or least_squares_of_products)(weighted.sum(axis=0) - weighted)


def weighted_sum(products: Array, weights: Array) -> Array:
    """Sum over the equations, shape (..., p + 1, p + 1)."""  # products (..., r, p + 1, p + 1); weights (r,)
    *blocks, r, width, _ = products.shape
    return np.asarray((weights @ products.reshape(*blocks, r, -1)).reshape(*blocks, width, width))


def least_squares_of_products(both: Array) -> Array:
    """Least squares from each ``[W y]' [W y]``, shape (..., p + 1, p + 1)."""
    length = np.sqrt(np.maximum(np.diagonal(both, axis1=-2, axis2=-1)[..., :-1], 0.0))
    length = np.where(length > 0, length, 1.0)
    normal = both[..., :-1, :-1] / (length[..., :, None] * length[..., None, :])
    along = np.arange(length.shape[-1])
    normal[..., along, along] += _RIDGE
    right = both[..., :-1, -1] / length
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0] / length)
