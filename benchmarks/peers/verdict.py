"""What a motion is worth, from the motion alone: limits, condition number, precision. Nothing of excite is imported."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import robot_time
from cases import Case
from judge import Array
from motion_forms import Motion, combined, drawn_together, motion_of
from problems import RATE

SECONDS = 60.0  # of motion after which the share of precise parameters is told
AT_REST = 1e-6  # [rad/s, rad/s^2]
KEPT = 1e-6


def limit_use(case: Case, motion: Motion) -> float:
    """Largest part of the way from the middle to a limit that is used, over continuous time; above 1 one is broken."""
    largest = 0.0
    for derivative, (L, lower, upper) in enumerate(case.limits):
        rows = combined(motion, L)
        values = rows.values(rows.extreme_times(derivative), derivative)
        middle = L @ case.middle if derivative == 0 else np.zeros(len(L))
        way = np.where(values > middle, upper - middle, middle - lower)
        largest = max(largest, float(np.max(np.abs(values - middle) / way)))
    return largest


def restlessness(motion: Motion) -> float:
    """Largest velocity [rad/s] or acceleration [rad/s^2] at both ends."""
    ends = np.array([0.0, motion.period])
    return max(float(np.abs(motion.values(ends, derivative)).max()) for derivative in (1, 2))


def sampled_columns(case: Case, motion: Motion) -> Array:
    """Stacked W of the motion at 100 Hz, both ends included."""
    time = np.linspace(0.0, motion.period, round(motion.period * RATE) + 1)
    return case.columns(*(motion.values(time, derivative) for derivative in range(3)))


def verdict(case: Case, plain: Mapping[str, Any]) -> dict[str, Any]:
    """Everything about one motion; one that breaks a limit is drawn together until it does not."""
    motion = motion_of(plain)
    use = limit_use(case, motion)
    if use > 1.0:
        motion = drawn_together(motion, case.middle, use)
    W = sampled_columns(case, motion)
    sigma = np.linalg.svd(W, compute_uv=False)
    deviation, scale = robot_time.deviations(W, case.whitening), robot_time.scales(case.values, case.units)
    runs = robot_time.runs_needed(deviation, scale)
    widths = robot_time.relative_half_widths(deviation, scale, 1.0)
    return {
        "condition_number": float(sigma[0] / sigma[-1]),
        "limit_use_as_delivered": use,
        "limits_kept": use <= 1.0 + KEPT,
        "at_rest": restlessness(motion) <= AT_REST,
        "runs": runs,
        "robot_seconds": runs * motion.period,
        "worst_parameter": case.names[int(np.argmax(widths))],
        "share_after_a_minute": robot_time.share_reached(deviation, scale, int(SECONDS // motion.period)),
        "relative_half_widths_of_one_run": dict(zip(case.names, widths.tolist(), strict=True)),
    }
