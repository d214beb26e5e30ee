"""Plausibility checks of the channels of a log against the robot they belong to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from excite.logs import channel_checks, motion_checks
from excite.logs.case import Case, Finding
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.readers.library import built_in, built_in_names
from regressors.robot.robot import Robot

_CHECKS: tuple[Callable[[Case], Iterator[Finding]], ...] = (
    motion_checks.rates,
    motion_checks.missing_instants,
    motion_checks.positions,
    motion_checks.speeds,
    motion_checks.velocities,
    motion_checks.resting_joints,
    channel_checks.constant_channels,
    channel_checks.torques,
    channel_checks.saturated_torques,
)


def check_log(log: Log, robot: Robot, should_move: Sequence[str] | None = None) -> tuple[str, ...]:
    """Check a log for plausibility, and return notes on a usable one."""
    known, others = joints_of(log, robot)
    if log.count < 3:
        raise InputError(f"{log.source}: {log.count} rows are too few to be checked")
    case = Case(log.of(known), robot, None if should_move is None else tuple(should_move))
    findings = [finding for check in _CHECKS for finding in check(case)]
    wrong = [finding.text for finding in findings if finding.wrong]
    if wrong:
        raise InputError(f"{log.source}: {'; '.join(wrong)}")
    notes = [f"{', '.join(others)}: no joints of {robot.name}, not checked"] if others else []
    return (*notes, *(finding.text for finding in findings))


def joints_of(log: Log, robot: Robot) -> tuple[list[str], list[str]]:
    """Joints of a log that the robot has, and those that it does not have."""
    known = [name for name in log.joints if name in robot.joint_names]
    if known:
        return known, [name for name in log.joints if name not in known]
    others = [name for name in built_in_names() if set(log.joints) <= set(built_in(name).joint_names)]
    hint = f"; robots with these joints: {', '.join(others)}" if others else ""
    raise InputError(
        f"{log.source}: robot {robot.name} has none of its joints {', '.join(log.joints)}; the robot's joints: "
        f"{', '.join(robot.joint_names)}{hint}"
    )
