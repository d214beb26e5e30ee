"""Stacked equations ``y = W beta + e`` of one log or of several."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.identification.streamed_rows import BLOCK, Rows, StreamedRows, joined_rows
from regressors.errors import InputError
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

    def known_noise(self) -> Array | None:
        """Known standard deviation of every row, shape (m,); None where it is not known."""
        return None if self.noise is None else self.noise.ravel()[self.group]

    @property
    def matrix(self) -> Array:
        """W as an array, also where its rows are streamed.

        Raises
        ------
        InputError
            It is too large to be held, see `StreamedRows.whole`.
        """
        return self.W.whole() if isinstance(self.W, StreamedRows) else self.W

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
        return Observations(
            self.W[which],
            self.y[which],
            self.names,
            self.units,
            self.equation[which],
            self.equations,
            self.log[which],
            self.logs,
            self.time[which],
            self.noise,
        )


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
    return Observations(
        joined_rows([part.W for part in parts]),
        np.concatenate([part.y for part in parts]),
        first.names,
        first.units,
        np.concatenate([part.equation for part in parts]),
        first.equations,
        np.concatenate([part.log + k for part, k in zip(parts, offsets, strict=False)]),
        tuple(name for part in parts for name in part.logs),
        np.concatenate([part.time for part in parts]),
        np.concatenate(known) if known else None,
    )
