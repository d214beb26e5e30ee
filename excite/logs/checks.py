"""Whether the channels of a log can be what they say, of the robot that they are said to be of."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from excite.logs.gaps import gaps
from excite.logs.log import Log
from excite.logs.movement import mean_speed, moves, runs, span_ends
from excite.signals.noise import quantum
from regressors.errors import InputError
from regressors.library import built_in, built_in_names
from regressors.robot import Limits, Robot
from regressors.samples import Array

DEGREES = 180 / np.pi
_SLOWEST_RATE = 5.0  # [Hz]
_AGREE = 0.1
_ALIKE = 0.8  # correlation
_FAR = 0.1  # of the range of a joint
_SHORTEST_WAY = 0.01  # [rad or m]
_TIMES_TORQUE, _TIMES_SPEED = 3.0, 3.0
_HELD = 5  # samples at an extreme
_HINT = "a mapping converts it where the log is read, with unit: deg"


@dataclass(frozen=True)
class Finding:
    """One thing that was found; a `wrong` log is refused, anything else is worth a note."""

    wrong: bool
    text: str


@dataclass(frozen=True, eq=False)
class Case:
    """A log beside the robot's limits, in the log's order of joints."""

    log: Log
    robot: Robot
    should_move: tuple[str, ...] | None

    @cached_property
    def limits(self) -> Limits:
        """Limits of the log's joints."""
        return self.robot.limits.take([self.robot.joint_names.index(name) for name in self.log.joints])

    @cached_property
    def revolute(self) -> NDArray[np.bool_]:
        """Which of the log's joints turn."""
        kinds = {joint.name: joint.kind for joint in self.robot.joints}
        return np.array([kinds[name] == "revolute" for name in self.log.joints])

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """When some joint moves, shape (N,)."""
        return np.asarray(np.any(moves(self.log), axis=1))

    @cached_property
    def moved(self) -> NDArray[np.bool_]:
        """Which joints move far enough to be judged, shape (n,)."""
        return np.asarray(np.any(moves(self.log), axis=0) & (np.ptp(self.log.q, axis=0) > _SHORTEST_WAY))

    @cached_property
    def speed(self) -> Array:
        """Mean speed over short spans, shape (N, n)."""
        return mean_speed(self.log)


def check_log(log: Log, robot: Robot, should_move: Sequence[str] | None = None) -> tuple[str, ...]:
    """Notes on a log that can be used.

    Parameters
    ----------
    log : Log
    robot : Robot
        Of the log's joints; it may have others.
    should_move : sequence of str, optional
        Joints that have to move in the log.

    Returns
    -------
    tuple of str
        What is unusual about it: joints that rest, torques that are held at an extreme, limits passed by a little.

    Raises
    ------
    InputError
        It cannot be used: joints of another robot, gaps (see `excite.logs.gaps.segments`), positions or velocities in
        degrees, positions far beyond the limits, velocities that are not the slope of the positions, channels that do
        not change while the joint moves, torques far beyond the limits. All that is wrong is told at once.
    """
    _check_joints(log, robot)
    if log.count < 3:
        raise InputError(f"{log.source}: {log.count} rows are too few to be checked")
    case = Case(log, robot, None if should_move is None else tuple(should_move))
    found = [finding for check in _CHECKS for finding in check(case)]
    wrong = [finding.text for finding in found if finding.wrong]
    if wrong:
        raise InputError(f"{log.source}: {'; '.join(wrong)}")
    return tuple(finding.text for finding in found)


def _check_joints(log: Log, robot: Robot) -> None:
    unknown = [name for name in log.joints if name not in robot.joint_names]
    if not unknown:
        return
    others = [name for name in built_in_names() if set(log.joints) <= set(built_in(name).joint_names)]
    hint = f"; robots with these joints: {', '.join(others)}" if others else ""
    raise InputError(
        f"{log.source}: robot {robot.name} has no joint {', '.join(unknown)}; its joints: "
        f"{', '.join(robot.joint_names)}{hint}"
    )


def _rate(case: Case) -> Iterator[Finding]:
    if case.log.rate < _SLOWEST_RATE:
        yield Finding(
            True, f"{case.log.rate:.3g} samples per second; is the time in seconds? A mapping gives its unit (unit: ms)"
        )


def _gaps(case: Case) -> Iterator[Finding]:
    if found := gaps(case.log):
        more = f" and {len(found) - 3} more" if len(found) > 3 else ""
        yield Finding(True, f"gaps of {', '.join(map(str, found[:3]))}{more}; split the log at its gaps")


def _positions(case: Case) -> Iterator[Finding]:
    """Positions within the limits; where they are not, what would bring them there."""
    low, high = case.log.q.min(axis=0), case.log.q.max(axis=0)
    lower, upper = case.limits.lower, case.limits.upper
    over = np.maximum(lower - low, high - upper)
    far = over > _FAR * np.where(np.isfinite(upper - lower), upper - lower, np.inf)
    within = (low / DEGREES > lower) & (high / DEGREES < upper)
    if np.any(far & case.revolute) and np.all(within[case.revolute]):
        worst = int(np.argmax(np.where(case.revolute & far, np.maximum(-low, high), 0.0)))
        yield Finding(
            True,
            f"{case.log.joints[worst]}.position from {low[worst]:.4g} to {high[worst]:.4g} rad looks like degrees "
            f"(limits {lower[worst]:.4g} to {upper[worst]:.4g} rad); {_HINT}",
        )
        return
    for k in np.flatnonzero(over > 0):
        unit = "rad" if case.revolute[k] else "m"
        limits = f"limits {lower[k]:.4g} to {upper[k]:.4g} {unit} of {case.robot.name}"
        what = f"{case.log.joints[k]}.position from {low[k]:.4g} to {high[k]:.4g} {unit}"
        if far[k]:
            yield Finding(True, f"{what} is far beyond the {limits}: another robot, unit or zero?")
        else:
            yield Finding(False, f"{what} passes the {limits}")


