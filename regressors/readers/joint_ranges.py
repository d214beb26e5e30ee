"""Ranges of joints as a URDF states them, and what it leaves open."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import compress

import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.readers.urdf_tree import TreeJoint
from regressors.robot.finding import Finding, MissingRange
from regressors.robot.robot import Robot

_DEGREES = 25.0  # rad; no joint turns four times to one side, and few have a range below 25 degrees


def range_of(joint: TreeJoint) -> tuple[float, float]:
    """Lower and upper position limit [rad or m]; infinite where there is none, or none is known.

    If one of them is stated, the other is zero, as URDF says. A range from zero to zero is what exporters write that do
    not know it, and counts as not stated.
    """
    if joint.kind == "continuous" or _is_missing(joint):
        return -np.inf, np.inf
    return joint.bounds.get("lower", 0.0), joint.bounds.get("upper", 0.0)


def _is_missing(joint: TreeJoint) -> bool:
    return joint.kind != "continuous" and not (joint.bounds.get("lower") or joint.bounds.get("upper"))


def range_findings(chain: Iterable[TreeJoint]) -> Iterator[Finding]:
    """What is not stated of the ranges of joints, and what is implausible."""
    for joint in chain:
        where, (lower, upper) = f"joint {joint.name!r}", range_of(joint)
        if _is_missing(joint):
            zero = "lower" in joint.bounds and "upper" in joint.bounds
            what = "<limit> says lower=0 and upper=0, which leaves no room" if zero else "no position limits are stated"
            held = ', type="fixed" if it does not move' if zero else ""
            advice = (
                f'write <limit lower="..." upper="..." effort="..." velocity="..."/> into the file, or '
                f'type="continuous" if it turns without end{held}, or give `position`'
            )
            yield MissingRange("missing", where, what, advice, joint.name)
        elif joint.kind != "continuous" and len(joint.bounds.keys() & {"lower", "upper"}) == 1:
            (other,) = {"lower", "upper"} - joint.bounds.keys()
            yield Finding("assumed", where, f"{other}=0, which <limit> does not state", f"write {other} into the file")
        elif joint.kind == "revolute" and any(_DEGREES < abs(bound) < np.inf for bound in (lower, upper)):
            what = f"turns from {lower:g} to {upper:g} rad"
            yield Finding("suspicious", where, what, "limits are in radians, not in degrees")


def refuse_missing_ranges(robot: Robot, moving: ArrayLike) -> None:
    """Raise `InputError` where joints shall move whose ranges are not known, though they have ends."""  # moving (n,)
    unlimited = np.isinf(robot.limits.lower) & np.isinf(robot.limits.upper) & np.asarray(moving, dtype=bool)
    names = set(compress(robot.joint_names, unlimited))
    missing = [note for note in robot.notes if isinstance(note, MissingRange) and note.joint in names]
    if missing:
        others = f" (the same for {', '.join(note.joint for note in missing[1:])})" if len(missing) > 1 else ""
        raise InputError(f"{robot.source}, {missing[0].where}: {missing[0].what}{others}; {missing[0].advice}")
