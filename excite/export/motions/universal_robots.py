"""Motions for controllers of Universal Robots: URScript programs, and tables for the RTDE client library.

A program follows the motion with ``servoj``, one position in every step of the controller. The statements are those of
the Script Manual of Universal Robots (e-Series, PolyScope 5): ``def``, ``local``, ``while``, ``if``, calls;
``servoj(q, a, v, t, lookahead_time, gain)`` holds the program for the time t. The positions are in the program, in
functions of some hundred steps each, so that nothing is read over the network on the way.
"""

from __future__ import annotations

from itertools import groupby

import numpy as np

from excite.export.motions.motion_format import (
    Interpolation,
    MotionFile,
    MotionFormat,
    Recorder,
    channels,
    check_stem,
    rows_of,
    xml_comment,
)
from excite.export.motions.sampled_design import SEGMENTS, SampledDesign
from regressors.errors import InputError

LOOKAHEAD, GAIN = 0.1, 300  # the manual's defaults: 0.03 to 0.2 s, and 100 to 2000
_NEAR = 0.01  # rad from the first pose, from which the program starts
_AT_ONCE = 500  # steps in one function
_FASTEST = 500.0  # of e-Series [Hz]
MARKER = 24  # integer register for the segment; 24 to 47 are for external RTDE clients


class _UniversalRobots(MotionFormat):
    """A motion for a controller of Universal Robots."""

    joints = (6,)

    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """``record_configuration.xml`` of the RTDE library's example ``record.py``, and how its file is read."""
        forms = {"position": ("actual_q_{}", "rad"), "velocity": ("actual_qd_{}", "rad/s")}
        forms |= {"current": ("actual_current_{}", "A"), "temperature": ("joint_temperatures_{}", "degC")}
        return Recorder(
            {"separator": "whitespace", **channels(("timestamp", "s"), range(6), **forms)},
            (
                f"record: python record.py --config {name}.record.xml --frequency {_FASTEST:g} --output {name}.log.csv",
                f"rate: {_FASTEST:g} Hz of e-Series, 125 Hz of CB-Series",
                f"start marker: output_int_register_{MARKER} is 1 on the approach, 2 while it excites, 3 on the return",
                "gain: torque constants of the drives [Nm/A]; 1 gives torques in amperes",
            ),
            ".xml",
            _recipe(motion),
            (
                "the gains of the currents in the mapping are 1: write the torque constants [Nm/A] of the joints "
                "there, or calibrate them with `loaded` and `known_mass`; controllers since 5.23 also have the field "
                "actual_current_as_torque",
            ),
        )


class UrScript(_UniversalRobots):
    """Program with ``servoj`` in every step: 500 Hz of e-Series, 125 Hz of CB-Series; positions of six joints [rad]."""

    name = "urscript"
    suffix = ".script"
    default_rate, slowest, fastest = _FASTEST, 10.0, _FASTEST
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
        ratios = [base / rate for base in (500.0, 125.0)]
        if not any(ratio >= 1.0 - 1e-9 and abs(ratio - round(ratio)) < 1e-9 for ratio in ratios):
            raise InputError(
                f"`rate` {rate:g} Hz: URScript takes 500 Hz (e-Series), 125 Hz (CB-Series), or one of them divided by "
                "a whole number"
            )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """The program, which stops unless the robot rests within 0.01 rad of the first pose."""
        check_stem(stem, ".script", "program", "[A-Za-z_][A-Za-z0-9_]*", " only")
        rows = [",".join(f"{value:.14f}" for value in q) for q in motion.samples.q.tolist()]
        groups = _groups(motion.segments)
        lines = [f"def {stem}():", *(f"  # {line}" for line in motion.heading), *_beginning(rows[0], 1.0 / motion.rate)]
        for number, (first, last, segment) in enumerate(groups):
            lines += [f"  def part_{number}():", f"    write_output_integer_register({MARKER}, {SEGMENTS[segment]})"]
            lines += [f"    step([{row}])" for row in rows[first:last]]
            lines.append("  end")
        lines += ["  check_start()", *(f"  part_{number}()" for number in range(len(groups)))]
        lines += [f"  write_output_integer_register({MARKER}, 0)", "  stopj(2.0)", "end"]
        return MotionFile(("\n".join(lines) + "\n").encode())


def _groups(segments: tuple[str, ...]) -> list[tuple[int, int, str]]:
    """Steps of one function each, all of one segment."""
    groups, first = [], 0
    for segment, run in groupby(segments):
        last = first + len(list(run))
        groups += [(begin, min(begin + _AT_ONCE, last), segment) for begin in range(first, last, _AT_ONCE)]
        first = last
    return groups


def _beginning(start: str, step: float) -> list[str]:
    return f"""\
  # servoj: t [s] is the step, lookahead_time [s] and gain are the defaults of the manual
  # output_integer_register {MARKER}: 1 approach, 2 excite, 3 return, 0 not moving
  def step(q):
    servoj(q, 0, 0, {step:.9g}, {LOOKAHEAD}, {GAIN})
  end
  def check_start():
    local start = [{start}]
    local now = get_actual_joint_positions()
    local k = 0
    while k < 6:
      if norm(now[k] - start[k]) > {_NEAR}:
        popup("Move the robot to the first pose of the motion", "excite", False, True, True)
        halt
      end
      k = k + 1
    end
  end""".splitlines()


class RtdeCsv(_UniversalRobots):
    """``timestamp`` [s], ``target_q_0`` to ``_5`` [rad], ``target_qd`` [rad/s], ``target_qdd`` [rad/s^2].

    Separated by spaces. The reader makes a number of every cell and takes no comments, so that the hash of the design
    is the name of the last column, whose cells are 0.
    """

    name = "rtde"
    suffix = ".csv"
    default_rate, slowest, fastest = _FASTEST, 1.0, _FASTEST
    interpolation = Interpolation.NOT_DOCUMENTED
    checked = (
        "the file has the layout that the CSVReader of the RTDE client library reads; none was played on a robot, and "
        "what it makes of the targets depends on the program that takes them"
    )

    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Header and rows."""
        names = ["timestamp", *(f"{what}_{k}" for what in ("target_q", "target_qd", "target_qdd") for k in range(6))]
        samples = motion.samples
        table = np.column_stack([samples.time, samples.q, samples.dq, samples.ddq])
        head = " ".join([*names, f"design_sha256_{motion.sha256}"])
        rows = "".join(f"{row} 0\n" for row in rows_of(table, " "))
        return MotionFile(f"{head}\n{rows}".encode())


_VECTORS = ("target_q", "target_qd", "target_qdd", "target_current", "target_moment", "actual_q", "actual_qd")
FIELDS = {
    "timestamp": "DOUBLE",
    **dict.fromkeys((*_VECTORS, "actual_current", "joint_temperatures"), "VECTOR6D"),
    "runtime_state": "UINT32",
    f"output_int_register_{MARKER}": "INT32",
}


def _recipe(motion: SampledDesign) -> str:
    fields = "\n".join(f'        <field name="{name}" type="{kind}"/>' for name, kind in FIELDS.items())
    return (
        f'<?xml version="1.0"?>\n<!--\n{xml_comment(motion)}\n-->\n<rtde_config>\n    <recipe key="out">\n{fields}\n'
        "    </recipe>\n</rtde_config>\n"
    )
