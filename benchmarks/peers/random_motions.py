"""The floor: random motions within the limits until the time is spent, and the best of them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from baseline_slsqp import LIMIT_INSTANTS, limit_rows, log_condition, motion_of, random_start
from candidates import best
from cases import case

KEPT = 20


def motion(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """The best of the random starts of the baseline, none of them improved."""
    arm, rng = case(wanted["case"]), np.random.default_rng(wanted["seed"])
    A, b = limit_rows(arm.limits)
    objective = log_condition(arm.columns, LIMIT_INSTANTS)
    drawn = []
    while time.process_time() < wanted["cpu"] or not drawn:
        x = random_start(arm.middle, A, b, rng)
        drawn.append((objective(x), x))
    drawn.sort(key=lambda each: each[0])
    return {"trajectory": best(arm, [motion_of(x) for _, x in drawn[:KEPT]]), "motions": len(drawn)}
