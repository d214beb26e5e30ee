"""Trajectory families: one file each."""

from __future__ import annotations

from excite.trajectories.families import family_of, finer, stored_trajectory
from excite.trajectories.family import Trajectory
from excite.trajectories.fourier import FourierFamily
from excite.trajectories.linear import LinearFamily

__all__ = ["FourierFamily", "LinearFamily", "Trajectory", "family_of", "finer", "stored_trajectory"]
