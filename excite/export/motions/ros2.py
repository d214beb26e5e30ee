"""Motions for ROS 2, as trajectory_msgs/JointTrajectory: a goal of FollowJointTrajectory in YAML, and a bag in MCAP.

Messages keep the rules of `JointTrajectoryController::validate_trajectory_msg` (ros2_controllers, Humble to Jazzy).
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from excite.errors import BrokenLimitError
from excite.export.motions.motion_format import Interpolation, MotionFile, MotionFormat, Recorder, channels
from excite.export.motions.sampled_design import SampledDesign
from regressors.errors import InputError, printable
from regressors.readers.documents import yaml_float

CONTROLLER = "/joint_trajectory_controller"
TOPIC = f"{CONTROLLER}/joint_trajectory"
ACTION = f"{CONTROLLER}/follow_joint_trajectory"
STATES = "/joint_states"
TOPICS = (STATES, f"{CONTROLLER}/controller_state", TOPIC, f"{ACTION}/_action/status")
_SECOND = 1_000_000_000
_STANDING = 1.1920929e-07  # FLT_EPSILON, above which the last velocity is refused
_VERSION = 8  # of the metadata of a bag; 9 is not read by Humble
_ARGUMENT = 131_071  # bytes of one argument of a command on Linux (MAX_ARG_STRLEN)


class _JointTrajectory(MotionFormat):
    """One message for joint_trajectory_controller."""

    default_rate, fastest = 100.0, 1000.0
    revolute = False
    interpolation = Interpolation.QUINTIC
    whole_nanoseconds = True

    def check(self, motion: SampledDesign) -> None:
        """Raise `BrokenLimitError` for a motion that does not end at rest, which the controller refuses."""
        if np.any(np.abs(motion.samples.dq[-1]) > _STANDING):
            raise BrokenLimitError(
                "joint_trajectory_controller refuses the motion: the velocities of the last point are not zero"
            )

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """Parameters of rosbag2's recorder, and the mapping of ``/joint_states`` in its bag."""
        units = {"position": "rad", "velocity": "rad/s", "effort": "Nm"}
        forms = {what: (f"{STATES}/{{}}/{what}", unit) for what, unit in units.items()}
        return Recorder(
            channels((f"{STATES}/header/stamp", "ns"), motion.joints, **forms),
            (
                f"record: ros2 run rosbag2_transport recorder --ros-args --params-file {name}.record.yaml",
                f"rate: that of joint_state_broadcaster; at least {2 * motion.rate:g} Hz lose nothing of the motion",
                f"start marker: the message on {TOPIC}, or the status of {ACTION}",
            ),
            ".yaml",
            _parameters(motion, name),
            (
                "a controller of another name, such as scaled_joint_trajectory_controller, needs its topics in the "
                "files beside it",
            ),
        )


class Ros2Yaml(_JointTrajectory):
    """``trajectory`` of control_msgs/action/FollowJointTrajectory, positions, velocities and accelerations [SI]."""

    name = "ros2-yaml"
    checked = (
        "the goal keeps the acceptance rules of joint_trajectory_controller; when excite is tested, PyYAML reads such "
        "goals back; none was played on a robot"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The goal; every number is one for YAML 1.1 too, which takes 1e-05 for a string."""
        kind = "control_msgs/action/FollowJointTrajectory"
        how = (
            "units: rad, rad/s, rad/s^2 (m for prismatic joints); the robot must rest in the first point",
            f"ros2 action send_goal {ACTION} {kind} --stdin < {printable(stem)}.yaml",
        )
        lines = [f"# {line}" for line in (*motion.heading, *how)]
        lines += ["trajectory:", "  header:", "    stamp: {sec: 0, nanosec: 0}", f'    frame_id: "{frame_of(motion)}"']
        lines += [f"  joint_names: [{', '.join(map(quoted, motion.joints))}]", "  points:"]
        for t, q, dq, ddq in points_of(motion):
            lines += [f"  - positions: {listed_floats(q)}", f"    velocities: {listed_floats(dq)}"]
            lines += [f"    accelerations: {listed_floats(ddq)}"]
            lines += [f"    time_from_start: {{sec: {t // _SECOND}, nanosec: {t % _SECOND}}}"]
        content = ("\n".join(lines) + "\n").encode()
        long = (
            f"the goal has {len(content)} bytes, more than an argument of a command may have: send it on the "
            "standard input, as the comment of the file says, or play the format mcap",
        )
        return MotionFile(content, long if len(content) > _ARGUMENT else ())


def quoted(name: str) -> str:
    """A printable name as a string of YAML, whatever it looks like."""
    return json.dumps(name, ensure_ascii=False)


def listed_floats(values: Sequence[float]) -> str:
    """Numbers as a list that PyYAML reads back as the same floats."""
    return f"[{', '.join(map(yaml_float, values))}]"


class McapTrajectory(_JointTrajectory):
    """One message for joint_trajectory_controller; the hash of the design is in its frame_id and in the metadata."""

    name = "mcap"
    suffix = ".mcap"
    checked = (
        "the message keeps the acceptance rules of joint_trajectory_controller; when excite is tested, rosbags and "
        "mcap-ros2-support read such bags back; none was played on a robot"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The bag, uncompressed, with version 8 of rosbag2's metadata, at time 0."""
        try:
            from rosbags.rosbag2 import StoragePlugin, Writer
            from rosbags.typesys import Stores, get_typestore
        except ModuleNotFoundError as error:
            raise InputError("the format mcap needs rosbags: pip install 'excite-trajectories[ros]'") from error
        types = get_typestore(Stores.ROS2_HUMBLE)
        kind = "trajectory_msgs/msg/JointTrajectory"
        data = types.serialize_cdr(_message(motion, types.types), kind)
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / stem
            with Writer(bag, version=_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
                writer.set_custom_data("excite_design_sha256", motion.sha256)
                writer.set_custom_data("excite_coefficients_sha256", motion.design.coefficients_sha256)
                writer.write(writer.add_connection(TOPIC, kind, typestore=types), 0, data)
            content = (bag / f"{stem}.mcap").read_bytes()
        return MotionFile(content)


def _message(motion: SampledDesign, types: Any) -> Any:
    """The message; effort stays empty, and stamp 0 means that it starts when it arrives."""
    Time, Duration = types["builtin_interfaces/msg/Time"], types["builtin_interfaces/msg/Duration"]
    Point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    points = [
        Point(*map(np.array, rates), np.zeros(0), Duration(sec=t // _SECOND, nanosec=t % _SECOND))
        for t, *rates in points_of(motion)
    ]
    header = types["std_msgs/msg/Header"](stamp=Time(sec=0, nanosec=0), frame_id=frame_of(motion))
    return types["trajectory_msgs/msg/JointTrajectory"](header=header, joint_names=list(motion.joints), points=points)


def frame_of(motion: SampledDesign) -> str:
    """``header.frame_id``, which the controller does not read: the hash of the design, so that recordings carry it."""
    return f"excite_design_sha256_{motion.sha256}"


def points_of(motion: SampledDesign) -> Iterator[tuple[int, list[float], list[float], list[float]]]:
    """Of each point the time [ns], positions, velocities and accelerations."""
    samples, ticks = motion.samples, np.round(motion.time * _SECOND).astype(np.int64)
    return zip(*(values.tolist() for values in (ticks, samples.q, samples.dq, samples.ddq)), strict=True)


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
