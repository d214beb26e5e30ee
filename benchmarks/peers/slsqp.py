"""The do-it-yourself baseline of `baseline_slsqp`, for every case: descents from random motions until time is spent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from baseline_slsqp import LIMIT_INSTANTS, descents, limit_rows, log_condition, motion_of, random_start
from candidates import best
from cases import case
from judge import Array


def iterates(wanted: Mapping[str, Any]) -> list[tuple[float, Array]]:
    """Processor time and iterate of all descents."""
    arm, rng = case(wanted["case"]), np.random.default_rng(wanted["seed"])
    A, b = limit_rows(arm.limits)
    objective = log_condition(arm.columns, LIMIT_INSTANTS)
    return descents([objective], A, b, lambda: random_start(arm.middle, A, b, rng), wanted["cpu"])


def motion(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """The best iterate."""
    arm, kept = case(wanted["case"]), iterates(wanted)
    return {"trajectory": best(arm, [motion_of(x) for _, x in kept]), "iterates": len(kept)}
