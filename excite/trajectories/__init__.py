"""Trajectory families: one file each."""

from __future__ import annotations

from excite.trajectories.family import Trajectory, stored_trajectory
from excite.trajectories.fourier import Fourier
from excite.trajectories.linear import LinearFamily

__all__ = ["Fourier", "LinearFamily", "Trajectory", "stored_trajectory"]
