"""What ros2_control's joint_trajectory_controller accepts as a trajectory.

The rules are those of `JointTrajectoryController::validate_trajectory_msg` (ros2_controllers, Humble to Jazzy).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from excite.errors import BrokenLimitError

_STANDING = 1.1920929e-07  # FLT_EPSILON, above which the last velocity is refused
_RATES = ("velocities", "accelerations")


def broken_rules(trajectory: Mapping[str, Any], joints: Sequence[str]) -> list[str]:
    """Rules that a trajectory_msgs/JointTrajectory breaks; none where the controller accepts it."""
    names, points = list(trajectory["joint_names"]), list(trajectory["points"])
    broken = []
    if sorted(names) != sorted(joints):
        broken.append(f"joint_names are {', '.join(names)}, those of the controller {', '.join(joints)}")
    stamp = trajectory["header"]["stamp"]
    if stamp["sec"] or stamp["nanosec"]:
        broken.append("header.stamp is not zero: it would start then, and not at once")
    if not points:
        return [*broken, "there are no points"]
    if any(abs(velocity) > _STANDING for velocity in points[-1].get("velocities", ())):
        broken.append("the velocities of the last point are not zero")
    times = [_nanoseconds(point["time_from_start"]) for point in points]
    if times[0] < 0 or any(later <= earlier for earlier, later in pairwise(times)):
        broken.append("time_from_start does not increase from point to point")
    return [*broken, *_sizes(points, len(names))]


def _sizes(points: Sequence[Mapping[str, Any]], count: int) -> list[str]:
    broken = []
    if any(len(point["positions"]) != count for point in points):
        broken.append(f"a point has not {count} positions")
    for field in _RATES:
        lengths = {len(point.get(field, ())) for point in points}
        if lengths not in ({count}, {0}):
            broken.append(f"points have not all {count} {field}, or none")
    if any(len(point.get("effort", ())) for point in points):
        broken.append("a point has an effort, which controllers without an effort interface refuse")
    return broken


def _nanoseconds(duration: Mapping[str, int]) -> int:
    if not 0 <= duration["nanosec"] < 1_000_000_000:
        return -1
    return int(duration["sec"]) * 1_000_000_000 + int(duration["nanosec"])


def check_rules(trajectory: Mapping[str, Any], joints: Sequence[str]) -> None:
    """Raise `BrokenLimitError` where the controller would refuse a trajectory."""
    if broken := broken_rules(trajectory, joints):
        raise BrokenLimitError(f"joint_trajectory_controller refuses the motion: {'; '.join(broken)}")
