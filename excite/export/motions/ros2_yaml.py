"""Goal of the ROS 2 action FollowJointTrajectory as YAML, for ``ros2 action send_goal --stdin``."""

from __future__ import annotations

import json
from collections.abc import Sequence

from excite.export.motions.certificate import Interpolation
from excite.export.motions.joint_trajectory import ACTION, check_rules, frame_of, message_of, ros2_recorder
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder
from excite.export.motions.sampled_design import SampledDesign
from regressors.quoting import printable

_ARGUMENT = 131_071  # bytes of one argument of a command on Linux (MAX_ARG_STRLEN)


class Ros2Yaml(MotionFormat):
    """``trajectory`` of control_msgs/action/FollowJointTrajectory, positions, velocities and accelerations [SI]."""

    name = "ros2-yaml"
    default_rate, fastest = 100.0, 1000.0
    revolute = False
    interpolation = Interpolation.QUINTIC
    whole_nanoseconds = True
    checked = (
        "the goal keeps the acceptance rules of joint_trajectory_controller; when excite is tested, PyYAML reads such "
        "goals back; none was played on a robot"
    )

    def check(self, motion: SampledDesign) -> None:
        """Raise `BrokenLimitError` where joint_trajectory_controller would refuse the motion."""
        check_rules(message_of(motion), motion.joints)

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The goal; every number is one for YAML 1.1 too, which takes 1e-05 for a string."""
        message = message_of(motion)
        lines = [f"# {line}" for line in (*motion.heading, *_how(printable(stem)))]
        lines += ["trajectory:", "  header:", "    stamp: {sec: 0, nanosec: 0}", f'    frame_id: "{frame_of(motion)}"']
        lines += [f"  joint_names: [{', '.join(map(quoted, motion.joints))}]", "  points:"]
        for point in message["points"]:
            at = point["time_from_start"]
            lines.append(f"  - positions: {listed_floats(point['positions'])}")
            lines.append(f"    velocities: {listed_floats(point['velocities'])}")
            lines.append(f"    accelerations: {listed_floats(point['accelerations'])}")
            lines.append(f"    time_from_start: {{sec: {at['sec']}, nanosec: {at['nanosec']}}}")
        content = ("\n".join(lines) + "\n").encode()
        long = (
            f"the goal has {len(content)} bytes, more than an argument of a command may have: send it on the "
            "standard input, as the comment of the file says, or play the format mcap",
        )
        return MotionFile(content, long if len(content) > _ARGUMENT else ())

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """The recorder of rosbag2."""
        return ros2_recorder(motion, name)


def _how(stem: str) -> tuple[str, ...]:
    kind = "control_msgs/action/FollowJointTrajectory"
    return (
        "units: rad, rad/s, rad/s^2 (m for prismatic joints); the robot must rest in the first point",
        f"ros2 action send_goal {ACTION} {kind} --stdin < {stem}.yaml",
    )


def quoted(name: str) -> str:
    """A printable name as a string of YAML, whatever it looks like."""
    return json.dumps(name, ensure_ascii=False)


def listed_floats(values: Sequence[float]) -> str:
    """Numbers as a list that PyYAML reads back as the same floats."""
    return f"[{', '.join(map(yaml_float, values))}]"


def yaml_float(value: float) -> str:
    """The shortest text of a number with a point in its mantissa, such as ``1.0e-05``."""
    text = repr(float(value))
    mantissa, e, exponent = text.partition("e")
    return text if not e or "." in mantissa else f"{mantissa}.0e{exponent}"
