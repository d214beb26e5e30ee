"""Sampled motion, on which regressors and limits are evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regressors.arguments import checked
from regressors.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@checked
@dataclass(frozen=True, eq=False)
class Samples:
    """Joint motion at N instants of n joints.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Instants [s].
    q, dq, ddq, dddq : ndarray, shape (N, n)
        Position, velocity, acceleration, jerk [rad, rad/s, rad/s^2, rad/s^3, or with m].
    """

    time: Array
    q: Array
    dq: Array
    ddq: Array
    dddq: Array

    def __post_init__(self) -> None:
        for name in ("dq", "ddq", "dddq"):
            if getattr(self, name).shape != self.q.shape:
                raise InputError(f"samples: {name} has shape {getattr(self, name).shape}, q has {self.q.shape}")
        if self.q.shape[0] != self.time.size:
            raise InputError(f"samples: {self.time.size} instants, but {self.q.shape[0]} rows of q")

    def __repr__(self) -> str:
        """One line."""
        return f"<Samples: {self.q.shape[-1]} joints at {self.time.size} instants>"

    def rows(self, part: slice | Index) -> Samples:
        """Some of the instants."""
        return Samples(*(getattr(self, name)[part] for name in ("time", "q", "dq", "ddq", "dddq")))

    @staticmethod
    def at_rest(q: Array) -> Samples:
        """Poses at rest, shape (N, n); the time of each is its number."""
        zero = np.zeros_like(q)
        return Samples(np.arange(float(len(q))), q, zero, zero, zero)

    @staticmethod
    def joined(parts: Sequence[Samples]) -> Samples:
        """Instants of several motions, one after the other."""
        names = ("time", "q", "dq", "ddq", "dddq")
        return Samples(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
