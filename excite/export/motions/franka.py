"""Joint positions for the control loop of libfranka, and the rates that it allows.

The control rejects a motion whose commanded positions have, by differences of the samples at 1 kHz, a larger velocity,
acceleration or jerk (Franka Control Interface documentation, "Robot and interface specifications"). The bounds are
those of libfranka's ``rate_limiting.h``, with its margin for three lost packets on velocities. For the FR3 the bound on
the velocity falls towards the limits of position: ``min(v, max(0, -o + sqrt(max(0, s (q_max - q)))))``.
"""

from __future__ import annotations

import numpy as np

from excite.errors import BrokenLimitError
from excite.export.motions.motion_format import Interpolation, MotionFile, MotionFormat, Recorder, channels, rows_of
from excite.export.motions.sampled_design import SampledDesign
from regressors.robot.robot import Robot
from regressors.samples import Array


class FrankaCsv(MotionFormat):
    """Positions of seven joints [rad] separated by commas, without a header and without a comma at the end of a row.

    Lines that begin with # name the design; a reader skips them.
    """

    name = "franka"
    suffix = ".csv"
    default_rate = slowest = fastest = 1000.0
    joints = (7,)
    interpolation = Interpolation.LINEAR
    checked = "when excite is tested, NumPy reads such files back; none was played on a robot"

    def check(self, motion: SampledDesign) -> None:
        """Raise `BrokenLimitError` where libfranka would refuse the velocities, accelerations or jerks."""
        check_rates(motion.robot, motion.samples.q)

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Comment and rows; the numbers read back exactly."""
        about = (*motion.heading, "columns: position of each joint [rad]; one row in a millisecond")
        lines = [*(f"# {line}" for line in about), *rows_of(motion.samples.q), ""]
        whose = "the FR3, whose velocity limits fall with the position" if is_fr3(motion.robot) else "the Panda"
        return MotionFile(
            "\n".join(lines).encode(),
            (f"differences of the rows keep libfranka's limits of velocity, acceleration and jerk for {whose}",),
        )

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """A file in the layout of libfranka's ``logToCSV``."""
        forms = {"position": ("state.q[{}]", "rad"), "velocity": ("state.dq[{}]", "rad/s")}
        return Recorder(
            channels(("time", "ms"), range(7), **forms, effort=("state.tau_J[{}]", "Nm")),
            (
                "record: franka::RobotState of every cycle, in the layout of franka::logToCSV; the log that libfranka "
                "keeps itself is short",
                "rate: 1000 Hz",
                "start marker: state.q_d begins to change",
            ),
        )


STEP = 1e-3
_MARGIN, _LOST = 1e-3, 3.0  # kLimitEps, kTolNumberPacketsLost
JERK = np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]) - _MARGIN
ACCELERATION = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]) - _MARGIN
VELOCITY = np.array([2.175] * 4 + [2.61] * 3) - _MARGIN - _LOST * STEP * ACCELERATION
FR3_ACCELERATION = np.full(7, 10.0) - _MARGIN
FR3_JERK = np.full(7, 5000.0) - _MARGIN
_FR3_VELOCITY = np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26])
_FR3_OFFSET = np.array([0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35])
_FR3_SLOPE = np.array([12.0, 5.17, 7.0, 8.0, 34.0, 11.0, 34.0])
_FR3_UPPER = np.array([2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196])
_FR3_LOWER = np.array([-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196])
_NAMES = ("velocity", "acceleration", "jerk")
_UNITS = ("rad/s", "rad/s^2", "rad/s^3")


def is_fr3(robot: Robot) -> bool:
    """True for a Franka Research 3, by the names of the robot and of its joints."""
    return any("fr3" in name.lower() for name in (robot.name, *robot.joint_names))


def fr3_velocities(q: Array) -> tuple[Array, Array]:
    """Least and largest velocity of an FR3 at positions of shape (N, 7) [rad/s]."""
    upper = -_FR3_OFFSET + np.sqrt(np.maximum(0.0, _FR3_SLOPE * (_FR3_UPPER - q)))
    lower = _FR3_OFFSET - np.sqrt(np.maximum(0.0, _FR3_SLOPE * (q - _FR3_LOWER)))
    most = np.minimum(_FR3_VELOCITY, np.maximum(0.0, upper)) - _MARGIN
    least = np.maximum(-_FR3_VELOCITY, np.minimum(0.0, lower)) + _MARGIN
    return least, most


def check_rates(robot: Robot, q: Array) -> None:
    """Refuse positions whose differences break a limit; the robot rests before the first and after the last."""
    # q (N, 7)
    fr3 = is_fr3(robot)
    acceleration, jerk = (FR3_ACCELERATION, FR3_JERK) if fr3 else (ACCELERATION, JERK)
    rest = np.concatenate([np.repeat(q[:1], 3, axis=0), q, np.repeat(q[-1:], 3, axis=0)])
    rates = [np.diff(rest, n=order, axis=0) / STEP**order for order in (1, 2, 3)]
    least, most = fr3_velocities(rest[:-1]) if fr3 else (-VELOCITY, VELOCITY)
    bounds = [(least, most), (-acceleration, acceleration), (-jerk, jerk)]
    for order, (rate, (low, high)) in enumerate(zip(rates, bounds, strict=True)):
        excess = np.maximum(rate - high, low - rate)
        if excess.max() > 0.0:
            row, joint = divmod(int(excess.argmax()), excess.shape[1])
            bound = np.broadcast_to(high if rate[row, joint] > 0 else low, rate.shape)[row, joint]
            raise BrokenLimitError(
                f"libfranka refuses the motion: the {_NAMES[order]} of {robot.joint_names[joint]} by differences of "
                f"the samples is {rate[row, joint]:.6g} {_UNITS[order]} at {max(row - 3, 0) * STEP:.3f} s, beyond "
                f"{bound:.6g} {_UNITS[order]}; design it again with a lower `{_NAMES[order]}`"
            )
