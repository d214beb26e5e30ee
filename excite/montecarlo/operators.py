"""Linear methods as matrices, from what they make of impulses, in blocks of rows for batches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse

from excite.signals.low_pass import parallel_filtered
from excite.signals.method import Method
from regressors.errors import InputError
from regressors.samples import Array, Index

_ROWS = 128
_CHUNK = 256
_NOTHING = 1e-17  # part of the largest entry that counts as nothing
_AGREEMENT = 1e-9  # of the largest value


@dataclass(frozen=True, eq=False)
class Blocks:
    """A matrix whose rows reach only so far: the rows of a block see the same stretch of the input.

    Parameters
    ----------
    start : ndarray of int, shape (blocks,)
        First sample of each block's stretch.
    weights : ndarray, shape (blocks, rows, S)
    count : int
        Rows of the matrix; zeros fill up the last block.
    """

    start: Index
    weights: Array
    count: int

    @classmethod
    def of(cls, matrix: scipy.sparse.csr_array) -> Blocks:
        """Blocks of a sparse matrix; where it is full each stretch is the whole input."""
        count, width = matrix.shape
        parts = [matrix[k : k + _ROWS] for k in range(0, count, _ROWS)]
        first = np.array([part.indices.min(initial=width - 1) for part in parts])
        last = np.array([part.indices.max(initial=0) for part in parts])
        reach = max(1, int((last - first).max()) + 1)
        start = np.clip(first, 0, width - reach)
        weights = np.zeros((len(parts), min(_ROWS, count), reach))
        for block, part, k in zip(weights, parts, start, strict=True):
            block[: part.shape[0]] = part[:, k : k + reach].toarray()
        return cls(start, weights, count)

    def __call__(self, x: jax.Array) -> jax.Array:
        """The matrix times columns, shapes (N, k) to (count, k)."""
        stretches = x[self.start[:, None] + np.arange(self.weights.shape[2])]  # (blocks, S, k)
        return jnp.matmul(self.weights, stretches).reshape(-1, x.shape[1])[: self.count]


jax.tree_util.register_dataclass(Blocks, data_fields=["start", "weights"], meta_fields=["count"])


def matrix_of(function: Callable[[Array], Array], count: int) -> scipy.sparse.csr_array:
    """Matrix of a linear function of columns.

    Parameters
    ----------
    function : callable
        From shape (count, k) to (M, k), for any k.
    count : int

    Returns
    -------
    sparse array, shape (M, count)
    """
    columns = []
    for first in range(0, count, _CHUNK):
        impulses = np.eye(count, min(_CHUNK, count - first), -first)
        columns.append(scipy.sparse.csc_array(function(impulses)))
    matrix = scipy.sparse.hstack(columns, format="csr")
    matrix.data[np.abs(matrix.data) < _NOTHING * np.abs(matrix.data).max(initial=0.0)] = 0.0
    matrix.eliminate_zeros()
    return matrix


def motion_matrices(method: Method, time: Array, q: Array) -> tuple[Blocks, Blocks, Blocks]:
    """Matrices of the position, velocity and acceleration that a method makes of positions, at the instants it keeps.

    Parameters
    ----------
    method : Method
    time : ndarray, shape (N,)
        Uniform [s].
    q : ndarray, shape (N, n)
        Motion on which the matrices are checked against the method [rad or m].

    Raises
    ------
    InputError
        The method is not one linear function of the positions, the same for every joint, to 1e-9 of the largest value.
    """
    refusal = InputError(
        f"method {method.name!r} is no fixed linear function of the positions; repetitions need one whose settings "
        "(cutoff, window, knots) are given, not chosen from the data"
    )
    kept, expected = _state(method, time, q)

    def state(impulses: Array) -> Array:
        slice_, values = _state(method, time, impulses)
        if slice_ != kept:
            raise refusal
        return values

    matrix = matrix_of(state, time.size)
    parts = [matrix[k * matrix.shape[0] // 3 : (k + 1) * matrix.shape[0] // 3] for k in range(3)]
    for part, values in zip(parts, np.split(expected, 3), strict=True):
        if np.abs(part @ q - values).max() > _AGREEMENT * np.abs(values).max():
            raise refusal
    return Blocks.of(parts[0]), Blocks.of(parts[1]), Blocks.of(parts[2])


def _state(method: Method, time: Array, q: Array) -> tuple[slice, Array]:
    motion = method.motion(time, q)
    return motion.kept, np.concatenate([motion.samples.q, motion.samples.dq, motion.samples.ddq])


def filter_matrix(count: int, rate: float, cutoff: float | None, every: int) -> Blocks:
    """The low-pass of both sides of the equations, `excite.signals.low_pass.parallel_filtered`, then decimation.

    Parameters
    ----------
    count : int
        Rows of each equation.
    rate : float
        [Hz]
    cutoff : float, optional
        Without one rows are only left out [Hz].
    every : int
        Of the rows that are left, each so many-th is kept.
    """

    def rows(x: Array) -> Array:
        if cutoff is None:
            return x[::every]
        return parallel_filtered(x[:, :, None], x, rate, cutoff)[1][::every]

    return Blocks.of(matrix_of(rows, count))
