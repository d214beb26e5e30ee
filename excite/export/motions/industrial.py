r"""Motions for controllers of KUKA and ABB: programs, and tables for clients of their interfaces for sensors.

The grammar of KRL (KUKA System Software 8.3 and later) is that of the "Operating and Programming Instructions for
System Integrators" (KSS 8.3), chapters on spline blocks and on TIME_BLOCK: the parts share the total time in proportion
to their numbers. The grammar of RAPID is that of the "Technical reference manual - RAPID Instructions, Functions and
Data types": ``MoveAbsJ ToJointPos [\NoEOffs] Speed [\T] Zone Tool``; ``\T`` replaces the speed by the time of the
movement [s].
"""

from __future__ import annotations

import numpy as np

from excite.export.motions.motion_format import (
    Interpolation,
    MotionFile,
    MotionFormat,
    Recorder,
    channels,
    check_stem,
    columns,
    timed_rows,
    xml_comment,
)
from excite.export.motions.sampled_design import SampledDesign

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
