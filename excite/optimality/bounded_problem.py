"""What a bound depends on: the robot, the model, the family, the objective and the limits, not the search."""

from __future__ import annotations

import hashlib
import json

from excite.design.designed_motion import DesignedMotion
from excite.design.own_code import NotComparable, plain_value
from excite.registry import is_own

_METHOD = 1  # to be raised where the same problem is bounded in another manner
_PARTS = ("model", "trajectory", "objective", "limits")
_LEFT_OUT = ("class", "criterion", "require", "interest", "task_motion", "plausible_robots")


def bounded_problem_sha256(design: DesignedMotion) -> str | None:
    """Hash of the problem that a design's bound belongs to; None where parts of one's own make it unknown."""
    content: dict[str, object] = {"robot": design.robot.sha256(), "method": _METHOD}
    try:
        for name in _PARTS:
            options = plain_value(getattr(design.task, name))
            content[name] = {key: value for key, value in options.items() if key not in _LEFT_OUT}
    except NotComparable:
        return None
    text = json.dumps({**content, "rate": design.task.output.rate}, sort_keys=True, separators=(",", ":"))
    named = (design.task.model.model, design.task.trajectory.trajectory, *design.task.limits.constraints)
    if any(isinstance(each, str) and is_own(each) for each in named):
        return None
    return hashlib.sha256(text.encode()).hexdigest()
