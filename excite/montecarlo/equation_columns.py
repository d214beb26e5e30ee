"""Regressor of a motion as one matrix per equation, without the columns that are zero by its structure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from excite.identification.decimated_rows import Decimation
from regressors.models.model import RegressorModel
from regressors.samples import Array, Index, Samples

BLOCK = 1024  # instants: what is computed for them stays in the cache of a core
Part = tuple[slice, Sequence[Array]]


class EquationColumns:
    """Base columns of each equation of a model."""  # index (b,)

    def __init__(self, model: RegressorModel, index: Index, decimation: Decimation | None = None) -> None:
        self.model, self.index, self.decimation = model, index, decimation
        self.direct = is_direct(model)
        self.used: list[Index] = [np.arange(index.size)] * len(model.row_labels)
        if self.direct:
            entries, self.used = _entries(model, index)
            self._ends = np.cumsum([0, *(k.size for k in entries)])
            self._function = model.function.selection(np.concatenate(entries))

    def parts(self, samples: Samples) -> Iterator[Part]:
        """Columns along a motion, in blocks of rows."""  # result (p_j, k)
        if not self.direct:
            W = self.model.assembled_entries(samples, self.index)
            yield slice(0, W.shape[2]), self._filtered(list(W))
            return
        count = samples.time.size
        block = BLOCK if self.decimation is None else count
        motion = [np.ascontiguousarray(x.T) for x in (samples.q, samples.dq, samples.ddq)]
        for first in range(0, count, block):
            rows = slice(first, min(first + block, count))
            values = self._function(*(x[:, rows] for x in motion))
            yield rows, self._filtered([values[i:k] for i, k in zip(self._ends, self._ends[1:], strict=False)])

    def _filtered(self, X: list[Array]) -> list[Array]:
        if self.decimation is None:
            return X
        return [np.ascontiguousarray(self.decimation(x.T).T) for x in X]


def is_direct(model: RegressorModel) -> bool:
    """Whether a model's rows are its expression at single instants."""
    own = type(model)
    return model.window is None and all(
        getattr(own, name) is getattr(RegressorModel, name) for name in ("assemble", "instants", "function")
    )


def entries_of_equations(model: RegressorModel, index: Index) -> list[int]:
    """Number of the columns of each equation, without those that are zero by its structure."""  # index (b,)
    if not is_direct(model):
        return [index.size] * len(model.row_labels)
    return [k.size for k in _entries(model, index)[0]]


def _entries(model: RegressorModel, index: Index) -> tuple[list[Index], list[Index]]:
    """Nonzeros of each equation in the model's function, and the base parameters that they belong to."""
    place = np.full(len(model.columns), -1)
    place[index] = np.arange(index.size)
    row, column = np.asarray(model.function.row), place[np.asarray(model.function.column)]
    entries = [np.flatnonzero((row == j) & (column >= 0)) for j in range(len(model.row_labels))]
    return entries, [column[k] for k in entries]
