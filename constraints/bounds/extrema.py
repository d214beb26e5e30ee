"""Exact extrema of trigonometric polynomials over continuous time, from the roots of their derivative."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Extrema:
    """Smallest and largest value of k functions of time, and when they occur.

    Parameters
    ----------
    low, high : ndarray, shape (k,)
    low_time, high_time : ndarray, shape (k,)
        [s]
    """

    low: Array
    high: Array
    low_time: Array
    high_time: Array


def evaluate(constant: Array, cosine: Array, sine: Array, angle: Array) -> Array:
    """``constant + sum_k cosine_k cos(k angle) + sine_k sin(k angle)``, angles per function, shape (k, N)."""
    order = np.arange(1, cosine.shape[1] + 1)
    phase = angle[:, :, None] * order
    return np.asarray(
        constant[:, None]
        + np.einsum("kno,ko->kn", np.cos(phase), cosine)
        + np.einsum("kno,ko->kn", np.sin(phase), sine)
    )


def _stationary_angles(cosine: Array, sine: Array) -> Array:
    """Angles of all roots of the derivative, as a polynomial in exp(i angle); shape (k, 2K)."""
    count, K = cosine.shape
    order = np.arange(1, K + 1)
    half = 0.5 * order * (sine + 1j * cosine)  # of exp(i k angle); exp(-i k angle) has the conjugate
    polynomial = np.zeros((count, 2 * K + 1), dtype=complex)
    polynomial[:, K + 1 :] = half
    polynomial[:, :K] = np.conj(half[:, ::-1])
    angles = np.zeros((count, 2 * K))
    for k, row in enumerate(polynomial):
        size = np.abs(row).max()
        if size > 0.0:
            roots = np.roots(np.where(np.abs(row) > 1e-15 * size, row, 0.0)[::-1])
            angles[k, : roots.size] = np.angle(roots)
    return angles


def trigonometric_extrema(constant: Array, cosine: Array, sine: Array, omega: float) -> Extrema:
    """Extrema of ``constant + sum_k cosine_k cos(k omega t) + sine_k sin(k omega t)`` over all t.

    The derivative is a polynomial of degree 2K in ``exp(i omega t)``; its roots on the unit circle are the stationary
    instants. Each root's angle is polished by Newton's method, and a grid of 8 K instants is added, which keeps the
    result accurate where roots are nearly double.
    """  # constant (k,); cosine, sine (k, K)
    K = cosine.shape[1]
    order = np.arange(1, K + 1)
    angle = _stationary_angles(cosine, sine)
    for _ in range(3):
        slope = evaluate(np.zeros_like(constant), order * sine, -order * cosine, angle)
        bend = evaluate(np.zeros_like(constant), -(order**2) * cosine, -(order**2) * sine, angle)
        step = np.divide(slope, bend, out=np.zeros_like(slope), where=np.abs(bend) > 1e-12 * np.abs(slope))
        angle = angle - np.clip(step, -0.1, 0.1)
    grid = np.broadcast_to(np.linspace(0.0, 2 * np.pi, 8 * K, endpoint=False), (constant.size, 8 * K))
    angle = np.mod(np.concatenate([angle, grid], axis=1), 2 * np.pi)
    value = evaluate(constant, cosine, sine, angle)
    rows, low, high = np.arange(constant.size), value.argmin(axis=1), value.argmax(axis=1)
    return Extrema(value[rows, low], value[rows, high], angle[rows, low] / omega, angle[rows, high] / omega)
