"""A motion as trajectory_msgs/JointTrajectory, and what ros2_control accepts as one.

The rules are those of `JointTrajectoryController::validate_trajectory_msg` (ros2_controllers, Humble to Jazzy).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from excite.errors import BrokenLimitError
from excite.export.motions.motion_format import Recorder
from excite.export.motions.sampled_design import SampledDesign
from regressors.quoting import printable

CONTROLLER = "/joint_trajectory_controller"
TOPIC = f"{CONTROLLER}/joint_trajectory"
ACTION = f"{CONTROLLER}/follow_joint_trajectory"
STATES = "/joint_states"
TOPICS = (STATES, f"{CONTROLLER}/controller_state", TOPIC, f"{ACTION}/_action/status")
_SECOND = 1_000_000_000


def frame_of(motion: SampledDesign) -> str:
    """``header.frame_id``, which the controller does not read: the hash of the design, so that recordings carry it."""
    return f"excite_design_sha256_{motion.sha256}"


def message_of(motion: SampledDesign) -> dict[str, Any]:
    """Fields of the message; effort stays empty, and stamp 0 means that it starts when it arrives."""
    samples = motion.samples
    ticks = np.round(motion.time * _SECOND).astype(np.int64).tolist()
    rows = zip(ticks, samples.q.tolist(), samples.dq.tolist(), samples.ddq.tolist(), strict=True)
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame_of(motion)},
        "joint_names": list(motion.joints),
        "points": [
            {
                "positions": q,
                "velocities": dq,
                "accelerations": ddq,
                "effort": [],
                "time_from_start": {"sec": t // _SECOND, "nanosec": t % _SECOND},
            }
            for t, q, dq, ddq in rows
        ],
    }


def ros2_recorder(motion: SampledDesign, name: str) -> Recorder:
    """Parameters of rosbag2's recorder, and the mapping of ``/joint_states`` in its bag."""
    joints = motion.joints
    return Recorder(
        {
            "time": {"column": f"{STATES}/header/stamp", "unit": "ns"},
            "position": {"columns": [f"{STATES}/{joint}/position" for joint in joints], "unit": "rad"},
            "velocity": {"columns": [f"{STATES}/{joint}/velocity" for joint in joints], "unit": "rad/s"},
            "effort": {"columns": [f"{STATES}/{joint}/effort" for joint in joints], "unit": "Nm"},
        },
        (
            f"record: ros2 run rosbag2_transport recorder --ros-args --params-file {name}.record.yaml",
            f"rate: that of joint_state_broadcaster; at least {2 * motion.rate:g} Hz lose nothing of the motion",
            f"start marker: the message on {TOPIC}, or the status of {ACTION}",
        ),
        ".yaml",
        _parameters(motion, name),
        (
            "a controller of another name, such as scaled_joint_trajectory_controller, needs its topics in the files "
            "beside it",
        ),
    )


def _parameters(motion: SampledDesign, name: str) -> str:
    """Parameters of the node rosbag2_recorder (rosbag2_transport, Jazzy and later)."""
    comment = "".join(f"# {line}\n" for line in motion.heading)
    topics = "".join(f'        - "{topic}"\n' for topic in TOPICS)
    return (
        f"{comment}rosbag2_recorder:\n  ros__parameters:\n    record:\n      topics:\n{topics}"
        f"      include_hidden_topics: true\n      is_discovery_disabled: false\n      rmw_serialization_format: cdr\n"
        f"    storage:\n      uri: {json.dumps(printable(name) + '.bag', ensure_ascii=False)}\n      storage_id: mcap\n"
        f'      custom_data: ["excite_design_sha256={motion.sha256}"]\n'
    )


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
