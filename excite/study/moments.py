"""Second moments of the rows of each equation, summed over blocks of rows, and what estimators make of them.

The estimators are those of `excite.identification`, with the same formulas on second moments of the rows. Moments
``[W e]'[W e]`` take a third of the time of triangular factors. They hold the errors ``e = y - W beta`` at the true beta
in place of y, so that what rounding does to them is small compared with the scatter, not with the parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import entry_points
from typing import Any

import numpy as np
import scipy

from excite.identification.streamed_rows import Decimation
from regressors.models.model import RegressorModel
from regressors.samples import Array, Index, Samples


@dataclass(frozen=True, eq=False)
class MomentSums:
    """How rows become moments of ``[W P, e]``, or of ``[Z P, W P, e]`` with instruments Z; ``e = y - W beta``."""

    used: list[Index]  # base parameters of each equation's columns
    beta: Array  # (b,) True parameters
    change: Array | None = None  # (b, b) matrix P by which columns are multiplied; none if not given
    instruments: list[Array] | None = None  # (p_j, m) transposed columns of Z

    @property
    def size(self) -> int:
        """Columns whose moments are summed, with e."""
        return (1 if self.instruments is None else 2) * self.beta.size + 1

    def of(self, parts: Iterable[Part], y: Array) -> Array:
        """Moments of all rows, shape (r, k, k)."""  # y (m, r)
        G = np.zeros((len(self.used), self.size, self.size))
        for rows, X in parts:
            for j, x in enumerate(X):
                A = np.vstack([self._columns(j, rows, x), y[rows, j] - self.beta[self.used[j]] @ x])
                G[j][np.ix_(self._places[j], self._places[j])] += A @ A.T
        return G

    def shared(self, parts: Iterable[Part]) -> Array:
        """Moments of the columns alone, for `with_errors`, shape (r, k, k)."""
        held = list(parts)
        G = self.of(held, np.zeros((held[-1][0].stop, len(self.used))))
        G[:, -1, :] = G[:, :, -1] = 0.0
        return G

    def with_errors(self, shared: Array, parts: Iterable[Part], e: Array) -> Array:
        """Moments of columns that are those of `shared`, with other errors, shape (r, k, k)."""
        # shared (r, k, k); e (m, r)
        G = shared.copy()
        for rows, X in parts:
            for j, x in enumerate(X):
                error = e[rows, j]
                c = np.append(self._columns(j, rows, x) @ error, error @ error)
                G[j][self._places[j], -1] += c
                G[j][-1, self._places[j][:-1]] += c[:-1]
        return G

    @cached_property
    def _places(self) -> list[Index]:
        """Places of each equation's columns, and of e, among all of them."""
        b, last = self.beta.size, self.size - 1
        own = self.used if self.change is None else [np.arange(b)] * len(self.used)
        front = [] if self.instruments is None else [0]
        return [np.concatenate([*(k + place for k in front), last - b + place, [last]]) for place in own]

    def _columns(self, j: int, rows: slice, x: Array) -> Array:
        """Transposed columns ``[Z P, W P]`` of some rows of an equation."""
        W = self._mixed(x, self.used[j])
        return W if self.instruments is None else np.vstack([self._instruments[j][:, rows], W])

    @cached_property
    def _instruments(self) -> list[Array]:
        """Transposed columns of ``Z P``."""
        return [self._mixed(z, used) for z, used in zip(self.instruments or (), self.used, strict=True)]

    def _mixed(self, x: Array, used: Index) -> Array:
        return x if self.change is None else self.change[used].T @ x


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


_AT_ONCE = 3e7  # numbers of the rows of a batch, 0.24 GB, of which the device holds several copies
_MOST = 64  # repetitions of a batch


@cache
def has_gpu() -> bool:
    """Whether JAX computes on a GPU here; without a plug-in for one JAX is not even imported."""
    if not entry_points(group="jax_plugins"):
        return False
    try:
        import jax

        return bool(jax.default_backend() == "gpu")
    except (ImportError, RuntimeError):
        return False


