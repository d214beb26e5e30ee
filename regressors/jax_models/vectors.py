"""Products of vectors and matrices of many instants: components run along the axes before the last, instants last."""

from __future__ import annotations

import jax
import jax.numpy as jnp


def dot(a: jax.Array, b: jax.Array) -> jax.Array:
    """``a . b``, shapes (..., 3, L) to (..., L)."""
    return a[..., 0, :] * b[..., 0, :] + a[..., 1, :] * b[..., 1, :] + a[..., 2, :] * b[..., 2, :]


def cross(a: jax.Array, b: jax.Array) -> jax.Array:
    """``a x b``, shapes (..., 3, L)."""
    (ax, ay, az), (bx, by, bz) = ((v[..., 0, :], v[..., 1, :], v[..., 2, :]) for v in (a, b))
    return jnp.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-2)


def times_inertia(s: jax.Array, x: jax.Array) -> jax.Array:
    """``s'[. x]`` with ``I x = [. x] (Ixx, Ixy, Ixz, Iyy, Iyz, Izz)``, (..., 6, L) [KD96] eq. (9)."""
    (s0, s1, s2), (x0, x1, x2) = ((v[..., 0, :], v[..., 1, :], v[..., 2, :]) for v in (s, x))
    return jnp.stack([s0 * x0, s0 * x1 + s1 * x0, s0 * x2 + s2 * x0, s1 * x1, s1 * x2 + s2 * x1, s2 * x2], axis=-2)


def turned(R: jax.Array, v: jax.Array) -> jax.Array:
    """``R v``, shapes (..., 3, 3, L) and (..., 3, L)."""
    return R[..., 0, :] * v[..., None, 0, :] + R[..., 1, :] * v[..., None, 1, :] + R[..., 2, :] * v[..., None, 2, :]


def turned_back(R: jax.Array, v: jax.Array) -> jax.Array:
    """``R' v``, shapes (..., 3, 3, L) and (..., 3, L)."""
    x, y, z = v[..., 0, None, :], v[..., 1, None, :], v[..., 2, None, :]
    return R[..., 0, :, :] * x + R[..., 1, :, :] * y + R[..., 2, :, :] * z


def product(A: jax.Array, B: jax.Array) -> jax.Array:
    """``A B``, shapes (3, 3, L)."""
    return A[:, 0, None] * B[None, 0] + A[:, 1, None] * B[None, 1] + A[:, 2, None] * B[None, 2]
