"""Linear methods as matrices, from their impulse responses, in blocks of rows for batches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from excite.signals.low_pass import parallel_filtered
from excite.signals.method import Method
from regressors.errors import InputError
from regressors.samples import Array, Index

_ROWS = 128
_CHUNK = 256
_NOTHING = 1e-16  # part of the largest weight that counts as nothing
_AGREEMENT = 1e-9  # of the largest value


@dataclass(frozen=True, eq=False)
class Blocks:
    """Banded matrices: the rows of a block use the same stretch of the input.

    Parameters
    ----------
    start : ndarray of int, shape (blocks,)
        First sample of each block's stretch.
    weights : ndarray, shape (blocks, d, rows, S)
        Of d matrices; where they are full, S is the whole input.
    count : int
        Rows of each matrix, M; zeros fill up the last block.
    """

    start: Index
    weights: Array
    count: int

    def __call__(self, x: jax.Array) -> jax.Array:
        """The matrices times columns, shapes (N, k) to (d, M, k)."""

        def block(of: tuple[jax.Array, jax.Array]) -> jax.Array:
            start, weights = of
            return jnp.matmul(weights, jax.lax.dynamic_slice_in_dim(x, start, weights.shape[-1]))

        values = jax.lax.map(block, (jnp.asarray(self.start), jnp.asarray(self.weights)))  # (blocks, d, rows, k)
        return jnp.moveaxis(values, 1, 0).reshape(self.weights.shape[1], -1, x.shape[1])[:, : self.count]


jax.tree_util.register_dataclass(Blocks, data_fields=["start", "weights"], meta_fields=["count"])


def blocks_of(function: Callable[[Array], Array], count: int) -> Blocks:
    """Matrices of a linear function of columns.

    The impulse responses are computed twice, once to find their extent; the full matrices are never stored.

    Parameters
    ----------
    function : callable
        From shape (count, k) to (d, M, k), for any k.
    count : int
    """
    middle = function(np.eye(count, 1, -(count // 2)))
    d, M = middle.shape[:2]
    nothing = _NOTHING * np.abs(middle).max(axis=(1, 2))[:, None, None]
    rows = min(_ROWS, M)
    blocks = -(-M // rows)
    seen = np.zeros((blocks, count), dtype=bool)
    for part, values in _responses(function, count):
        reached = np.any(np.abs(values) > nothing, axis=0)  # (M, k)
        seen[:, part] = np.add.reduceat(reached, np.arange(0, M, rows), axis=0) > 0
    first, last = np.argmax(seen, axis=1), count - 1 - np.argmax(seen[:, ::-1], axis=1)
    reach = int((last - first).max()) + 1
    start = np.minimum(first, count - reach)
    weights = np.zeros((blocks, d, rows, reach))
    for part, values in _responses(function, count):
        for k in range(blocks):
            a, b = max(part.start, start[k]), min(part.stop, start[k] + reach)
            if a < b:
                own = values[:, k * rows : (k + 1) * rows, a - part.start : b - part.start]
                weights[k, :, : own.shape[1], a - start[k] : b - start[k]] = own
    return Blocks(start, weights, M)


def _responses(function: Callable[[Array], Array], count: int) -> Iterator[tuple[slice, Array]]:
    """Impulse responses of a function, in chunks."""
    for first in range(0, count, _CHUNK):
        part = slice(first, min(first + _CHUNK, count))
        yield part, function(np.eye(count, part.stop - first, -first))


def motion_matrices(method: Method, time: Array, q: Array) -> Blocks:
    """Matrices from positions to the position, velocity and acceleration of a method, at the instants it keeps.

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
        f"method {method.name!r} is not a fixed linear function of the positions; repetitions need one whose settings "
        "(cutoff, window, knots) are given, not chosen from the data"
    )
    kept, expected = _state(method, time, q)

    def state(impulses: Array) -> Array:
        try:
            part, values = _state(method, time, impulses)
        except InputError as error:  # the method accepts the motion, but refuses impulses
            raise refusal from error
        if part != kept:
            raise refusal
        return values

    matrices = blocks_of(state, time.size)
    with jax.enable_x64(True):
        stacked = np.asarray(matrices(jnp.asarray(q)))
    if np.any(np.abs(stacked - expected).max(axis=(1, 2)) > _AGREEMENT * np.abs(expected).max(axis=(1, 2))):
        raise refusal
    return matrices


def _state(method: Method, time: Array, q: Array) -> tuple[slice, Array]:
    motion = method.motion(time, q)
    return motion.kept, np.stack([motion.samples.q, motion.samples.dq, motion.samples.ddq])


def filter_matrix(count: int, rate: float, cutoff: float | None, every: int) -> Blocks:
    """The low-pass of both sides of the equations, `excite.signals.low_pass.parallel_filtered`, then decimation.

    Parameters
    ----------
    count : int
        Rows of each equation.
    rate : float
        [Hz]
    cutoff : float, optional
        Without one, rows are only decimated [Hz].
    every : int
        Decimation factor of the remaining rows.
    """

    def rows(x: Array) -> Array:
        if cutoff is None:
            return x[None, ::every]
        return parallel_filtered(x[:, :, None], x, rate, cutoff)[1][None, ::every]

    return blocks_of(rows, count)
