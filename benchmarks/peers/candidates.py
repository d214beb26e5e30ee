"""The best of several motions, after those beyond a limit have been drawn together; outside the budgets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from cases import Case
from motion_forms import drawn_together, motion_of
from verdict import limit_use

INSTANTS = 101


def best(arm: Case, candidates: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The one of the lowest condition number, at 101 instants."""
    time = np.linspace(0.0, arm.period, INSTANTS)

    def condition(plain: Mapping[str, Any]) -> float:
        motion = motion_of(plain)
        motion = drawn_together(motion, arm.middle, max(1.0, limit_use(arm, motion)))
        return float(np.linalg.cond(arm.columns(*(motion.values(time, derivative) for derivative in range(3)))))

    return dict(min(candidates, key=condition))
