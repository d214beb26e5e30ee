"""The whole motion of a stored design: approach, exciting motion and return, from the numbers of its file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from excite.design.approach import ApproachAndReturn
from excite.trajectories.scurve import SCurve
from excite.trajectories.sequence import APPROACH, EXCITE, RETURN, Motion, MotionSequence, Piece
from excite.trajectories.transfer import Leg, Transfer
from regressors.samples import Array


def stored_sequence(played: Mapping[str, Any], motion: Motion) -> MotionSequence:
    """The sequence that the entry ``played`` of a ``design.json`` describes.

    Parameters
    ----------
    played : mapping
        ``rate``, ``segments``, and ``approach`` and ``return`` where there are any.
    motion : Motion
        The exciting motion of every joint of the robot.

    Returns
    -------
    MotionSequence
    """
    rate, steps = float(played["rate"]), round(motion.duration * float(played["rate"]))
    if APPROACH not in played and RETURN not in played:
        return MotionSequence((Piece(EXCITE, motion, steps),))
    transfers = {name: _transfer(played[name]) for name in (APPROACH, RETURN) if name in played}
    spans = {each["name"]: float(each["end"]) - float(each["start"]) for each in played["segments"]}
    settle = max(round((spans[name] - transfer.duration) * rate) for name, transfer in transfers.items())
    both = ApproachAndReturn(transfers.get(APPROACH), transfers.get(RETURN), settle, rate, {})
    return both.sequence(motion, steps)


def _transfer(content: Mapping[str, Any]) -> Transfer:
    return Transfer(tuple(_leg(leg) for leg in content["legs"]), float(content["shortest"]), {})


def _leg(content: Mapping[str, Any]) -> Leg:
    start, end = (np.array(content[name], dtype=float) for name in ("start", "end"))
    return Leg(start, end, _law(*(np.array(content[name], dtype=float) for name in ("breaks", "jerk"))))


def _law(breaks: Array, jerk: Array) -> SCurve:
    """The law with given jerks on its pieces, from rest at zero; position, velocity and acceleration by integration."""
    s, ds, dds = 0.0, 0.0, 0.0
    pieces = []
    for h, j in zip(np.diff(breaks), jerk, strict=True):
        pieces.append((j / 6.0, dds / 2.0, ds, s))
        s, ds, dds = s + h * (ds + h * (dds / 2.0 + h * j / 6.0)), ds + h * (dds + h * j / 2.0), dds + h * j
    return SCurve(breaks, np.array(pieces).T)
