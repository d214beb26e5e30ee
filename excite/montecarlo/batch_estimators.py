"""The estimators of `excite.identification` for batches: the same formulas on triangular factors, in JAX.

All of them work on one triangular factor per group of rows, so no normal equations are formed and columns of any size
and condition numbers up to about 1e12 do no harm.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl

_ITERATIONS = 500
_SETTLED = 1e-9
_FLOOR = 1e-11


class Solved(NamedTuple):
    """One repetition's estimate.

    Parameters
    ----------
    values : Array, shape (b,)
    deviation : Array, shape (b,)
        As the formula of the estimator predicts it from this repetition's residuals.
    noise : Array, shape (r,)
        Standard deviation of each equation's residuals.
    """

    values: jax.Array
    deviation: jax.Array
    noise: jax.Array


class _Triangle(NamedTuple):
    values: jax.Array  # (b,)
    half: jax.Array  # (b, b), half half' = (A'A)^-1
    square: jax.Array


def group_factors(*columns: jax.Array) -> jax.Array:
    """Triangular factors of ``[W y]``, or of ``[Z W y]``, one per equation, shape (r, k, k) for k columns.

    Parameters
    ----------
    *columns : Array, shape (m, r, .)
        Z, W and y of m rows of each of the r equations.
    """
    rows = jnp.moveaxis(jnp.concatenate(columns, axis=2), 0, 1)  # (r, m, k)
    missing = max(0, rows.shape[2] - rows.shape[1])
    return jnp.linalg.qr(jnp.pad(rows, ((0, 0), (0, missing), (0, 0))), mode="r")


def least_squares(R: jax.Array, count: int) -> Solved:
    """Unweighted, with covariance ``s^2 (W'W)^-1``; see `excite.identification.estimators.least_squares`.

    Parameters
    ----------
    R : Array, shape (r, b + 1, b + 1)
        Factors of ``[W y]``, see `group_factors`.
    count : int
        Rows of each equation.
    """
    solution = _triangle(_stacked(R, jnp.ones(len(R))))
    freedom = len(R) * count - len(solution.values)
    deviation = jnp.sqrt(solution.square / freedom) * jnp.linalg.norm(solution.half, axis=1)
    return Solved(solution.values, deviation, _residual_noise(R, solution, count - _leverages(R, solution.half)))


def weighted(R: jax.Array, count: int) -> Solved:
    """Rows divided by the noise of their equation, a fixed point, with covariance ``(W' Sigma^-1 W)^-1``.

    See `excite.identification.weights`; parameters as for `least_squares`.
    """
    scale = _weights(R, count)
    solution = _triangle(_stacked(R, scale))
    spare = count - _leverages(R, solution.half) / scale**2
    return Solved(solution.values, jnp.linalg.norm(solution.half, axis=1), _residual_noise(R, solution, spare))


def instrumental(factors: jax.Array, count: int) -> Solved:
    """``(Z' Sigma^-1 W)^-1 Z' Sigma^-1 y`` with the noise-free regressor Z, as the estimator ``instrumental``.

    Parameters
    ----------
    factors : Array, shape (r, 2b + 1, 2b + 1)
        Factors of ``[Z W y]``, see `group_factors`.
    count : int
        Rows of each equation.
    """
    b = factors.shape[2] // 2
    R = factors[:, :, b:]
    spare = count * (1 - b / (len(R) * count))

    def solution_at(scale: jax.Array) -> _Triangle:
        A = _stacked(factors, scale)[:b, b:]  # Q'[W y]
        half = jnp.linalg.inv(A[:, :b])
        return _Triangle(half @ A[:, b], half, jnp.zeros(()))

    def updated(scale: jax.Array) -> jax.Array:
        noise = _residual_noise(R, solution_at(scale), jnp.full(len(R), spare))
        return jnp.maximum(noise, _floor(R, count))

    solution = solution_at(_fixed_point(updated, _weights(R, count)))
    noise = _residual_noise(R, solution, jnp.full(len(R), spare))
    return Solved(solution.values, jnp.linalg.norm(solution.half, axis=1), noise)


ESTIMATORS: dict[str, Callable[[jax.Array, int], Solved]] = {
    "least-squares": least_squares,
    "weighted": weighted,
    "instrumental": instrumental,
}


def _stacked(R: jax.Array, scale: jax.Array) -> jax.Array:
    """Triangular factor of all rows divided by their group's scale."""
    return jnp.linalg.qr((R / scale[:, None, None]).reshape(-1, R.shape[2]), mode="r")


def _triangle(R: jax.Array) -> _Triangle:
    b = R.shape[1] - 1
    half = jsl.solve_triangular(R[:b, :b], jnp.eye(b))
    return _Triangle(jsl.solve_triangular(R[:b, :b], R[:b, b]), half, R[b, b] ** 2)


def _leverages(R: jax.Array, half: jax.Array) -> jax.Array:
    """``tr(W_g H H' W_g')`` of each group."""
    return jnp.sum((R[:, :, :-1] @ half) ** 2, axis=(1, 2))


def _residual_noise(R: jax.Array, solution: _Triangle, spare: jax.Array) -> jax.Array:
    squares = jnp.sum((R @ jnp.append(solution.values, -1.0)) ** 2, axis=1)
    return jnp.sqrt(squares / spare)


def _floor(R: jax.Array, count: int) -> jax.Array:
    sizes = jnp.linalg.norm(R[:, :, -1], axis=1) / jnp.sqrt(count)
    return _FLOOR * jnp.where(sizes > 0, sizes, 1.0)


def _weights(R: jax.Array, count: int) -> jax.Array:
    def updated(scale: jax.Array) -> jax.Array:
        solution = _triangle(_stacked(R, scale))
        spare = count - _leverages(R, solution.half) / scale**2
        return jnp.maximum(_residual_noise(R, solution, spare), _floor(R, count))

    return _fixed_point(updated, _floor(R, count) / _FLOOR)


def _fixed_point(updated: Callable[[jax.Array], jax.Array], start: jax.Array) -> jax.Array:
    def unsettled(state: tuple[jax.Array, jax.Array, jax.Array]) -> jax.Array:
        _, change, rounds = state
        return (change > _SETTLED) & (rounds < _ITERATIONS)

    def following(state: tuple[jax.Array, jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array, jax.Array]:
        scale, _, rounds = state
        new = updated(scale)
        return new, jnp.abs(jnp.log(new / scale)).max(), rounds + 1

    return jax.lax.while_loop(unsettled, following, (start, jnp.array(jnp.inf), jnp.array(0)))[0]
