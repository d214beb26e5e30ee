r"""A RAPID module of ABB with one ``MoveAbsJ`` for each position, and the time that each may take.

The grammar is that of the "Technical reference manual - RAPID Instructions, Functions and Data types":
``MoveAbsJ ToJointPos [\NoEOffs] Speed [\T] Zone Tool``; ``\T`` replaces the speed by the time of the movement [s].
"""

from __future__ import annotations

import re

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.egm_csv import abb_recorder
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder
from excite.export.motions.sampled_design import SampledDesign
from regressors.errors import InputError

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
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
        if not _NAME.fullmatch(stem):
            raise InputError(
                f"{stem}.mod: the module has the name of the file, which must be letters, digits and _, 32 at most"
            )
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
