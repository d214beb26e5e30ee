"""A motion as trajectory_msgs/JointTrajectory, and what to record of ROS 2 while it is played."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from excite.export.motions.recorder import Recorder
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
