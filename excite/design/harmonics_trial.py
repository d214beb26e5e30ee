"""What one number of harmonics brought to a search that chooses it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HarmonicsTrial:
    """One number of harmonics and its best motion.

    Parameters
    ----------
    harmonics : int
    value : float
        The criterion of the best motion.
    cpu_seconds : float
    """

    harmonics: int
    value: float
    cpu_seconds: float
