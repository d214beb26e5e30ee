"""Approach and return of a stored design, from the numbers of its file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from excite.design.approach import ApproachAndReturn
from excite.trajectories.scurve import SCurve
from excite.trajectories.sequence import APPROACH, RETURN
from excite.trajectories.transfer import Leg, Transfer
from regressors.errors import InputError
from regressors.samples import Array

_SAME = 1e-6  # rad or m: poses that are written and read again


def stored_transfers(played: Mapping[str, Any]) -> ApproachAndReturn | None:
    """Approach and return that the entry ``played`` of a ``design.json`` describes, without their limits."""
    rate = float(played["rate"])
    transfers = {name: _transfer(played[name]) for name in (APPROACH, RETURN) if name in played}
    if not transfers:
        return None
    spans = {each["name"]: float(each["end"]) - float(each["start"]) for each in played["segments"]}
    settle = max(round((spans[name] - transfer.duration) * rate) for name, transfer in transfers.items())
    return ApproachAndReturn(transfers.get(APPROACH), transfers.get(RETURN), settle, rate, {})


def check_joined(transfers: ApproachAndReturn, ends: Array) -> None:
    """Raise `InputError` where approach and return do not meet the motion."""  # ends (2, n)
    meets = {APPROACH: (-1, ends[0]), RETURN: (0, ends[1])}
    for name, transfer in transfers.transfers.items():
        place, pose = meets[name]
        gap = float(np.abs(transfer.poses[place] - pose).max())
        if not gap <= _SAME:
            raise InputError(
                f"the {name} does not meet the motion, by {gap:.3g} rad (m): the entry 'trajectory' or 'played' was "
                "changed after the design was written; restore the file, or design the motion again"
            )


def _transfer(content: Mapping[str, Any]) -> Transfer:
    assumed: dict[str, tuple[str, ...]] = {"acceleration": (), "jerk": ()}
    return Transfer(tuple(_leg(leg) for leg in content["legs"]), float(content["shortest"]), assumed)


def _leg(content: Mapping[str, Any]) -> Leg:
    start, end = (np.array(content[name], dtype=float) for name in ("start", "end"))
    return Leg(start, end, SCurve.of_jerks(content["breaks"], content["jerk"]))
