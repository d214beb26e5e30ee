"""A bag in MCAP with one trajectory_msgs/JointTrajectory, which ``ros2 bag play`` publishes."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.joint_trajectory import TOPIC, check_rules, message_of, ros2_recorder
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder
from excite.export.motions.sampled_design import SampledDesign
from regressors.errors import InputError

_VERSION = 8  # of the metadata; 9 is not read by Humble


class McapTrajectory(MotionFormat):
    """One message for joint_trajectory_controller; the hash of the design is in its frame_id and in the metadata."""

    name = "mcap"
    suffix = ".mcap"
    default_rate, fastest = 100.0, 1000.0
    revolute = False
    interpolation = Interpolation.QUINTIC
    whole_nanoseconds = True
    checked = (
        "the message keeps the acceptance rules of joint_trajectory_controller; when excite is tested, rosbags and "
        "mcap-ros2-support read such bags back; none was played on a robot"
    )

    def check(self, motion: SampledDesign) -> None:
        """Raise `BrokenLimitError` where joint_trajectory_controller would refuse the motion."""
        check_rules(message_of(motion), motion.joints)

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

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """The recorder of rosbag2."""
        return ros2_recorder(motion, name)


def _message(motion: SampledDesign, types: Any) -> Any:
    fields = message_of(motion)
    Time, Duration = types["builtin_interfaces/msg/Time"], types["builtin_interfaces/msg/Duration"]
    Point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    points = [
        Point(
            positions=np.array(point["positions"]),
            velocities=np.array(point["velocities"]),
            accelerations=np.array(point["accelerations"]),
            effort=np.zeros(0),
            time_from_start=Duration(**point["time_from_start"]),
        )
        for point in fields["points"]
    ]
    header = types["std_msgs/msg/Header"](stamp=Time(sec=0, nanosec=0), frame_id=fields["header"]["frame_id"])
    return types["trajectory_msgs/msg/JointTrajectory"](header=header, joint_names=fields["joint_names"], points=points)
