"""Sums of products of each block: all that least squares with blocks left out needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regressors.errors import InputError
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class BlockStatistics:
    """``[W y]' [W y]`` of every block and equation."""

    products: Array  # (B, r, p + 1, p + 1)
    counts: Index  # (B,) instants

    @classmethod
    def of(cls, W: Sequence[Array], y: Sequence[Array], blocks: Sequence[Index]) -> BlockStatistics:
        """Sums of the logs' rows."""  # W (N, r, p); y (N, r); blocks (N,)
        products, counts = [], []
        for Wk, yk, block in zip(W, y, blocks, strict=True):
            rows = [np.flatnonzero(block == number) for number in np.unique(block[block >= 0])]
            products.append(_products(Wk, yk, [_as_slice(index) for index in rows]))
            counts += [index.size for index in rows]
        if len(counts) < 2:
            raise InputError("too few rows to leave blocks of them out")
        return cls(np.concatenate(products), np.array(counts))

    @cached_property
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
        """Statistics of some of the columns."""
        kept = np.append(np.asarray(columns, dtype=np.intp), self.products.shape[2] - 1)
        return BlockStatistics(self.products[:, :, kept[:, None], kept], self.counts)


def _products(W: Array, y: Array, blocks: Sequence[slice | Index]) -> Array:
    """``[W y]' [W y]`` of the rows of each block, shape (B, r, p + 1, p + 1); columns of zeros are passed over."""
    _, r, p = W.shape
    entries = W.transpose(1, 2, 0)
    products = np.zeros((len(blocks), r, p + 1, p + 1))
    present = np.einsum("rpn,rpn->rp", entries, entries) > 0
    for j in range(r):
        used = np.flatnonzero(present[j])
        both, place = np.vstack([entries[j, used], y[:, j]]), np.append(used, p)
        for block, which in enumerate(blocks):
            rows = both[:, which]
            products[block, j][place[:, None], place] = rows @ rows.T
    return products


def _as_slice(index: Index) -> slice | Index:
    """Ascending numbers as a slice, where they follow each other."""
    first, last = int(index[0]), int(index[-1]) + 1
    return slice(first, last) if last - first == index.size else index
