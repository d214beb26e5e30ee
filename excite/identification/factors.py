"""Triangular factors of the observations, one per group: they reduce 10^5 rows to p + 1 for least squares.

With ``[W y] = Q R``, ``||W beta - y|| = ||R [beta; -1]||`` for every beta, so the rows are read once, and weights of
whole groups change nothing but the scale of the groups' factors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.models.base import triangular_factor
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class GroupFactors:
    """Triangular factor of the rows of each group."""

    # (k_g, p + 1) of ``[W y]``, or of ``[Z W y]`` with additional columns in front; no rows for a group without rows.
    # Triangular in the columns in which the group is not zero
    R: tuple[Array, ...]
    count: Index  # (groups,) rows of each group

    @classmethod
    def of(cls, observations: Observations, front: Array | None = None) -> GroupFactors:
        """Factors of observations, by QR of one chunk of rows after the other (tall-skinny QR)."""  # front (m, k)
        check_observations(observations)
        if front is not None:
            return _factors(observations, front)
        if observations not in _KNOWN:
            _KNOWN[observations] = _factors(observations, None)
        return _KNOWN[observations]

    @property
    def rows(self) -> int:
        """Rows of all groups together."""
        return int(self.count.sum())

    def sizes(self) -> Array:
        """Root mean square of y within each group, shape (groups,); zero for a group without rows."""
        norms = np.array([np.linalg.norm(R[:, -1]) for R in self.R])
        return np.asarray(norms / np.sqrt(np.maximum(self.count, 1)))

    def stacked(self, scale: Array) -> Array:
        """Triangular factor of all rows, each group divided by its scale."""  # scale (groups,)
        return np.asarray(np.linalg.qr(np.concatenate([R / s for R, s in zip(self.R, scale, strict=True)]), mode="r"))

    def squares(self, values: Array) -> Array:
        """Sum of squared residuals of each group for given parameters, shape (groups,)."""
        signed = np.append(values, -1.0)
        return np.array([float(np.sum((R[:, -signed.size :] @ signed) ** 2)) for R in self.R])

    def leverages(self, half: Array) -> Array:
        """``tr(W_g H H' W_g')`` of each group for a matrix H of shape (p, k), shape (groups,)."""
        p = half.shape[0]
        return np.array([float(np.sum((R[:, -p - 1 : -1] @ half) ** 2)) for R in self.R])


def check_observations(observations: Observations) -> None:
    """Raise `InputError` for observations without rows or without parameters."""
    m, p = observations.W.shape
    if m == 0:
        raise InputError("observations: no rows, so nothing can be estimated from them")
    if p == 0:
        raise InputError("observations: no parameters to estimate")


_KNOWN: WeakKeyDictionary[Observations, GroupFactors] = WeakKeyDictionary()  # estimate, covariance and cond(W) use one


def _factors(observations: Observations, front: Array | None) -> GroupFactors:
    y, group = observations.y[:, None], observations.group
    columns = [observations.W, y] if front is None else [front, observations.W, y]
    width = sum(block.shape[1] for block in columns)
    factors = [_GrowingFactor(width) for _ in range(len(observations.logs) * len(observations.equations))]
    for rows in observations.blocks():
        blocks = [block[rows] for block in columns]
        for g, own in rows_of_groups(group[rows]):
            factors[g].add(np.concatenate([block[own] for block in blocks], axis=1))
            if not np.all(np.isfinite(factors[g].R)):
                raise InputError(_not_finite(observations, rows))
    return GroupFactors(tuple(factor.whole() for factor in factors), np.bincount(group, minlength=len(factors)))


class _GrowingFactor:
    """Triangular factor of the rows so far, of the columns in which they are not zero.

    The torque of a joint does not depend on the bodies before it, so that the equations of the last joints have few
    such columns, and QR takes time by their square.
    """

    def __init__(self, width: int) -> None:
        self.columns = np.zeros(width, dtype=bool)
        self.R = np.zeros((0, 0))

    def add(self, rows: Array) -> None:
        """Rows that follow, shape (k, width)."""
        seen = self.columns | np.any(rows, axis=0)
        if not np.array_equal(seen, self.columns):
            self.R, self.columns = self.whole()[:, seen], seen
        self.R = triangular_factor(np.concatenate([self.R, rows[:, seen]]))

    def whole(self) -> Array:
        """Factor of all columns, shape (k, width)."""
        R = np.zeros((self.R.shape[0], self.columns.size))
        R[:, self.columns] = self.R
        return R


def rows_of_groups(group: Index) -> Iterator[tuple[int, slice | Index]]:
    """Each group in some rows with its rows: a slice where the equations alternate, as they do in logs."""
    # group (m,)
    repeated = np.flatnonzero(group[1:] == group[0])
    first, each = np.unique(group[: repeated[0] + 1 if repeated.size else None], return_index=True)
    r = each.size
    if group.size % r == 0 and np.all(group.reshape(-1, r) == group[:r]):
        yield from ((int(g), slice(int(k), None, r)) for g, k in zip(first, each, strict=True))
        return
    yield from ((int(g), np.flatnonzero(group == g)) for g in np.unique(group))


def _not_finite(observations: Observations, rows: slice) -> str:
    W, y = observations.W[rows], observations.y[rows]
    place = int(np.argmin(np.isfinite(y) & np.all(np.isfinite(W), axis=1)))
    row = rows.start + place
    where = f"row {row}, log {observations.logs[observations.log[row]]}, time {observations.time[row]:g} s"
    if not np.isfinite(observations.y[row]):
        return f"observations: y must be finite, given {observations.y[row]} in {where}"
    column = int(np.argmin(np.isfinite(W[place])))
    name = observations.names[column]
    return f"observations: W must be finite, given {W[place, column]} for {name} in {where}"