def _speeds(case: Case) -> Iterator[Finding]:
    fastest = np.abs(case.speed).max(axis=0)
    for k in np.flatnonzero(fastest > _TIMES_SPEED * case.limits.velocity):
        unit = "rad/s" if case.revolute[k] else "m/s"
        yield Finding(
            True,
            f"{case.log.joints[k]} moves with up to {fastest[k]:.4g} {unit} by its positions, its limit is "
            f"{case.limits.velocity[k]:.4g} {unit}: unit of position (degrees?) or of time?",
        )


def _velocities(case: Case) -> Iterator[Finding]:
    """Velocity against the slope of the position: ``q(b) - q(a) = int_a^b dq dt`` over short spans."""
    if case.log.dq is None:
        return
    first, last = span_ends(case.log)
    step = np.diff(case.log.time)[:, None]
    path = np.vstack([np.zeros(case.log.dq.shape[1]), np.cumsum((case.log.dq[1:] + case.log.dq[:-1]) / 2 * step, 0)])
    mean = (path[last] - path[first]) / (case.log.time[last] - case.log.time[first])[:, None]
    for k in np.flatnonzero(case.moved):
        slope, velocity = case.speed[:, k], mean[:, k]
        ratio = float(slope @ velocity / (slope @ slope))
        alike = abs(ratio) * np.linalg.norm(slope) / max(float(np.linalg.norm(velocity)), np.finfo(float).tiny)
        if alike < _ALIKE:
            text = "does not follow the position: its columns may belong to another joint, or hold nothing"
            yield Finding(True, f"{case.log.joints[k]}.velocity {text}")
        elif abs(ratio - 1) > _AGREE:
            yield Finding(True, f"{case.log.joints[k]}.velocity {_relation(ratio)}")


def _relation(ratio: float) -> str:
    cases = {
        DEGREES: f"is {ratio:.3g} times the slope of the position: it looks like degrees per second; a mapping "
        "converts it where the log is read, with unit: deg/s",
        1 / DEGREES: f"is {ratio:.3g} times the slope of the position: the position looks like degrees; {_HINT}",
        -1.0: "has the opposite sign of the slope of the position; a mapping with sign: -1 turns one of them",
    }
    for value, text in cases.items():
        if abs(ratio - value) <= _AGREE * abs(value):
            return text
    return f"is {ratio:.3g} times the slope of the position; columns, ratio or unit of a mapping put it right"


def _resting(case: Case) -> Iterator[Finding]:
    resting = [name for name, moved in zip(case.log.joints, case.moved, strict=True) if not moved]
    if len(resting) == len(case.log.joints):
        yield Finding(True, "no joint moves")
    elif wrong := [name for name in resting if name in (case.should_move or ())]:
        yield Finding(True, f"{', '.join(wrong)} should move, but the position does not change")
    elif resting:
        yield Finding(False, f"{', '.join(resting)}: not moved")


def _constant(case: Case) -> Iterator[Finding]:
    for name, channel in (("velocity", case.log.dq), ("effort", case.log.effort)):
        if channel is None:
            continue
        for k in np.flatnonzero((np.ptp(channel, axis=0) == 0) & case.moved):
            yield Finding(True, f"{case.log.joints[k]}.{name} is {channel[0, k]:.4g} throughout, while the joint moves")


def _torques(case: Case) -> Iterator[Finding]:
    if case.log.effort is None:
        return
    largest = np.abs(case.log.effort).max(axis=0)
    for k in np.flatnonzero(largest > case.limits.torque):
        unit = "Nm" if case.revolute[k] else "N"
        far = bool(largest[k] > _TIMES_TORQUE * case.limits.torque[k])
        text = f"{case.log.joints[k]}.effort reaches {largest[k]:.4g} {unit}, its limit is {case.limits.torque[k]:.4g}"
        yield Finding(far, f"{text}: wrong unit, gain or ratio?" if far else text)


def _saturated(case: Case) -> Iterator[Finding]:
    """Torques that stay at their extreme value, having come there at speed."""
    if case.log.effort is None:
        return
    least = quantum(case.log.effort)
    for k in np.flatnonzero(np.ptp(case.log.effort, axis=0) > 0):
        tau = case.log.effort[:, k]
        for extreme in (tau.min(), tau.max()):
            held = (tau == extreme) & case.moving
            count = sum(b - a for a, b in runs(held) if b - a >= _HELD and _sudden(tau, a, b, 4 * least[k]))
            if count:
                yield Finding(
                    False,
                    f"{case.log.joints[k]}.effort is held at {extreme:.4g} in {count} rows: saturated there?",
                )


def _sudden(tau: Array, start: int, stop: int, least: float) -> bool:
    """Whether the signal was away from the plateau by more than rounding two samples before or after it."""
    beside = [tau[k] for k in (start - 2, stop + 1) if 0 <= k < tau.size]
    return any(abs(value - tau[start]) > least for value in beside)


_CHECKS: tuple[Callable[[Case], Iterator[Finding]], ...] = (
    _rate,
    _gaps,
    _positions,
    _speeds,
    _velocities,
    _resting,
    _constant,
    _torques,
    _saturated,
)