def has_jax_form(columns: EquationColumns) -> bool:
    """Whether JAX computes a model and its equations."""
    return columns.model.jax_form is not None and columns.decimation is None


class JaxMoments:
    """`MomentSums.of` for batches of repetitions."""

    def __init__(self, sums: MomentSums, columns: EquationColumns) -> None:
        from regressors.jax_models import JaxModel

        self._sums, self._columns = sums, columns
        self._model = JaxModel(columns.model, columns.index)

    def batch(self, instants: int) -> int:
        """Repetitions whose rows fit at once."""
        width = len(self._columns.used) * self._sums.size
        return max(1, min(_MOST, int(_AT_ONCE / (instants * width))))

    def __call__(self, measured: Sequence[tuple[Samples, Array]]) -> Array:
        """Moments of each repetition, shape (R, r, k, k), from its motion and its left-hand sides."""
        import jax

        time = measured[0][0].time
        whole = [*measured, *[measured[-1]] * (self.batch(time.size) - len(measured))]  # of one size: compiled once
        motion = (np.stack([getattr(samples, name) for samples, _ in whole]) for name in ("q", "dq", "ddq"))
        with jax.enable_x64(True):
            y = np.stack([y for _, y in whole])
            G = self._compiled(tuple(time.tolist()), *motion, y, self._instruments)
            return np.asarray(G)[: len(measured)]

    @cached_property
    def _compiled(self) -> Any:
        import jax

        return jax.jit(self._moments, static_argnums=0)

    def _moments(self, time: tuple[float, ...], *arrays: Any) -> Any:
        """Of the batch's q, dq, ddq and y, and of the instruments."""
        import jax.numpy as jnp

        *motion, y, instruments = arrays
        W = self._model.assemble(np.array(time), *motion)
        e = y - W @ jnp.asarray(self._sums.beta)
        A = W if self._sums.change is None else W @ jnp.asarray(self._sums.change)
        A = jnp.concatenate([A, e[..., None]], axis=-1)
        if self._sums.instruments is not None:
            Z = jnp.broadcast_to(instruments, (*A.shape[:-1], self._sums.beta.size))
            A = jnp.concatenate([Z, A], axis=-1)
        return jnp.einsum("tmri,tmrj->trij", A, A)

    @cached_property
    def _instruments(self) -> Array:
        """Columns ``Z P`` of the instruments, shape (m, r, b); empty without any."""
        if self._sums.instruments is None:
            return np.zeros((0, 0, 0))
        rows = self._sums.instruments[0].shape[1]
        Z = np.zeros((rows, len(self._sums.used), self._sums.beta.size))
        for j, (x, used) in enumerate(zip(self._sums.instruments, self._sums.used, strict=True)):
            Z[:, j, used] = x.T
        return Z if self._sums.change is None else Z @ self._sums.change


_ITERATIONS = 500
_SETTLED = 1e-9
_FLOOR = 1e-11


@dataclass(frozen=True, eq=False)
class Moments:
    """Second moments of the rows of each of r equations."""

    G: Array  # (r, k, k) ``A'A`` of ``A = [W e]``, or of ``[Z W e]`` with instruments Z
    count: int  # rows of each equation
    sizes: Array  # (r,) root mean square of y within each equation

    @property
    def floor(self) -> Array:
        """Least noise of each equation: residuals of exact data are rounding errors, shape (r,)."""
        return _FLOOR * np.where(self.sizes > 0, self.sizes, 1.0)

    def weighted(self, scale: Array) -> Array:
        """Moments of all rows divided by their equation's scale, shape (k, k)."""
        return np.asarray(np.tensordot(1 / scale**2, self.G, 1))

    def leverages(self, half: Array) -> Array:
        """``tr(W_g H H' W_g')`` of each equation, shape (r,)."""
        return np.asarray(np.tensordot(self.G[:, :-1, :-1], half @ half.T, 2))

    def noise(self, error: Array, spare: Array) -> Array:
        """Root of the sum of squared residuals over the redundant rows, shape (r,); `error` is that of beta."""
        signed = np.append(error, -1.0)
        squares = np.einsum("i,rij,j->r", signed, self.G, signed)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0) / spare))


