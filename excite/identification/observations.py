"""Stacked equations ``y = W beta + e`` of logs, and their triangular factors.

With ``[W y] = Q R``, ``||W beta - y|| = ||R [beta; -1]||`` for every beta, so the rows are read once, and weights of
whole groups change nothing but the scale of the groups' factors.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from excite.identification.streamed_rows import BLOCK, Rows, StreamedRows, joined_rows, widened
from regressors.errors import InputError
from regressors.models.base import triangular_factor
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class Observations:
    """Equations ``y = W beta + e``, m of them for p parameters.

    Parameters
    ----------
    W : ndarray or StreamedRows, shape (m, p)
        Measured regressor [unit of the equation per unit of the parameter]; of a long log rows that are computed when
        they are read, see `excite.identification.streamed_rows`.
    y : ndarray, shape (m,)
        Measured left-hand side.
    names, units : tuple of str, length p
        Parameters.
    equation : ndarray of int, shape (m,)
        Index into `equations` of each row: its joint, or its component of the wrench.
    equations : tuple of (str, str)
        Name and unit.
    log : ndarray of int, shape (m,)
        Index into `logs` of each row. The rows of one log are contiguous, in the order of time.
    logs : tuple of str
    time : ndarray, shape (m,)
        Instant of each row, or end of its window [s].
    noise : ndarray, shape (logs, equations), optional
        Known standard deviation of e, in the equations' units; estimated from the residuals if not given.
    """

    W: Rows
    y: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    equation: Index
    equations: tuple[tuple[str, str], ...]
    log: Index
    logs: tuple[str, ...]
    time: Array
    noise: Array | None = None

    def __post_init__(self) -> None:
        m, p = self.W.shape
        for what in ("y", "equation", "log", "time"):
            if getattr(self, what).shape != (m,):
                raise InputError(f"observations: {what} has shape {getattr(self, what).shape}, W has {m} rows")
        if len(self.names) != p or len(self.units) != p:
            raise InputError(f"observations: {len(self.names)} names, {len(self.units)} units, but {p} columns")
        if self.noise is not None and self.noise.shape != (len(self.logs), len(self.equations)):
            raise InputError(
                f"observations: noise has shape {self.noise.shape}, expected {(len(self.logs), len(self.equations))}"
            )

    @property
    def group(self) -> Index:
        """Group number of each row, one per log and equation, shape (m,); all rows of a group have the same noise."""
        return np.asarray(self.log * len(self.equations) + self.equation)

    @property
    def matrix(self) -> Array:
        """W as an array, also where its rows are streamed.

        Raises
        ------
        InputError
            It is too large to be held, see `StreamedRows.whole`.
        """
        return self.W.whole() if isinstance(self.W, StreamedRows) else self.W

    def beside(self, columns: Array, names: Sequence[str], unit: str = "1") -> Observations:
        """The same observations with further parameters, whose columns have the shape (m, k)."""
        units = (*self.units, *(unit for _ in names))
        return replace(self, W=widened(self.W, columns), names=(*self.names, *names), units=units)

    def held(self) -> Observations:
        """The same observations with W as an array; see `matrix`."""
        return replace(self, W=self.matrix)

    def blocks(self, log: int | None = None) -> Iterator[slice]:
        """Stretches of rows, each of one log and of at most `BLOCK` whole instants; of all logs, or of one."""
        changed = (self.time[1:] != self.time[:-1]) | (self.log[1:] != self.log[:-1])
        starts = np.concatenate([[0], np.flatnonzero(changed) + 1, [self.time.size]])
        ends: list[int] = (np.flatnonzero(np.diff(self.log[starts[:-1]])) + 1).tolist() if self.time.size else []
        for first, last in itertools.pairwise([0, *ends, starts.size - 1]):
            edges = [*starts[first:last:BLOCK].tolist(), int(starts[last])]
            if log is None or (first < last and self.log[edges[0]] == log):
                yield from itertools.starmap(slice, itertools.pairwise(edges))

    def rows(self, which: Index) -> Observations:
        """Observations of the selected rows."""
        of_rows: dict[str, Any] = {n: getattr(self, n)[which] for n in ("W", "y", "equation", "log", "time")}
        return replace(self, **of_rows)


def join_observations(parts: Sequence[Observations]) -> Observations:
    """Observations of several logs, one after the other."""
    if not parts:
        raise InputError("no observations to join")
    first = parts[0]
    if len(parts) == 1:
        return first
    for part in parts[1:]:
        if (part.names, part.equations) != (first.names, first.equations):
            raise InputError(f"observations of {part.logs} and {first.logs} have different parameters or equations")
    known = [part.noise for part in parts if part.noise is not None]
    if known and len(known) != len(parts):
        raise InputError("observations: noise must be known for all logs or for none")
    offsets = np.cumsum([0, *(len(part.logs) for part in parts)])
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in ("y", "equation", "time")
    }
    return replace(
        first,
        W=joined_rows([part.W for part in parts]),
        log=np.concatenate([part.log + k for part, k in zip(parts, offsets, strict=False)]),
        logs=tuple(name for part in parts for name in part.logs),
        noise=np.concatenate(known) if known else None,
        **joined,
    )


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
    factors = [np.zeros((0, width))] * (len(observations.logs) * len(observations.equations))
    for rows in observations.blocks():
        blocks = [block[rows] for block in columns]
        for g, own in rows_of_groups(group[rows]):
            factors[g] = _grown(factors[g], np.concatenate([block[own] for block in blocks], axis=1))
            if not np.all(np.isfinite(factors[g])):
                raise InputError(_not_finite(observations, rows))
    return GroupFactors(tuple(factors), np.bincount(group, minlength=len(factors)))


def _grown(R: Array, rows: Array) -> Array:
    """Triangular factor with rows that follow, of the columns that are not zero; shapes (k, width).

    The torque of a joint does not depend on the bodies before it, so that the equations of the last joints have few
    such columns, and QR takes time by their square.
    """
    seen = np.any(R, axis=0) | np.any(rows, axis=0)
    factor = triangular_factor(np.concatenate([R[:, seen], rows[:, seen]]))
    grown = np.zeros((len(factor), seen.size))
    grown[:, seen] = factor
    return grown


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


MOST = 2**17  # rows
_STRETCHES = 8


def row_stretches(observations: Observations) -> list[slice]:
    """All rows, or, of more than `MOST`, that many in contiguous stretches evenly spread over each log."""
    m, r = observations.y.size, len(observations.equations)
    if m <= MOST:
        return [slice(0, m)]
    stretches, first = [], 0
    for rows in np.bincount(observations.log):
        number = max(1, round(_STRETCHES * rows / m))
        length = max(1, int(MOST * rows / (m * number * r)))
        for k in range(number):
            middle = int((k + 0.5) * rows / (number * r))
            start = first + r * max(0, middle - length // 2)
            stretches.append(slice(start, min(start + r * length, first + rows)))
        first += rows
    return [stretch for stretch in stretches if stretch.start < stretch.stop]
