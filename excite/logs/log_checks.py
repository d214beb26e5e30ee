"""A log against the robot that it belongs to: whether its channels are plausible, and joints of closed loops it lacks.

Each check yields pairs: whether the log is refused, and a sentence, which else becomes a note.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from excite.logs.event import LONGEST, gaps, plateaus
from excite.logs.excitation import mean_speed, moves, span_ends
from excite.logs.log import Log, integrate_rates
from regressors.errors import InputError, listed_names
from regressors.readers.library import built_in, built_in_names
from regressors.robot.moving_base import BASE_JOINTS
from regressors.robot.robot import Robot
from regressors.robot.symbolic.loops import Loops, loops_of
from regressors.samples import Array, Samples

Findings = Iterator[tuple[bool, str]]
_DEGREES = 180 / np.pi
_SLOWEST_RATE, _FASTEST_RATE = 5.0, 1e4  # [Hz]
_SHORTEST_PATH = 0.01  # [rad or m], of a joint that is judged
_AGREE = 0.1
_ALIKE = 0.8  # correlation
_FAR = 0.1  # of the range of a joint
_MOST_TURNS = 20 * np.pi
_TIMES_LIMIT = 3.0  # of a speed or a torque
_LEAST_USED = 0.05  # of a torque limit, by a log in thousandths of its unit
_HINT = "give a mapping with unit: deg, which converts it"


def check_log(log: Log, robot: Robot, *, may_rest: bool = False) -> tuple[str, ...]:
    """Check a log for plausibility, and return notes on a usable one; a log in which no joint moves may be one."""
    known, others = joints_of(log, robot)
    if log.count < 3:
        raise InputError(f"{log.source}: {log.count} rows are too few to be checked")
    case = _Case(log.of(known), robot, may_rest)
    checks = (_instants, _positions, _speeds, _velocities, _resting_joints, _constant_channels, _torques)
    findings = [finding for check in checks for finding in check(case)]
    if wrong := [text for refused, text in findings if refused]:
        raise InputError(f"{log.source}: {'; '.join(wrong)}")
    notes = [f"{', '.join(others)}: no joints of {robot.name}, not checked"] if others else []
    return (*notes, *(text for _, text in findings))


def joints_of(log: Log, robot: Robot) -> tuple[list[str], list[str]]:
    """Joints of a log that the robot has, and those that it does not have."""
    known = [name for name in log.joints if name in robot.joint_names]
    if known:
        return known, [name for name in log.joints if name not in known]
    others = [name for name in built_in_names() if set(log.joints) <= set(built_in(name).joint_names)]
    hint = f"robots with these joints: {', '.join(others)}" if others else "`robot` names them where a log is read"
    raise InputError(
        f"{log.source}: robot {robot.name} has none of its joints {', '.join(log.joints)}; the robot's joints: "
        f"{', '.join(robot.joint_names)}; {hint}"
    )


class _Case:
    """A log with the robot's limits, in the log's order of joints."""

    def __init__(self, log: Log, robot: Robot, may_rest: bool) -> None:
        index, moving = [robot.joint_names.index(name) for name in log.joints], moves(log)
        self.log, self.robot, self.may_rest = log, robot, may_rest
        self.limits = robot.limits.take(index)
        self.units = [robot.joints[k].unit for k in index]
        self.revolute = np.array([unit == "rad" for unit in self.units])
        self.moving = np.any(moving, axis=1)  # (N,) whether some joint moves
        # (n,) whether a joint moves far enough to be judged
        self.moved = np.any(moving, axis=0) & (np.ptp(log.q, axis=0) > _SHORTEST_PATH)
        self.speed = mean_speed(log)  # (N, n) over short spans


def _instants(case: _Case) -> Findings:
    """Rates that no log has, and gaps that are too long to be bridged."""
    if case.log.rate < _SLOWEST_RATE:
        how = "check that time is in seconds, or give its unit in a mapping (unit: ms)"
        yield True, f"{case.log.rate:.3g} samples per second; {how}"
    if intervals := [gap for gap in gaps(case.log) if gap.length > LONGEST]:
        where = f"gaps of {listed_names(map(str, intervals), 3)}"
        yield True, f"{where}; split the log at its gaps, or use the rows between them (`rows`)"


def _positions(case: _Case) -> Findings:
    """Positions against the limits, with a correction where they exceed them."""
    low, high = case.log.q.min(axis=0), case.log.q.max(axis=0)
    lower, upper = case.limits.lower, case.limits.upper
    over = np.maximum(lower - low, high - upper)
    far = over > _FAR * np.where(np.isfinite(upper - lower), upper - lower, np.inf)
    within = (low / _DEGREES > lower) & (high / _DEGREES < upper)
    turn = float(np.maximum(-low, high)[case.revolute].max(initial=0.0)) > 4 * np.pi  # else a zero may be off
    if turn and np.any(far & case.revolute) and np.all(within[case.revolute]):
        worst = int(np.argmax(np.where(case.revolute & far, np.maximum(-low, high), 0.0)))
        looks = f"looks like degrees (limits {lower[worst]:.4g} to {upper[worst]:.4g} rad); {_HINT}"
        yield True, f"{case.log.joints[worst]}.position from {low[worst]:.4g} to {high[worst]:.4g} rad {looks}"
        return
    for k in np.flatnonzero(np.isinf(upper - lower) & case.revolute & (np.maximum(-low, high) > _MOST_TURNS)):
        turns = f"{case.log.joints[k]}.position reaches {max(-low[k], high[k]):.4g} rad, many turns"
        yield False, f"{turns}; if these are degrees: {_HINT}"
    for k in np.flatnonzero(over > 0):
        limits = f"limits {lower[k]:.4g} to {upper[k]:.4g} {case.units[k]} of {case.robot.name}"
        what = f"{case.log.joints[k]}.position from {low[k]:.4g} to {high[k]:.4g} {case.units[k]}"
        relation = f"is far beyond the {limits}; check robot, unit and zero"
        yield bool(far[k]), f"{what} {relation if far[k] else f'slightly exceeds the {limits}'}"


def _speeds(case: _Case) -> Findings:
    """The slope of the positions against the velocity limits, which some descriptions have as placeholders only."""
    fastest, q, limits = np.abs(case.speed).max(axis=0), case.log.q, case.limits
    within = np.all((q >= limits.lower) & (q <= limits.upper), axis=0) & np.isfinite(limits.upper - limits.lower)
    for k in np.flatnonzero(fastest > _TIMES_LIMIT * limits.velocity):
        unit, usable = f"{case.units[k]}/s", bool(within[k]) and case.log.rate < _FASTEST_RATE
        check = "check the units of position (degrees?) and of time"
        check += ", and whether the limit is a placeholder" * usable
        fast = f"{case.log.joints[k]} moves at up to {fastest[k]:.4g} {unit} by its positions"
        yield not usable, f"{fast}, but its limit is {limits.velocity[k]:.4g} {unit}; {check}"


def _velocities(case: _Case) -> Findings:
    """Velocities against the slope of the positions: ``q(b) - q(a) = int_a^b dq dt`` over short spans."""
    time, dq = case.log.time, case.log.dq
    if dq is None:
        return
    first, last = span_ends(case.log)
    path = integrate_rates(time, dq)
    mean = (path[last] - path[first]) / (time[last] - time[first])[:, None]
    for k in np.flatnonzero(case.moved):
        slope, velocity = case.speed[:, k], mean[:, k]
        ratio = float(slope @ velocity / (slope @ slope))
        alike = abs(ratio) * np.linalg.norm(slope) / max(float(np.linalg.norm(velocity)), np.finfo(float).tiny)
        if alike < _ALIKE:
            text = "does not follow the position: its column may belong to another joint, or be empty"
            yield True, f"{case.log.joints[k]}.velocity {text}"
        elif abs(ratio - 1) > _AGREE:
            yield True, f"{case.log.joints[k]}.velocity {_relation(ratio)}"


def _relation(ratio: float) -> str:
    other = f"is {ratio:.3g} times the slope of the position"
    cases = {
        _DEGREES: f"{other}: it looks like degrees per second; give a mapping with unit: deg/s, which converts it",
        1 / _DEGREES: f"{other}: the position looks like degrees; {_HINT}",
        -1.0: "has the opposite sign of the slope of the position; give a mapping with sign: -1 for one of them",
    }
    alike = [text for value, text in cases.items() if abs(ratio - value) <= _AGREE * abs(value)]
    return next(iter(alike), f"{other}; correct columns, ratio or unit in a mapping")


def _resting_joints(case: _Case) -> Findings:
    still = [name for name, moved in zip(case.log.joints, case.moved, strict=True) if not moved]
    resting = [name for name in still if name not in BASE_JOINTS]
    if len(still) == len(case.log.joints) and not case.may_rest:
        yield True, "no joint moves"
    elif resting:
        yield False, f"{', '.join(resting)}: not moved"


def _constant_channels(case: _Case) -> Findings:
    """Channels that are constant while their joint moves."""
    for name, channel in (("velocity", case.log.dq), ("effort", case.log.effort)):
        if channel is not None:
            driven = ~np.isin(case.log.joints, _unmeasured(case) if name == "effort" else ())
            for k in np.flatnonzero((np.ptp(channel, axis=0) == 0) & case.moved & driven):
                yield True, f"{case.log.joints[k]}.{name} is constant at {channel[0, k]:.4g} while the joint moves"


def _unmeasured(case: _Case) -> tuple[str, ...]:
    """Joints that may have efforts of zero: passive ones, those of a base, and all where nothing else is measured."""
    of_base = case.robot.base_joints
    own = [k for k, joint in enumerate(case.log.joints) if joint not in of_base]
    alone = bool(of_base) and case.log.effort is not None and not case.log.effort[:, own].any()
    return case.log.joints if alone else (*case.robot.passive, *of_base)


def _torques(case: _Case) -> Findings:
    """Torques against the limits of the robot, and those that stay at their extreme value after a sudden change."""
    if case.log.effort is None:
        return
    largest, limit = np.abs(case.log.effort).max(axis=0), case.limits.torque
    for k in np.flatnonzero(largest > limit):
        unit = "Nm" if case.revolute[k] else "N"
        far = bool(largest[k] > _TIMES_LIMIT * limit[k])
        text = f"{case.log.joints[k]}.effort reaches {largest[k]:.4g} {unit}, but its limit is {limit[k]:.4g}"
        thousandths = bool(_LEAST_USED * limit[k] < largest[k] / 1e3 < limit[k])
        check = "check its unit, gain and ratio" + f"; m{unit} would be within (`unit:` in a mapping)" * thousandths
        yield far, f"{text}; {check}" if far else text
    for k in np.flatnonzero(np.ptp(case.log.effort, axis=0) > 0):
        tau = case.log.effort[:, k]
        for extreme in (tau.min(), tau.max()):
            if count := sum(b - a for a, b in plateaus(tau, extreme, case.moving)):
                held = f"is held at {extreme:.4g} in {count} rows, so it may be saturated"
                yield False, f"{case.log.joints[k]}.effort {held}"


def with_every_joint(log: Log, robot: Robot) -> Log:
    """The log with the dependent joints that it lacks, from the independent ones; passive joints have no torque."""
    loops, names = loops_of(robot), robot.joint_names
    absent = [name for name in names if name not in log.joints]
    driven = [names[k] for k in sorted({*loops.independent, *loops.driven})]
    if missing := [name for name in driven if name in absent]:
        raise InputError(
            f"{log.source}: no position of {listed_names(missing)}; give those of {listed_names(driven)}, from which "
            "the loops determine all others, or of all joints; or state in the description of the robot which joints "
            "have no drive (`passive:`)"
        )
    acting = [name for name in robot.passive if name in log.joints and _acts(log, name)]
    if acting:
        raise InputError(
            f"{log.source}: torques of {listed_names(acting)} are not zero, but no drive acts on passive joints; leave "
            "these columns out, or take these joints from `passive:` in the description of the robot"
        )
    if not absent:
        return log
    known = log.of([name for name in names if name not in absent])
    place = [names.index(name) for name in known.joints]
    q, dq = _solved(log, loops)
    q[:, place] = known.q
    effort = None if known.effort is None else np.zeros(q.shape)
    if effort is not None:
        effort[:, place] = known.effort
    note = f"{', '.join(absent)}: not in the log, solved from {', '.join(loops.names)}"
    return replace(
        log,
        joints=names,
        q=q,
        dq=None if known.dq is None else dq,
        effort=effort,
        temperature=None if known.temperature is None else np.tile(known.temperature.mean(axis=1), (robot.n, 1)).T,
        command=None,
        left_out=(*log.left_out, note),
    )


def _acts(log: Log, name: str) -> bool:
    return log.effort is not None and bool(np.any(log.effort[:, log.joints.index(name)]))


def _solved(log: Log, loops: Loops) -> tuple[Array, Array]:
    """Positions and velocities of all joints, as the independent ones move."""
    recorded = log.of(loops.names)
    q, left = loops.reached(recorded.q)
    loops.check(log.time, q, left, log.source)
    dq, still = np.zeros(q.shape), np.zeros(q.shape)
    if recorded.dq is not None:
        dq[:, list(loops.independent)] = recorded.dq
    return q, loops.rates(Samples(log.time, q, dq, still, still)).dq
