r"""Motions for controllers of KUKA, ABB and Franka: programs, and tables for clients of their interfaces.

The grammar of KRL (KUKA System Software 8.3 and later) is that of the "Operating and Programming Instructions for
System Integrators" (KSS 8.3), chapters on spline blocks and on TIME_BLOCK: the parts share the total time in proportion
to their numbers. The grammar of RAPID is that of the "Technical reference manual - RAPID Instructions, Functions and
Data types": ``MoveAbsJ ToJointPos [\NoEOffs] Speed [\T] Zone Tool``; ``\T`` replaces the speed by the time of the
movement [s].

The control of libfranka rejects a motion whose commanded positions have, by differences of the samples at 1 kHz, a
larger velocity, acceleration or jerk (Franka Control Interface documentation, "Robot and interface specifications").
The bounds are those of libfranka's ``rate_limiting.h``, with its margin for three lost packets on velocities. For the
FR3 the bound on the velocity falls towards the limits of position: ``min(v, max(0, -o + sqrt(max(0, s (q_max -
q)))))``.
"""

from __future__ import annotations

import numpy as np

from excite.errors import BrokenLimitError
from excite.export.motions.motion_format import (
    Interpolation,
    MotionFile,
    MotionFormat,
    Recorder,
    channels,
    check_stem,
    columns,
    rows_of,
    timed_rows,
    xml_comment,
)
from excite.export.motions.sampled_design import SampledDesign
from regressors.robot.robot import Robot
from regressors.samples import Array

_AXES = range(1, 7)
_SLOW = 10  # percent of the largest velocity, to the first pose


class _Kuka(MotionFormat):
    """A motion for a controller of KUKA."""

    whole_nanoseconds = True

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """A client of KUKA RSI; of FRI for seven joints."""
        return fri_recorder(motion) if motion.robot.n == 7 else rsi_recorder(motion)


