r"""Motions for controllers of ABB: modules in RAPID, and tables for clients of Externally Guided Motion (EGM).

The grammar is that of the "Technical reference manual - RAPID Instructions, Functions and Data types":
``MoveAbsJ ToJointPos [\NoEOffs] Speed [\T] Zone Tool``; ``\T`` replaces the speed by the time of the movement [s].
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
)
from excite.export.motions.sampled_design import SampledDesign

_AXES = range(1, 7)
_NO_AXES = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"


class RapidModule(MotionFormat):
    """Module with a procedure of ``MoveAbsJ`` through jointtargets of six axes [deg], each in a stated time [s]."""

    name = "rapid"
    suffix = ".mod"
    default_rate, slowest, fastest = 10.0, 0.5, 20.0
    joints = (6,)
    most = 5000
    interpolation = Interpolation.NOT_DOCUMENTED
    given, decimals, degrees = 0, 9, True
    whole_nanoseconds = True
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

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """Test signals of the controller."""
        return abb_recorder(motion)


def _target(degrees: list[float]) -> str:
    return f"[[{','.join(f'{value + 0.0:.9f}' for value in degrees)}],{_NO_AXES}]"


class EgmCsv(MotionFormat):
    """Header, then ``time`` [s], ``planned.joints[1]`` to ``[6]`` [deg], ``speedRef.joints[1]`` to ``[6]`` [deg/s]."""

    name = "egm"
    suffix = ".csv"
    default_rate, slowest, fastest = 250.0, 10.0, 250.0
    joints = (6,)
    interpolation = Interpolation.LINEAR
    whole_nanoseconds = True
    checked = (
        "when excite is tested, NumPy reads such files back; none was played on a robot, and the filter that EGM puts "
        "after the positions is a setting of the controller"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Comment, header and rows."""
        names = [*columns("planned.joints[{}]", _AXES), *columns("speedRef.joints[{}]", _AXES)]
        table = np.degrees(np.column_stack([motion.samples.q, motion.samples.dq]))
        return MotionFile(timed_rows(motion, names, table))

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """Feedback of EGM with torques of the controller's test signals."""
        return abb_recorder(motion)


def abb_recorder(motion: SampledDesign) -> Recorder:
    """Positions of EgmRobot messages and torques of test signals, as a CSV file."""
    return Recorder(
        channels(("time", "s"), _AXES, position=("feedBack.joints[{}]", "deg"), effort=("torque[{}]", "Nm")),
        (
            "record: feedBack.joints [deg] of every EgmRobot message, and the joint torques [Nm] of the controller's "
            "test signals (ABB TuneMaster), as a CSV file with the columns time [s], feedBack.joints[1] ..., "
            "torque[1] ...",
            "rate: 250 Hz",
            "start marker: the first change of feedBack.joints",
        ),
        notes=("EGM sends no torques: record them as test signals of the controller, on the same clock",),
    )
