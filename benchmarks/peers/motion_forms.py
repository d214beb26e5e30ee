"""Motions as the systems hand them over: finite Fourier series (`judge.Motion`), or polynomials in pieces.

Both have a period, values at any instants, and the instants among which all of their extrema are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from judge import Array, Motion as Series
from scipy.interpolate import PPoly


class Motion(Protocol):
    """What the judge looks at."""

    @property
    def period(self) -> float: ...

    def values(self, time: Array, derivative: int) -> Array: ...

    def extreme_times(self, derivative: int) -> Array: ...


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polynomials in pieces.

    Parameters
    ----------
    breaks : ndarray, shape (m + 1,)
        From zero to the period [s].
    coefficients : ndarray, shape (k, m, n)
        Highest power of the time since the piece's beginning first, as in SciPy's ``PPoly``.
    """

    breaks: Array
    coefficients: Array

    @property
    def period(self) -> float:
        """[s]"""
        return float(self.breaks[-1])

    def values(self, time: Array, derivative: int) -> Array:
        """Position (0), velocity (1) or acceleration (2) at given instants, shape (N, n)."""
        return np.asarray(PPoly(self.coefficients, self.breaks)(time, nu=derivative))

    def extreme_times(self, derivative: int) -> Array:
        """Both sides of every break, and all roots of the next derivative."""
        slopes = PPoly(self.coefficients, self.breaks).derivative(derivative + 1)
        inner = [roots[np.isfinite(roots)] for roots in slopes.roots(extrapolate=False)]
        return np.concatenate([self.breaks, np.nextafter(self.breaks[1:], 0.0), *inner])


def motion_of(plain: Mapping[str, Any]) -> Motion:
    """The motion that a system has printed."""
    if "breaks" in plain:
        return Pieces(np.array(plain["breaks"]), np.array(plain["coefficients"]))
    return Series.of(plain)


def combined(motion: Motion, L: Array) -> Motion:
    """The motion of ``L q``."""
    if isinstance(motion, Pieces):
        return replace(motion, coefficients=motion.coefficients @ L.T)
    assert isinstance(motion, Series)
    return Series(motion.period, L @ motion.offset, L @ motion.cosine, L @ motion.sine)


def drawn_together(motion: Motion, middle: Array, factor: float) -> Motion:
    """The motion ``middle + (q - middle) / factor``."""
    if isinstance(motion, Pieces):
        smaller = motion.coefficients / factor
        smaller[-1] += middle * (1 - 1 / factor)
        return replace(motion, coefficients=smaller)
    assert isinstance(motion, Series)
    offset = middle + (motion.offset - middle) / factor
    return Series(motion.period, offset, motion.cosine / factor, motion.sine / factor)
