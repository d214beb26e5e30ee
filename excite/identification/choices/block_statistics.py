"""Sums of products of each block: all that least squares with blocks left out needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from regressors.errors import InputError
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class BlockStatistics:
    """``[W y]' [W y]`` of every block and equation.

    Parameters
    ----------
    products : ndarray, shape (B, r, p + 1, p + 1)
    counts : ndarray of int, shape (B,)
        Instants.
    """

    products: Array
    counts: Index

    @classmethod
    def of(cls, W: Sequence[Array], y: Sequence[Array], blocks: Sequence[Index]) -> BlockStatistics:
        """Sums of the logs' rows.

        Parameters
        ----------
        W : sequence of ndarray, shape (N, r, p)
            Of each log.
        y : sequence of ndarray, shape (N, r)
        blocks : sequence of ndarray of int, shape (N,)
            See `excite.identification.choices.time_blocks`.

        Raises
        ------
        InputError
            Fewer than two blocks with rows.
        """
        products, counts = [], []
        for Wk, yk, block in zip(W, y, blocks, strict=True):
            both = np.concatenate([Wk, yk[:, :, None]], axis=2)
            for number in np.unique(block[block >= 0]):
                rows = both[block == number].transpose(1, 0, 2)
                products.append(rows.transpose(0, 2, 1) @ rows)
                counts.append(rows.shape[1])
        if len(counts) < 2:
            raise InputError("too few rows to leave blocks of them out")
        return cls(np.array(products), np.array(counts))

    @property
    def total(self) -> Array:
        """Sum over the blocks, shape (r, p + 1, p + 1)."""
        return np.asarray(self.products.sum(axis=0))

    @property
    def sizes(self) -> Array:
        """Sums of the squared right-hand sides, shape (r,)."""
        return np.asarray(self.total[:, -1, -1])

    def without(self, block: int) -> Array:
        """Sum over the other blocks, shape (r, p + 1, p + 1)."""
        return np.asarray(self.total - self.products[block])

    def of_columns(self, columns: Sequence[int]) -> BlockStatistics:
        """Statistics of some of the columns.

        Parameters
        ----------
        columns : sequence of int
        """
        kept = np.append(np.asarray(columns, dtype=np.intp), self.products.shape[2] - 1)
        return BlockStatistics(self.products[:, :, kept[:, None], kept], self.counts)
