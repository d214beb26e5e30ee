"""Motions written out, with exact derivatives, and integrals over them by Gauss and Legendre: the tests' oracles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from excite.trajectories import Fourier, Trajectory
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class Sines:
    """``q = centre + sum_k amplitude_k sin(frequency_k t + phase_k)``, of shapes (n,), (n, K), (K,), (n, K)."""

    centre: Array
    amplitude: Array
    frequency: Array
    phase: Array

    def at(self, time: Array, derivative: int) -> Array:
        angle = np.asarray(time)[:, None, None] * self.frequency + self.phase + derivative * np.pi / 2
        wave = np.sum(self.amplitude * self.frequency**derivative * np.sin(angle), axis=2)
        return wave + self.centre if derivative == 0 else wave

    def samples(self, time: Array) -> Samples:
        return Samples(time, *(self.at(time, d) for d in range(4)))


def random_samples(n: int, seed: int | np.random.Generator, count: int = 40, size: float = 1.0) -> Samples:
    """Random states of n joints, of no motion in particular."""
    q, dq, ddq = size * np.random.default_rng(seed).uniform(-2, 2, (3, count, n))
    return Samples(np.arange(float(count)), q, dq, ddq, np.zeros_like(q))


def random_sines(n: int, seed: int, waves: int = 3, size: float = 0.4) -> Sines:
    rng = np.random.default_rng(seed)
    amplitude = size * rng.uniform(0.3, 1.0, (n, waves)) / np.arange(1, waves + 1)
    frequency = np.pi * np.arange(1, waves + 1)
    return Sines(rng.uniform(-0.3, 0.3, n), amplitude, frequency, rng.uniform(0, 2 * np.pi, (n, waves)))


@cache
def random_fourier(
    n: int = 3, seed: int = 0, duration: float = 4.0, size: float = 0.25, harmonics: int = 4
) -> Trajectory:
    """A Fourier series of n joints with normal coefficients."""
    family = Fourier(duration, harmonics)
    return Trajectory(family, np.random.default_rng(seed).normal(0.0, size, (n, family.size)))


@dataclass(frozen=True, eq=False)
class Polynomials:
    """``q_j(t) = sum_k coefficients[k, j] t^k``."""

    coefficients: Array

    def at(self, time: Array, derivative: int) -> Array:
        slopes = np.polynomial.polynomial.polyder(self.coefficients, derivative)
        return np.polynomial.polynomial.polyval(np.asarray(time), slopes).T

    def samples(self, time: Array) -> Samples:
        return Samples(time, *(self.at(time, d) for d in range(4)))


def path_of_polynomial(coefficients: Array, start: float, end: float) -> float:
    """``int |dz| dt`` in closed form: from turning point to turning point."""
    turns = np.roots(np.polynomial.polynomial.polyder(coefficients)[::-1])
    real = np.sort([r.real for r in turns if abs(r.imag) <= 1e-12 and start < r.real < end])
    return float(np.abs(np.diff(np.polynomial.polynomial.polyval(np.array([start, *real, end]), coefficients))).sum())


def gauss(function: Callable[[Array], Array], start: float, end: float, pieces: int = 1, order: int = 40) -> Array:
    """Integral of a smooth function of time, whose values run along the first axis."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    edges = np.linspace(start, end, pieces + 1)
    total = 0.0
    for a, b in pairwise(edges):
        values = function(a + (b - a) * (nodes + 1) / 2)
        total = total + (b - a) / 2 * np.tensordot(weights, values, axes=1)
    return np.asarray(total)


def order_of(errors: list[float]) -> list[float]:
    """Order of convergence from errors at steps that are halved each time (Richardson)."""
    return [float(np.log2(coarse / fine)) for coarse, fine in pairwise(errors)]
