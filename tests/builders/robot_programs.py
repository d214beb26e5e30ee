"""Small parsers of robot programs, written from the grammars of the manuals: a program that does not fit is refused.

URScript: Script Manual (e-Series, PolyScope 5), "The URScript Programming Language". KRL: KSS 8.3 Operating and
Programming Instructions for System Integrators, "Programming with KRL syntax". RAPID: Technical reference manual,
"RAPID Overview" and "MoveAbsJ".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

NUMBER = r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"


class NotInGrammar(Exception):
    """A line that the grammar does not have."""


def _numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(NUMBER, text)]


@dataclass
class UrProgram:
    """What a URScript program says: the functions it defines, and what runs when it is called."""

    name: str
    functions: dict[str, list[str]] = field(default_factory=dict)
    body: list[str] = field(default_factory=list)

    def steps(self) -> list[tuple[list[float], int]]:
        """Positions in the order of the calls, each with the marker that is set."""
        marker, steps = -1, []
        for call in self.body:
            for line in self.functions.get(call.removesuffix("()"), [call]):
                if line.startswith("write_output_integer_register"):
                    marker = int(_numbers(line)[1])
                if line.startswith("step("):
                    steps.append((_numbers(line), marker))
        return steps


_UR_EXPRESSION = r"[\w\[\]\.\-+<>(), \"]+"
_UR_STATEMENT = re.compile(rf"(?:local )?\w+ = {_UR_EXPRESSION}|\w+\({_UR_EXPRESSION}\)|\w+\(\)|halt", re.ASCII)
_UR_OPENING = re.compile(r"def (\w+)\((\w+(?:, ?\w+)*)?\):|(?:while|if) .+:", re.ASCII)


def ur_program(text: str) -> UrProgram:
    """Parse a URScript program: one function, functions in it, statements, blocks that end with ``end``."""
    lines = [line.strip() for line in text.splitlines()]
    lines = [line for line in lines if line and not line.startswith("#")]
    opening = re.fullmatch(r"def ([A-Za-z_]\w*)\(\):", lines[0], re.ASCII)
    if opening is None or lines[-1] != "end":
        raise NotInGrammar(lines[0])
    program, depth, inside = UrProgram(opening[1]), 0, ""
    for line in lines[1:-1]:
        if found := _UR_OPENING.fullmatch(line):
            if depth == 0 and found[1]:
                inside, program.functions[found[1]] = found[1], []
            depth += 1
        elif line == "end":
            depth -= 1
            inside = inside if depth else ""
        elif not _UR_STATEMENT.fullmatch(line):
            raise NotInGrammar(line)
        elif inside:
            program.functions[inside].append(line)
        else:
            program.body.append(line)
        if depth < 0:
            raise NotInGrammar(line)
    if depth:
        raise NotInGrammar("a block without end")
    return program


@dataclass
class KrlProgram:
    """Axis positions of a spline block [deg], and the parts of its time."""

    name: str
    start: list[float]
    points: list[list[float]]
    parts: list[float]
    total: float


_KRL_AXES = re.compile(r"\{" + ", ".join(rf"A{k} ({NUMBER})" for k in range(1, 7)) + r"\}")


def krl_program(text: str) -> KrlProgram:
    """Parse a KRL program with one PTP and one PTP_SPLINE block with TIME_BLOCK."""
    assert text.endswith("\r\n")
    lines = [line.strip() for line in text.split("\r\n")]
    lines = [line for line in lines if line and not line.startswith((";", "&"))]
    lines = [line for line in lines if not re.fullmatch(r"\$(VEL|ACC)_AXIS\[[1-6]\] = \d+|BAS \(#INITMOV, 0\)", line)]
    head = re.fullmatch(r"DEF ([A-Za-z_]\w{0,23})\( \)", lines[0], re.ASCII)
    if head is None or lines[-1] != "END" or lines[2] != "PTP_SPLINE" or lines[-2] != "ENDSPLINE":
        raise NotInGrammar(lines[0])
    program = KrlProgram(head[1], _axes(lines[1], "PTP "), [_axes(lines[3], "SPTP ")], [], 0.0)
    if lines[4] != "TIME_BLOCK START":
        raise NotInGrammar(lines[4])
    for line in lines[5:-3]:
        if line.startswith("SPTP "):
            program.points.append(_axes(line, "SPTP "))
        elif found := re.fullmatch(rf"TIME_BLOCK PART = ({NUMBER})", line):
            program.parts.append(float(found[1]))
        else:
            raise NotInGrammar(line)
    end = re.fullmatch(rf"TIME_BLOCK END = ({NUMBER})", lines[-3])
    if end is None:
        raise NotInGrammar(lines[-3])
    program.total = float(end[1])
    return program


def _axes(line: str, motion: str) -> list[float]:
    found = _KRL_AXES.fullmatch(line.removeprefix(motion)) if line.startswith(motion) else None
    if found is None:
        raise NotInGrammar(line)
    return [float(value) for value in found.groups()]


@dataclass
class RapidMove:
    """One MoveAbsJ: axes [deg], time [s] or None, zone."""

    axes: list[float]
    time: float | None
    zone: str


_RAPID_AXES = rf"\[\[({NUMBER}(?:,{NUMBER}){{5}})\],\[9E\+09(?:,9E\+09){{5}}\]\]"
_RAPID_MOVE = re.compile(rf"MoveAbsJ {_RAPID_AXES} \\NoEOffs, v\d+(?: \\T:=({NUMBER}))?, (fine|z\d+), tool0;")


def rapid_moves(text: str) -> list[RapidMove]:
    """Parse a RAPID module with one procedure of MoveAbsJ."""
    lines = [line.strip() for line in text.splitlines()]
    lines = [line for line in lines if line and not line.startswith("!")]
    module, procedure = re.fullmatch(r"MODULE (\w{1,32})", lines[0]), re.fullmatch(r"PROC (\w{1,32})\(\)", lines[1])
    if module is None or procedure is None or lines[-2:] != ["ENDPROC", "ENDMODULE"]:
        raise NotInGrammar(lines[0])
    moves = []
    for line in lines[2:-2]:
        found = _RAPID_MOVE.fullmatch(line)
        if found is None:
            raise NotInGrammar(line)
        axes = [float(value) for value in found[1].split(",")]
        moves.append(RapidMove(axes, float(found[2]) if found[2] else None, found[3]))
    return moves


SECOND = 1_000_000_000
STANDING = 1.1920929e-07  # FLT_EPSILON


def broken_rules(trajectory: Mapping[str, Any], joints: Sequence[str]) -> list[str]:
    """Rules of `JointTrajectoryController::validate_trajectory_msg` that a message breaks."""
    return list(_broken_rules(trajectory["joint_names"], trajectory["points"], trajectory["header"]["stamp"], joints))


def _broken_rules(
    names: Sequence[str], points: Sequence[Mapping[str, Any]], stamp: Mapping[str, int], joints: Sequence[str]
) -> Iterator[str]:
    count = len(names)
    if sorted(names) != sorted(joints):
        yield f"joint_names are {', '.join(names)}, those of the controller {', '.join(joints)}"
    if stamp["sec"] or stamp["nanosec"]:
        yield "header.stamp is not zero: it would start then, and not at once"
    if not points:
        yield "there are no points"
        return
    if any(abs(velocity) > STANDING for velocity in points[-1].get("velocities", ())):
        yield "the velocities of the last point are not zero"
    times = [_nanoseconds(**point["time_from_start"]) for point in points]
    if times[0] < 0 or any(later <= earlier for earlier, later in pairwise(times)):
        yield "time_from_start does not increase from point to point"
    if any(len(point["positions"]) != count for point in points):
        yield f"a point has not {count} positions"
    for rate in ("velocities", "accelerations"):
        if {len(point.get(rate, ())) for point in points} not in ({count}, {0}):
            yield f"points have not all {count} {rate}, or none"
    if any(len(point.get("effort", ())) for point in points):
        yield "a point has an effort, which controllers without an effort interface refuse"


def _nanoseconds(sec: int, nanosec: int) -> int:
    return int(sec) * SECOND + int(nanosec) if 0 <= nanosec < SECOND else -1
