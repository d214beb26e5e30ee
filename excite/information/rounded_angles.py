"""Joint axes that are parallel or at right angles but for what rounding left: 1.5708 for pi / 2."""

from __future__ import annotations

import numpy as np

from regressors.models.base import Base
from regressors.robot.robot import Robot
from regressors.samples import Array

_EXACT, _MEANT = 1e-9, 2e-3  # rad: rounding of a computer, and the largest error of an angle written by hand, 3.14


def rounded_angles(robot: Robot) -> tuple[str, ...]:
    """Axes that nearly follow the one before, or stand nearly at a right angle to it, in words.

    The first joint's axis is compared with gravity.
    """
    before = robot.gravity / (np.linalg.norm(robot.gravity) or 1.0)
    name = "gravity"
    found = []
    for joint in robot.joints:
        axis = joint.rotation @ joint.axis
        if text := _nearly(before, axis):
            found.append(f"the axis of joint {joint.name} is {text} to {name}")
        before, name = joint.axis, f"that of joint {joint.name}"
    return tuple(found)


def left_out_by_rounding(robot: Robot, base: Base) -> tuple[str, ...]:
    """Note on the parameters that a base leaves out because only rounding shows them; none where there are none."""
    if not base.by_rounding:
        return ()
    cause = "; ".join(rounded_angles(robot)) or "their torques are as small as those of rounded angles and lengths"
    return (
        f"left out of the base parameters: {', '.join(base.by_rounding)}, which exist by rounding only ({cause}); "
        "`nearly_unidentifiable='keep'` keeps them",
    )


def _nearly(a: Array, b: Array) -> str:
    parallel, square = float(np.linalg.norm(np.cross(a, b))), abs(float(a @ b))
    if not np.any(a):
        return ""
    if _EXACT < parallel < _MEANT:
        return f"{parallel:.2g} rad from parallel"
    return f"{square:.2g} rad from a right angle" if _EXACT < square < _MEANT else ""
