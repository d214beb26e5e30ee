"""Filtered motions without their invalid ends, and checks of settings."""

from __future__ import annotations

import numpy as np

from excite.signals.method import FilteredMotion
from regressors.errors import InputError
from regressors.samples import Array, Samples


def cut_motion(time: Array, state: tuple[Array, Array, Array], edge: int, assumed: str) -> FilteredMotion:
    """Motion without some samples at both ends."""  # time (N,); state (N, n)
    if time.size <= 2 * edge:
        raise InputError(f"{time.size} samples are too few: {edge} are cut from each end ({assumed})")
    kept = slice(edge, time.size - edge)
    q, dq, ddq = (part[kept] for part in state)
    return FilteredMotion(Samples(time[kept], q, dq, ddq, np.broadcast_to(np.nan, q.shape)), kept, assumed)


def check_positive(method: str, **settings: float | None) -> None:
    """Raise `InputError` for settings that are not positive numbers; None means not given."""
    for name, value in settings.items():
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"{method}: {name} must be a positive number, given {value:g}")
