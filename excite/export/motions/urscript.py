"""A URScript program that follows the motion with ``servoj``, one position in every step of the controller.

The statements are those of the Script Manual of Universal Robots (e-Series, PolyScope 5): ``def``, ``local``,
``while``, ``if``, calls; ``servoj(q, a, v, t, lookahead_time, gain)`` holds the program for the time t. The positions
are in the program, in functions of some hundred steps each, so that nothing is read over the network on the way.
"""

from __future__ import annotations

import re

from excite.export.motions.certificate import Interpolation
from excite.export.motions.motion_format import MotionFile, MotionFormat, Recorder
from excite.export.motions.rtde_csv import MARKER, rtde_recorder
from excite.export.motions.sampled_design import SampledDesign
from regressors.errors import InputError

LOOKAHEAD, GAIN = 0.1, 300  # the manual's defaults: 0.03 to 0.2 s, and 100 to 2000
_NEAR = 0.01  # rad from the first pose, from which the program starts
_AT_ONCE = 500  # steps in one function
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_SEGMENT = {"approach": 1, "excite": 2, "return": 3}


class UrScript(MotionFormat):
    """Program with ``servoj`` in every step: 500 Hz of e-Series, 125 Hz of CB-Series; positions of six joints [rad]."""

    name = "urscript"
    suffix = ".script"
    default_rate, slowest, fastest = 500.0, 10.0, 500.0
    joints = (6,)
    most = 60_000
    interpolation = Interpolation.LINEAR
    given, decimals = 0, 14
    checked = (
        "when excite is tested, such programs are checked against the grammar of URScript; none was played on a robot: "
        "how servoj smooths the positions by its lookahead_time and gain, and how long a program may be, is not "
        "documented"
    )

    def check_rate(self, rate: float) -> None:
        """Raise `InputError` where a step is not a whole number of steps of the controller."""
        super().check_rate(rate)
        if not any(_is_whole(base / rate) for base in (500.0, 125.0)):
            raise InputError(
                f"`rate` {rate:g} Hz: URScript takes 500 Hz (e-Series), 125 Hz (CB-Series), or one of them divided by "
                "a whole number"
            )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The program, which stops unless the robot rests within 0.01 rad of the first pose."""
        if not _NAME.fullmatch(stem):
            raise InputError(
                f"{stem}.script: the program has the name of the file, which must be letters, digits and _ only"
            )
        rows = [_row(q) for q in motion.samples.q.tolist()]
        groups = _groups(motion.segments)
        lines = [f"def {stem}():", *(f"  # {line}" for line in motion.heading)]
        for number, (first, last, segment) in enumerate(groups):
            lines += [f"  def part_{number}():", f"    write_output_integer_register({MARKER}, {_SEGMENT[segment]})"]
            lines += [f"    step([{row}])" for row in rows[first:last]]
            lines.append("  end")
        lines[1 + len(motion.heading) : 1 + len(motion.heading)] = _beginning(rows[0], 1.0 / motion.rate)
        lines += ["  check_start()", *(f"  part_{number}()" for number in range(len(groups)))]
        lines += [f"  write_output_integer_register({MARKER}, 0)", "  stopj(2.0)", "end"]
        return MotionFile(("\n".join(lines) + "\n").encode())

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """The RTDE client."""
        return rtde_recorder(motion, name)


def _is_whole(ratio: float) -> bool:
    return ratio >= 1.0 - 1e-9 and abs(ratio - round(ratio)) < 1e-9


def _row(q: list[float]) -> str:
    return ",".join(f"{value:.14f}" for value in q)


def _groups(segments: tuple[str, ...]) -> list[tuple[int, int, str]]:
    """Steps of one function each, all of one segment."""
    ends = [k for k in range(1, len(segments)) if segments[k] != segments[k - 1]]
    groups = []
    for first, last in zip([0, *ends], [*ends, len(segments)], strict=True):
        groups += [(begin, min(begin + _AT_ONCE, last), segments[first]) for begin in range(first, last, _AT_ONCE)]
    return groups


def _beginning(start: str, step: float) -> list[str]:
    return [
        "  # servoj: t [s] is the step, lookahead_time [s] and gain are the defaults of the manual",
        f"  # output_integer_register {MARKER}: 1 approach, 2 excite, 3 return, 0 not moving",
        "  def step(q):",
        f"    servoj(q, 0, 0, {step:.9g}, {LOOKAHEAD}, {GAIN})",
        "  end",
        "  def check_start():",
        f"    local start = [{start}]",
        "    local now = get_actual_joint_positions()",
        "    local k = 0",
        "    while k < 6:",
        f"      if norm(now[k] - start[k]) > {_NEAR}:",
        '        popup("Move the robot to the first pose of the motion", "excite", False, True, True)',
        "        halt",
        "      end",
        "      k = k + 1",
        "    end",
        "  end",
    ]