class KrlSpline(_Kuka):
    """Slow PTP to the first pose, then ``PTP_SPLINE`` through axis positions A1 to A6 [deg] with TIME_BLOCK."""

    name = "krl"
    suffix = ".src"
    default_rate, slowest, fastest = 10.0, 0.5, 50.0
    joints = (6,)
    most = 5000
    interpolation = Interpolation.NOT_DOCUMENTED
    given, decimals, degrees = 0, 9, True
    checked = (
        "when excite is tested, such programs are checked against the grammar of KRL; none was played on a robot, and "
        "the spline that the controller lays through the positions is not documented"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The program."""
        check_stem(stem, ".src", "program", "[A-Za-z_][A-Za-z0-9_]{0,23}", ", 24 at most")
        points = [_axes(q) for q in np.degrees(motion.samples.q).tolist()]
        steps = np.diff(motion.time).tolist()
        lines = ["&ACCESS RVP", f"DEF {stem}( )", *(f"; {line}" for line in motion.heading)]
        lines += ["; angles in degrees; TIME_BLOCK PART in seconds, of TIME_BLOCK END in all", "BAS (#INITMOV, 0)"]
        lines += [*_speeds(_SLOW), f"PTP {points[0]}", *_speeds(100)]
        lines += ["PTP_SPLINE", f"  SPTP {points[0]}", "  TIME_BLOCK START"]
        for point, step in zip(points[1:], steps, strict=True):
            lines += [f"  SPTP {point}", f"  TIME_BLOCK PART = {step:.9f}"]
        lines += [f"  TIME_BLOCK END = {motion.time[-1]:.9f}", "ENDSPLINE", "END"]
        return MotionFile(("\r\n".join(lines) + "\r\n").encode("ascii", "replace"))


def _speeds(percent: int) -> list[str]:
    """Velocities and accelerations of the axes, of their largest; those of the spline follow from its times."""
    return [f"$VEL_AXIS[{k}] = {percent}" for k in _AXES] + [f"$ACC_AXIS[{k}] = 100" for k in _AXES]


def _axes(degrees: list[float]) -> str:
    return "{" + ", ".join(f"A{k} {value + 0.0:.9f}" for k, value in enumerate(degrees, 1)) + "}"


class RsiCsv(_Kuka):
    """One row in a cycle, with a header.

    RSI, six axes: ``time`` [s], positions ``A1`` to ``A6`` and the corrections ``AK.A1`` to ``AK.A6`` from the first
    pose, which an AXISCORR in absolute mode takes [deg]. FRI, seven joints: ``time`` [s], ``J1`` to ``J7`` [rad].
    """

    name = "rsi"
    suffix = ".csv"
    default_rate, slowest, fastest = 250.0, 10.0, 1000.0
    joints = (6, 7)
    interpolation = Interpolation.LINEAR
    checked = (
        "when excite is tested, NumPy reads such files back; none was played on a robot: neither RSI nor FRI has a "
        "file of its own"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Comment, header and rows."""
        q = motion.samples.q
        if q.shape[1] == 7:
            names, table = [f"J{k}" for k in range(1, 8)], q
        else:
            degrees = np.degrees(q)
            names = [*(f"A{k}" for k in _AXES), *(f"AK.A{k}" for k in _AXES)]
            table = np.column_stack([degrees, degrees - degrees[0]])
        return MotionFile(timed_rows(motion, names, table))


def rsi_recorder(motion: SampledDesign) -> Recorder:
    """Configuration of the RSI object ETHERNET: measured axes and motor currents in every cycle."""
    return Recorder(
        channels(("time", "s"), _AXES, position=("AIPos.A{}", "deg"), current=("MACur.A{}", "A")),
        (
            "record: the elements AIPos and MACur of every telegram, as a CSV file with the columns time [s] (from "
            "IPOC [ms]), AIPos.A1 ... AIPos.A6 [deg], MACur.A1 ... MACur.A6",
            "rate: 250 Hz (cycle of 4 ms)",
            "start marker: the first change of AIPos",
            "gain: torque of the joint per unit of its current [Nm/A]; 1 gives torques in the unit of the currents",
        ),
        ".xml",
        _ethernet(motion),
        (
            "the gains of the currents in the mapping are 1: write the torque per unit of current there, or calibrate "
            "them with `loaded` and `known_mass`",
        ),
    )


def _ethernet(motion: SampledDesign) -> str:
    corrections = "\n".join(f'      <ELEMENT TAG="AK.A{k}" TYPE="DOUBLE" INDX="{k}" HOLDON="1" />' for k in _AXES)
    return (
        f'<?xml version="1.0"?>\n<!--\n{xml_comment(motion)}\n  Set the address and port of your computer.\n-->\n'
        "<ROOT>\n  <CONFIG>\n"
        "    <IP_NUMBER>192.168.1.2</IP_NUMBER>\n    <PORT>49152</PORT>\n    <SENTYPE>excite</SENTYPE>\n"
        "    <ONLYSEND>FALSE</ONLYSEND>\n  </CONFIG>\n  <SEND>\n    <ELEMENTS>\n"
        '      <ELEMENT TAG="DEF_AIPos" TYPE="DOUBLE" INDX="INTERNAL" />\n'
        '      <ELEMENT TAG="DEF_MACur" TYPE="DOUBLE" INDX="INTERNAL" />\n'
        f"    </ELEMENTS>\n  </SEND>\n  <RECEIVE>\n    <ELEMENTS>\n{corrections}\n"
        "    </ELEMENTS>\n  </RECEIVE>\n</ROOT>\n"
    )


def fri_recorder(motion: SampledDesign) -> Recorder:
    """States of a client of the Fast Robot Interface."""
    signals = {"position": ("measuredJointPosition[{}]", "rad"), "effort": ("measuredTorque[{}]", "Nm")}
    return Recorder(
        channels(("time", "s"), range(7), **signals),
        (
            "record: getMeasuredJointPosition() and getMeasuredTorque() of LBRState in every cycle, as a CSV file with "
            "the columns time [s], measuredJointPosition[0] ..., measuredTorque[0] ...",
            f"rate: {motion.rate:g} Hz, that of the session",
            "start marker: the session changes to COMMANDING_ACTIVE",
        ),
    )


_NO_AXES = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"


class _Abb(MotionFormat):
    """A motion for a controller of ABB."""

    joints = (6,)
    whole_nanoseconds = True

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """Positions of EgmRobot messages and torques of test signals, as a CSV file."""
        return Recorder(
            channels(("time", "s"), _AXES, position=("feedBack.joints[{}]", "deg"), effort=("torque[{}]", "Nm")),
            (
                "record: feedBack.joints [deg] of every EgmRobot message, and the joint torques [Nm] of the "
                "controller's test signals (ABB TuneMaster), as a CSV file with the columns time [s], "
                "feedBack.joints[1] ..., torque[1] ...",
                "rate: 250 Hz",
                "start marker: the first change of feedBack.joints",
            ),
            notes=("EGM sends no torques: record them as test signals of the controller, on the same clock",),
        )


class RapidModule(_Abb):
    """Module with a procedure of ``MoveAbsJ`` through jointtargets of six axes [deg], each in a stated time [s]."""

    name = "rapid"
    suffix = ".mod"
    default_rate, slowest, fastest = 10.0, 0.5, 20.0
    most = 5000
    interpolation = Interpolation.NOT_DOCUMENTED
    given, decimals, degrees = 0, 9, True
    checked = (
        "when excite is tested, such modules are checked against the grammar of RAPID; none was played on a robot, and "
        "how the controller passes the zones between the positions is not documented: EGM follows a motion more closely"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The module; the robot moves to the first pose slowly, and passes all but the last position."""
        check_stem(stem, ".mod", "module", "[A-Za-z][A-Za-z0-9_]{0,31}", ", 32 at most")
        targets = [_target(q) for q in np.degrees(motion.samples.q).tolist()]
        steps = np.diff(motion.time).tolist()
        lines = [f"MODULE {stem}", *(f"  ! {line}" for line in motion.heading), f"  PROC {stem[:28]}_run()"]
        lines += [f"    MoveAbsJ {targets[0]} \\NoEOffs, v50, fine, tool0;"]
        for k, (target, step) in enumerate(zip(targets[1:], steps, strict=True), 1):
            zone = "fine" if k == len(steps) else "z1"
            lines.append(f"    MoveAbsJ {target} \\NoEOffs, v1000 \\T:={step:.9f}, {zone}, tool0;")
        lines += ["  ENDPROC", "ENDMODULE"]
        return MotionFile(("\n".join(lines) + "\n").encode("ascii", "replace"))


def _target(degrees: list[float]) -> str:
    return f"[[{','.join(f'{value + 0.0:.9f}' for value in degrees)}],{_NO_AXES}]"


class EgmCsv(_Abb):
    """Header, then ``time`` [s], ``planned.joints[1]`` to ``[6]`` [deg], ``speedRef.joints[1]`` to ``[6]`` [deg/s]."""

    name = "egm"
    suffix = ".csv"
    default_rate, slowest, fastest = 250.0, 10.0, 250.0
    interpolation = Interpolation.LINEAR
    checked = (
        "when excite is tested, NumPy reads such files back; none was played on a robot, and the filter that EGM puts "
        "after the positions is a setting of the controller"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Comment, header and rows."""
        names = [*columns("planned.joints[{}]", _AXES), *columns("speedRef.joints[{}]", _AXES)]
        table = np.degrees(np.column_stack([motion.samples.q, motion.samples.dq]))
        return MotionFile(timed_rows(motion, names, table))


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
