"""Triangular factors of the observations, one per group: they reduce 10^5 rows to p + 1 for least squares.

With ``[W y] = Q R``, ``||W beta - y|| = ||R [beta; -1]||`` for every beta, so the rows are read once, and weights of
whole groups change nothing but the scale of the groups' factors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.samples import Array, Index

_CHUNK = 2048


@dataclass(frozen=True, eq=False)
class GroupFactors:
    """Triangular factor of the rows of each group.

    Parameters
    ----------
    R : tuple of ndarray, shape (k_g, p + 1) each
        Of ``[W y]``, or of ``[Z W y]`` with additional columns in front; no rows for a group without rows.
    count : ndarray of int, shape (groups,)
        Rows of each group.
    """

    R: tuple[Array, ...]
    count: Index

    @classmethod
    def of(cls, observations: Observations, front: Array | None = None) -> GroupFactors:
        """Factors of observations, by QR of one chunk of rows after the other (tall-skinny QR).

        Parameters
        ----------
        observations : Observations
        front : ndarray, shape (m, k), optional
            Columns to put before those of W.

        Raises
        ------
        InputError
            No rows, no parameters, or numbers that are not finite.
        """
        check_observations(observations)
        groups = len(observations.logs) * len(observations.equations)
        group = observations.group
        order = np.argsort(group, kind="stable")
        count = np.bincount(group, minlength=groups)
        blocks = [observations.W, observations.y[:, None]]
        if front is not None:
            blocks = [front, *blocks]
        rows = np.split(order, np.cumsum(count)[:-1])
        factors = tuple(_triangular(blocks, part) for part in rows)
        for R in factors:
            if not np.all(np.isfinite(R)):
                raise InputError(_not_finite(observations))
        return cls(factors, count)

    @property
    def rows(self) -> int:
        """Rows of all groups together."""
        return int(self.count.sum())

    def sizes(self) -> Array:
        """Root mean square of y within each group, shape (groups,); zero for a group without rows."""
        norms = np.array([np.linalg.norm(R[:, -1]) for R in self.R])
        return np.asarray(norms / np.sqrt(np.maximum(self.count, 1)))

    def stacked(self, scale: Array) -> Array:
        """Triangular factor of all rows, each group divided by its scale.

        Parameters
        ----------
        scale : ndarray, shape (groups,)

        Returns
        -------
        ndarray, shape (k, p + 1)
        """
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


def _chunks(blocks: list[Array], rows: Index) -> Iterator[Array]:
    for start in range(0, rows.size, _CHUNK):
        part = rows[start : start + _CHUNK]
        yield np.concatenate([block[part] for block in blocks], axis=1)


def _triangular(blocks: list[Array], rows: Index) -> Array:
    R = np.zeros((0, sum(block.shape[1] for block in blocks)))
    for chunk in _chunks(blocks, rows):
        R = np.asarray(np.linalg.qr(np.concatenate([R, chunk]), mode="r"))
    return R


def _not_finite(observations: Observations) -> str:
    row = int(np.argmin(np.isfinite(observations.y) & np.all(np.isfinite(observations.W), axis=1)))
    where = f"row {row}, log {observations.logs[observations.log[row]]}, time {observations.time[row]:g} s"
    if not np.isfinite(observations.y[row]):
        return f"observations: y must be finite, given {observations.y[row]} in {where}"
    column = int(np.argmin(np.isfinite(observations.W[row])))
    name = observations.names[column]
    return f"observations: W must be finite, given {observations.W[row, column]} for {name} in {where}"
