"""Whole windows of a plan in a log, symmetric about the plan's pose, so that gravity cancels [KD96] section 5.2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from excite.friction.fit.constant_speed_windows import ConstantWindow, Found, WindowSearch, constant_window
from excite.friction.fit.plan_match import PlannedWindow
from excite.friction.fit.recorded_stretches import longest_step, position_noise, unbroken
from regressors.samples import Array

_TRIMMED = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)  # of the path, cut off at both ends
_FEWEST = 8
_RECORDED = 0.7  # least share of the samples that are expected
_LATE = 0.1  # of a window: its largest error in time
_OTHER_SPEED = 0.1  # of the planned speed: the largest deviation from it


def windows_of_plan(
    time: Array, z: Array, others: Array, planned: Sequence[PlannedWindow], middle: float, search: WindowSearch
) -> Found:
    """Windows of a plan, each from end to end, or trimmed at both ends so that its speed changes least.

    The trimmed path is the same on both sides of the middle, up to two fifths of the whole.
    """  # time (N,); z (N,); others (N, k)
    columns = np.column_stack([z, others])
    noise = position_noise(time, columns)
    longest = longest_step(time)
    steadiest = [_steadiest(time, columns, noise, w, middle, search, longest) for w in planned]
    windows = tuple(sorted((w for w in steadiest if isinstance(w, ConstantWindow)), key=lambda w: w.start))
    missing = steadiest.count("missing")
    return Found(windows, len(planned) - len(windows) - missing, 0, missing)


def _steadiest(
    time: Array,
    columns: Array,
    noise: Array,
    planned: PlannedWindow,
    middle: float,
    search: WindowSearch,
    longest: float,
) -> ConstantWindow | Literal["changing", "missing"]:
    centre = middle + 0.5 * (planned.first + planned.last)
    late = _LATE * (planned.end - planned.start)
    begin, end = np.searchsorted(time - time[0], [planned.start - late, planned.end + late])
    away = np.abs(columns[begin:end, 0] - centre)
    at = int(np.searchsorted(time[begin:end] - time[0], 0.5 * (planned.start + planned.end)))
    candidates: list[tuple[float, ConstantWindow]] = []
    recorded = False
    for trimmed in _TRIMMED:
        a, b = _stretch(away, at, (1.0 - trimmed) * 0.5 * abs(planned.last - planned.first))
        if not _recorded(time[begin + a : begin + b], longest):
            continue
        recorded = True
        window = constant_window(time, columns, noise, int(begin) + a, int(begin) + b, search, margin=0.0)
        if window is not None and abs(window[1].speed - planned.speed) <= _OTHER_SPEED * abs(planned.speed):
            candidates.append(window)
    if candidates:
        return min(candidates, key=lambda one: one[0])[1]
    return "changing" if recorded else "missing"


def _stretch(away: Array, at: int, half: float) -> tuple[int, int]:
    """Rows about one, no further from the middle than half the path and than the nearer of their two ends."""
    a, b = _about(away, at, half)
    return _about(away, at, min(half, float(away[a]), float(away[b - 1]))) if b > a else (0, 0)


def _about(away: Array, at: int, half: float) -> tuple[int, int]:
    out = np.flatnonzero(away > half)
    k = int(np.searchsorted(out, at))
    return (int(out[k - 1]) + 1 if k > 0 else 0), (int(out[k]) if k < out.size else away.size)


def _recorded(time: Array, longest: float) -> bool:
    """Whether there are enough samples, without a gap."""
    if time.size < _FEWEST or not unbroken(time, longest):
        return False
    step = np.diff(time)
    return bool((time.size - 1) * float(np.median(step)) >= _RECORDED * float(time[-1] - time[0]))
