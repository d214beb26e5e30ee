"""A KRL program (KUKA System Software 8.3 and later) with one spline block of axis positions and their times.

The grammar is that of the "Operating and Programming Instructions for System Integrators" (KSS 8.3), chapters on spline
blocks and on TIME_BLOCK: the parts share the total time in proportion to their numbers.
"""

from __future__ import annotations

import re

import numpy as np

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder
from excite.export.motions.rsi_csv import rsi_recorder
from excite.export.motions.sampled_design import SampledDesign
from regressors.errors import InputError

_SLOW = 10  # percent of the largest velocity, to the first pose
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,23}")  # of a module


class KrlSpline(MotionFormat):
    """Slow PTP to the first pose, then ``PTP_SPLINE`` through axis positions A1 to A6 [deg] with TIME_BLOCK."""

    name = "krl"
    suffix = ".src"
    default_rate, slowest, fastest = 10.0, 0.5, 50.0
    joints = (6,)
    most = 5000
    interpolation = Interpolation.NOT_DOCUMENTED
    given, decimals, degrees = 0, 9, True
    whole_nanoseconds = True
    checked = (
        "when excite is tested, such programs are checked against the grammar of KRL; none was played on a robot, and "
        "the spline that the controller lays through the positions is not documented"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The program."""
        if not _NAME.fullmatch(stem):
            raise InputError(
                f"{stem}.src: the program has the name of the file, which must be letters, digits and _, 24 at most"
            )
        points = [_axes(q) for q in np.degrees(motion.samples.q).tolist()]
        steps = np.diff(motion.time).tolist()
        lines = ["&ACCESS RVP", f"DEF {stem}( )", *(f"; {line}" for line in motion.heading)]
        lines += ["; angles in degrees; TIME_BLOCK PART in seconds, of TIME_BLOCK END in all", "BAS (#INITMOV, 0)"]
        lines += [
            *_speeds(_SLOW),
            f"PTP {points[0]}",
            *_speeds(100),
            "PTP_SPLINE",
            f"  SPTP {points[0]}",
            "  TIME_BLOCK START",
        ]
        for point, step in zip(points[1:], steps, strict=True):
            lines += [f"  SPTP {point}", f"  TIME_BLOCK PART = {step:.9f}"]
        lines += [f"  TIME_BLOCK END = {motion.time[-1]:.9f}", "ENDSPLINE", "END"]
        return MotionFile(("\r\n".join(lines) + "\r\n").encode("ascii", "replace"))

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """A client of KUKA RSI."""
        return rsi_recorder(motion)


def _speeds(percent: int) -> list[str]:
    """Velocities and accelerations of the axes, of their largest; those of the spline follow from its times."""
    return [f"$VEL_AXIS[{k}] = {percent}" for k in range(1, 7)] + [f"$ACC_AXIS[{k}] = 100" for k in range(1, 7)]


def _axes(degrees: list[float]) -> str:
    return "{" + ", ".join(f"A{k} {value + 0.0:.9f}" for k, value in enumerate(degrees, 1)) + "}"
