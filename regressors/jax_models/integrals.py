"""Integrals over time in JAX: running integrals by Simpson's rule, and lengths of paths."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np


def running_integral(values: jax.Array, spacing: float) -> jax.Array:
    """Integral from the first sample on, along the first axis; as SciPy's ``cumulative_simpson`` on uniform samples.

    Even intervals are integrated by the parabola through their ends and the next sample, odd ones and the last by that
    through their ends and the sample before.
    """  # values (N, ...)
    if values.shape[0] < 3:
        parts = (values[1:] + values[:-1]) * (spacing / 2)
    else:
        before, here, after = values[:-2], values[1:-1], values[2:]
        ahead = (5 * before + 8 * here - after) * (spacing / 12)
        behind = (5 * after + 8 * here - before) * (spacing / 12)
        interval = np.arange(values.shape[0] - 1)
        even = (interval % 2 == 0) & (interval < interval[-1])
        even = even.reshape(-1, *(1,) * (values.ndim - 1))
        parts = jnp.where(even, jnp.concatenate([ahead, ahead[-1:]]), jnp.concatenate([behind[:1], behind]))
    return jnp.concatenate([jnp.zeros_like(values[:1]), jnp.cumsum(parts, axis=0)])


def path_lengths(z: jax.Array, dz: jax.Array, spacing: float) -> jax.Array:
    """``int |dz| dt`` from the first sample on, exact for cubics through the samples' positions and velocities."""
    # z, dz (N, k)
    a, b, rise = dz[:-1], dz[1:], z[1:] - z[:-1]
    # velocity of the cubic at fraction s of an interval: a + slope s + curve s^2
    curve = 3 * (a + b - 2 * rise / spacing)
    slope = b - a - curve
    root = jnp.sqrt(jnp.maximum(slope**2 - 4 * curve * a, 0.0))
    divisor = -0.5 * (slope + jnp.where(slope >= 0, root, -root))
    turns = jnp.stack([_quotient(divisor, curve), _quotient(a, divisor)])
    parts = jnp.sort(jnp.clip(turns, 0.0, 1.0), axis=0)
    reached = spacing * parts * (a + parts * (slope / 2 + parts * curve / 3))
    length = jnp.abs(reached[0]) + jnp.abs(reached[1] - reached[0]) + jnp.abs(rise - reached[1])
    return jnp.concatenate([jnp.zeros_like(z[:1]), jnp.cumsum(length, axis=0)])


def _quotient(a: jax.Array, b: jax.Array) -> jax.Array:
    """``a / b``; zero where ``b`` is zero."""
    return jnp.where(b == 0.0, 0.0, a / jnp.where(b == 0.0, 1.0, b))