# of one repetition: the estimate less the true value, (b,); a root of the covariance that the formula of the estimator
# predicts from this repetition's residuals, (b, b); the standard deviation of each equation's residuals, (r,)
Solved = tuple[Array, Array, Array]


def least_squares(moments: Moments) -> Solved:
    """Unweighted, with covariance ``s^2 (W'W)^-1``; see `excite.identification.estimators.least_squares`."""
    G = moments.weighted(np.ones(len(moments.G)))
    error, half = _solution(G)
    freedom = len(moments.G) * moments.count - error.size
    variance = max(float(G[-1, -1] - G[:-1, -1] @ error), 0.0) / freedom
    return error, np.sqrt(variance) * half, moments.noise(error, moments.count - moments.leverages(half))


def weighted(moments: Moments) -> Solved:
    """Rows divided by the noise of their equation, a fixed point, with covariance ``(W' Sigma^-1 W)^-1``."""
    return _with_weights(moments, _weights(moments))


def instrumental(moments: Moments) -> Solved:
    """``(Z' Sigma^-1 W)^-1 Z' Sigma^-1 y`` with the noise-free regressor Z, as the estimator ``instrumental``."""
    b = moments.G.shape[1] // 2
    rows = Moments(moments.G[:, b:, b:], moments.count, moments.sizes)
    spare = np.full(len(moments.G), moments.count * (1 - b / (len(moments.G) * moments.count)))

    def solution_at(scale: Array) -> tuple[Array, Array]:
        G = moments.weighted(scale)
        A = _inverse_root(G[:b, :b]).T @ G[:b, b:]  # Q'[W e] with Z = QT
        half = np.asarray(np.linalg.inv(A[:, :b]), dtype=float)
        return half @ A[:, b], half

    scale = _fixed_point(lambda scale: np.maximum(rows.noise(solution_at(scale)[0], spare), rows.floor), _weights(rows))
    error, half = solution_at(scale)
    return error, half, rows.noise(error, spare)


ESTIMATORS: dict[str, Callable[[Moments], Solved]] = {
    "least-squares": least_squares,
    "weighted": weighted,
    "instrumental": instrumental,
}


def _inverse_root(M: Array) -> Array:
    """Upper triangular H with ``H H' = M^-1``, columns scaled to length one in between."""
    sizes = np.sqrt(np.diag(M))
    R = scipy.linalg.cholesky(M / np.outer(sizes, sizes))
    return np.asarray(scipy.linalg.solve_triangular(R, np.eye(len(M))) / sizes[:, None])


def _solution(G: Array) -> tuple[Array, Array]:
    """Error of the least-squares estimate, and a root of its covariance for unit noise, from the moments."""
    half = _inverse_root(G[:-1, :-1])
    return half @ (half.T @ G[:-1, -1]), half


def _with_weights(moments: Moments, scale: Array) -> Solved:
    error, half = _solution(moments.weighted(scale))
    return error, half, moments.noise(error, moments.count - moments.leverages(half) / scale**2)


def _weights(moments: Moments) -> Array:
    noise = lambda scale: np.maximum(_with_weights(moments, scale)[2], moments.floor)  # noqa: E731
    return _fixed_point(noise, moments.floor / _FLOOR)


def _fixed_point(updated: Callable[[Array], Array], scale: Array) -> Array:
    for _ in range(_ITERATIONS):
        before, scale = scale, updated(scale)
        if not np.abs(np.log(scale / before)).max() > _SETTLED:
            break
    return scale
