"""Trajectory families: one file each."""

from __future__ import annotations

from excite.trajectories.family import LinearFamily, Trajectory
from excite.trajectories.fourier import FourierFamily
from excite.trajectories.registry import family_of, finer, stored_trajectory

__all__ = ["FourierFamily", "LinearFamily", "Trajectory", "family_of", "finer", "stored_trajectory"]
