"""Library of the faults of logs: what each does to torques or positions, and the line of the mapping that mends it.

A load at the last link that nobody told of is no fault of a log, but may look like one. What its ten parameters phi add
to the joint torques is linear in them, ``K phi`` [KD96] eq. (8)-(10); torques that a rigid load explains far better
than nothing does, with a mass and a centre as loads have them, are named as its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.event import gaps, within
from excite.logs.log import Log
from regressors.errors import percent
from regressors.models.load import PayloadModel
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

Flags = NDArray[np.bool_]

LEAST_ERROR = 2e-3  # of the torques: a smaller one is no further evidence
ODD_GAIN, _ODD_AMONG_OTHERS = 1.25, 1.1  # a gain nearer to one is not a fault; nor one joint's to the others'


@dataclass(frozen=True)
class Moment:
    """When an instant of a log was."""

    log: str
    time: float  # [s]
    row: int
    passed: float  # share of the log before it


@dataclass(frozen=True, eq=False)
class Fault:
    """A fault of a log, which is undone by ``torques`` or by ``positions``."""

    kind: str
    joints: tuple[str, ...]  # whose columns are concerned
    what: str  # the sentence
    cure: str
    torques: Array | None = None  # (n, n): right-hand sides ``torques @ y``
    freedom: float = 0.0  # what fitting several values gains by itself, in the logarithm of the errors
    late: Index | None = None  # (n,) steps
    longest: float = 0.0  # of them [s]
    positions: tuple[Array, Array] | None = None  # ``A (n, n), b (n,)``: true positions ``A q + b``
    errors: Array = field(default_factory=lambda: np.zeros(0))  # (n,) of each equation, over its torque, without it
    parameters: Array = field(default_factory=lambda: np.zeros(0))  # of that fit
    shown: float = 0.0  # what a zero explains, in the logarithm of the errors, where bodies are free

    @property
    def size(self) -> float:
        """Sum of the logarithms of the errors, which is the likelihood with the noise of each equation unknown."""
        return float(np.sum(np.log(np.maximum(self.errors, LEAST_ERROR)))) + self.freedom

    @property
    def zero(self) -> float:
        """What is added to the positions of a joint [rad or m]."""
        return 0.0 if self.positions is None else float(self.positions[1].sum())

    @property
    def error(self) -> float:
        """Root mean square of the errors over the joints."""
        return float(np.sqrt(np.mean(self.errors**2)))


NO_FAULT = Fault("none", (), "", "")
FREEDOM, _FREEDOM_OF_TIME = 0.1, 0.3  # of each value that is fitted; of a change from the best time on
# no faults of a log
UNTOLD_LOAD, OTHER_MASSES = Fault("untold load", (), "", ""), Fault("other masses", (), "", "", freedom=FREEDOM)


def obvious_faults(names: tuple[str, ...], parts: tuple[PreparedLog, ...]) -> Iterator[Fault]:
    """Faults that need no model: magnitudes, values that are cut off, and clocks that jump."""
    for part in parts:
        y, dq = part.log.effort, part.samples.dq
        yield from clock_jumps(part.log)
        if y is None:
            continue
        yield from _clipped(names, y[~within(part.log.time, part.saturated)])
        both_ways = np.minimum(np.mean(dq > 0, axis=0), np.mean(dq < 0, axis=0)) > 0.2
        if np.all(y >= 0) and np.any(y > 0) and both_ways.all() and len(names) > 1:
            what = "the torques of all joints are never negative although all of them move both ways"
            cure = "record torques with their signs, or map the columns of the signed currents (`current:`)"
            yield Fault("magnitudes", names, f"{what}: they are magnitudes", cure)


_NEAR, _JUMP, _LEAST_MOTION = 5, 0.1, 0.01  # rows on either side [-], least jump [s], motion in it [rad or m]
_BETTER = 0.2  # part of the difference to the motion of the whole step that the motion of one row may leave


def clock_jumps(log: Log) -> Iterator[Fault]:
    """Gaps in which the robot has moved by no more than from one row to the next: no row is missing."""
    step = float(np.median(np.diff(log.time)))
    for gap in gaps(log):
        k = gap.row
        if gap.length < _JUMP or not _NEAR <= k < log.count - _NEAR - 1:
            continue
        ends = (k - _NEAR, k), (k + 1, k + 1 + _NEAR)
        speed = np.mean([(log.q[b] - log.q[a]) / (log.time[b] - log.time[a]) for a, b in ends], axis=0)
        moved = log.q[k + 1] - log.q[k]
        off = [float(np.linalg.norm(moved - duration * speed)) for duration in (step, gap.length)]
        if np.linalg.norm(gap.length * speed) > _LEAST_MOTION and off[0] < _BETTER * off[1]:
            what = (
                f"the clock jumps by {gap.length - step:.3g} s after row {gap.number}, while the robot moves by one row"
            )
            cure = f"subtract this from the times that follow, or use the rows before it (`rows='1:{gap.number}'`)"
            yield Fault("clock jump", (), what, cure)


_CLIPPED = 10  # rows in succession, and 1 % of all


def _clipped(names: tuple[str, ...], y: Array) -> Iterator[Fault]:
    """Joints whose largest torque is held exactly, as no noisy value is."""
    found = list[tuple[str, str, str]]()
    for name, column in zip(names, y.T, strict=True):
        within_range = column[(column > column.min()) & (column < column.max())]
        varied = np.unique(within_range).size > 0.2 * within_range.size
        for level in (column.max(), column.min()):
            at = np.flatnonzero(column == level)
            longest = max((run.size for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)), default=0)
            if varied and longest >= _CLIPPED and at.size > 0.01 * column.size:
                found.append((name, f"{level:.4g}", f"{at.size}"))
                break
    if found:
        joints, levels, rows = zip(*found, strict=True)
        what = f"the torques of {', '.join(joints)} are cut off at {', '.join(levels)} in {', '.join(rows)} rows"
        yield Fault("clipped", joints, what, "record them over their whole range, or leave these rows out (`rows`)")


def column_faults(names: tuple[str, ...]) -> Iterator[Fault]:
    """Faults of columns that have no value of their own."""
    n = len(names)
    for of, signed in (("torque", "torques"), ("position", "positions and velocities")):
        for a, b in combinations(range(n), 2):
            order = list(range(n))
            order[a], order[b] = b, a
            what = f"the {of} columns of {names[a]} and {names[b]} are exchanged"
            cure = f"exchange these two in `columns:` of the {of}s in the mapping{_order(names, order)}"
            yield Fault(f"{of}s swapped", (names[a], names[b]), what, cure, **_undone(of, np.eye(n)[order]))
        for j, name in enumerate(names):
            what, cure = f"the {of}s of {name} have the opposite sign", f"use `{_each('sign', n, j, '-1')}`"
            undone = _undone(of, np.diag(np.where(np.arange(n) == j, -1.0, 1.0)))
            yield Fault(f"{of} sign", (name,), what, f"{cure} for the {signed} in the mapping", **undone)
    for shift in (1, -1) if n > 2 else ():
        order = [(k + shift) % n for k in range(n)]
        what = f"the torque columns are shifted: that of {names[0]} is what stands for {names[shift % n]}"
        cure = f"shift `columns:` of the torques in the mapping by one{_order(names, order)}"
        yield Fault("torques shifted", names, what, cure, torques=np.eye(n)[order])


def _undone(of: str, A: Array) -> dict[str, Any]:
    """What undoes a fault of the torques, or of the positions."""
    return {"torques": A} if of == "torque" else {"positions": (A, np.zeros(len(A)))}


_UNITS = {1e3: ("kNm", "Nm"), 1e-3: ("mNm", "Nm")}  # of factors: what was recorded, and taken for


def gain_fault(names: tuple[str, ...], j: int, log_of_gain: float) -> Fault:
    """True torques of a joint are some times those in the log, unless that is nearly once."""
    n, gain = len(names), float(np.exp(log_of_gain))
    what = f"the torques of {names[j]} are {1 / gain:.2g} times what the other joints say of it"
    line = f"use `{_each('gain', n, j, f'{gain:.3g}')}` for the torques in the mapping"
    cure = f"check its torque constant and ratio, or {line}, or that factor of the gain that is there"
    for factor, (unit, taken) in _UNITS.items():
        if abs(np.log(gain / factor)) < np.log(ODD_GAIN):
            what = f"the torques of {names[j]} are in {unit}, not in {taken}"
            cure = f"use `{_each('unit', n, j, unit, taken)}` for the torques in the mapping"
    torques = np.diag(np.where(np.arange(n) == j, gain, 1.0))
    kind = "torque gain" if abs(log_of_gain) > np.log(_ODD_AMONG_OTHERS) else NO_FAULT.kind
    return Fault(kind, (names[j],), what, cure, torques)


_OF_MASSES = 1.5  # more than that a description is seldom off


def log_gain(gain: Fault) -> float:
    """Logarithm of the gain of one joint."""
    return 0.0 if gain.torques is None else float(np.sum(np.log(np.diag(gain.torques))))


def gain_or_masses(gain: Fault) -> Fault:
    """The gain of a joint that bodies of other masses explain, which is no fault of the log unless it is large."""
    size = abs(log_gain(gain))
    if size < np.log(_OF_MASSES):
        return NO_FAULT
    if size > np.log(_ODD_SCALE):
        return gain
    what = gain.what.replace("what the other joints say of it", "what the described masses make of them")
    return replace(gain, what=what, cure=f"{gain.cure}; or the masses of the description are off by as much")


_ODD_SCALE = 3.0  # masses of descriptions are off by less
_LEVEL, _MOVED = np.deg2rad([5.0, 2.0])  # a smaller tilt is not a fault, nor a smaller one from some time on
_DRIFT = 0.15  # a smaller change of friction is not stated
_OTHER_LENGTH = 0.1  # a smaller change of lengths is not a fault


def gains_fault(names: tuple[str, ...], gains: Array, shown: Flags, *, known: bool) -> Fault:
    """True torques of every joint are a factor of its own times those in the log, as far as it shows them."""
    size = np.where(shown, np.abs(np.log(gains)), 0.0)
    odd = np.flatnonzero(size > np.log(ODD_GAIN))
    if odd.size < 2 or (np.ptp(np.log(gains[shown])) < 2 * np.log(ODD_GAIN) and size.max() < np.log(_ODD_SCALE)):
        return NO_FAULT
    if known and np.count_nonzero(size > np.log(_OF_MASSES)) == 1 and size.max() > np.log(_ODD_SCALE):
        return NO_FAULT  # the gain of one joint, beside masses
    joints, values = (", ".join(x) for x in (np.array(names)[odd], [f"{1 / g:.2g}" for g in gains[odd]]))
    whose, scale = (
        ("the described robot", "as right as its masses, which another robot has otherwise")
        if known
        else ("all together", "up to one factor")
    )
    hidden = "".join(f"; that of {name} does not show" for name in np.array(names)[~shown])
    concerned, listed = tuple(np.array(names)[odd].tolist()), ", ".join(f"{g:.3g}" for g in np.where(shown, gains, 1.0))
    what = f"the torques of {joints} are {values} times what {whose} would need, as currents or drive units are"
    line = f"use `gain: [{listed}]` for the torques in the mapping, {scale}"
    cure = f"{line}, or the torque constants of the motors{hidden}"
    return Fault("gains", concerned, what, cure, np.diag(gains), freedom=FREEDOM * (len(names) - 1))


def gravity_fault(described: Array, gravity: Array) -> Fault:
    """Gravity acts in another direction than described, unless it is nearly the same."""
    angle = _angle(described, gravity)
    x = ",".join(f"{x:.2f}" for x in gravity)
    what = f"the base is tilted by {np.rad2deg(angle):.0f} degrees: gravity is ({x}) in its axes, and not as described"
    cure = f"use `gravity={x}`, or `gravity: [{x}]` in the robot's file"
    return Fault("gravity" if angle > _LEVEL else NO_FAULT.kind, (), what, cure, freedom=FREEDOM)


def _angle(a: Array, b: Array) -> float:
    """Between two vectors [rad]."""
    return float(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1.0, 1.0)))


def delay_fault(names: tuple[str, ...], late: Index, step: float) -> Fault:
    """Torques that were recorded later than the positions."""
    concerned = tuple(name for name, d in zip(names, late, strict=True) if d)
    delay = step * float(late[np.argmax(np.abs(late))])
    how = "later" if delay > 0 else "earlier"
    each = ", ".join(f"{step * float(d):.3g}" for d in late)
    kind, cure = "channel late", f"use `delay=({each})`, one of each joint, beside what all have now"
    what = f"the torques of {', '.join(concerned)} are {1e3 * abs(delay):.3g} ms {how} than those of the other joints"
    if len(concerned) == len(names):
        kind, cure = "late", f"use `delay={delay:.3g}`"
        what = f"all torques are {1e3 * abs(delay):.3g} ms {how} than the positions"
    return Fault(kind, concerned, what, cure, late=late, longest=abs(delay))


def late_from_fault(names: tuple[str, ...], late: Index, delay: float, moment: Moment) -> Fault:
    """Torques that were recorded later than the positions from some time on, as where rows of them were lost."""
    how = "later" if delay > 0 else "earlier"
    what = f"from {moment.time:.2f} s on all torques are {1e3 * abs(delay):.3g} ms {how} than before"
    cure = f"a clock jumped, or rows of one of them were lost: {_before(moment)}"
    return Fault("late from", names, what, cure, late=late, longest=abs(delay), freedom=_FREEDOM_OF_TIME)


def moved_fault(before: Array, after: Array, moment: Moment) -> Fault:
    """Gravity changes its direction in the axes of the base, unless it hardly does."""
    angle, x = _angle(before, after), ",".join(f"{x:.2f}" for x in after)
    what = f"from {moment.time:.2f} s on the base is tilted by {np.rad2deg(angle):.2g} degrees: gravity is ({x})"
    cure = f"fix the base and record again, or {_before(moment)}"
    kind = "moved base" if angle > _MOVED else NO_FAULT.kind
    return Fault(kind, (), what, cure, freedom=_FREEDOM_OF_TIME)


def _before(moment: Moment) -> str:
    """The line that leaves out what comes after some instant."""
    return f"use the rows of {moment.log} before it (`rows='1:{moment.row}'`)"


def drift_fault(names: tuple[str, ...], falls: Array) -> Fault:
    """Friction that falls, or rises, in the time of a log, as where drives grow warm."""
    off = np.flatnonzero(np.abs(falls) > _DRIFT)
    joints, values = ", ".join(names[j] for j in off), ", ".join(f"{100 * falls[j]:.0f}" for j in off)
    what = f"the friction of {joints} falls by {values} % over the log"
    cure = "record it again with warm drives, or use a part in which they are (`rows`)"
    kind = "drift" if off.size else NO_FAULT.kind
    return Fault(kind, tuple(names[j] for j in off), what, cure, freedom=FREEDOM * len(names))


def lengths_fault(robot: Robot, factors: Array, shown: Flags) -> Fault:
    """The lengths up to some joints are others than described."""
    long = np.flatnonzero(shown)
    factors = factors[long]
    joints = ", ".join(robot.joint_names[j] for j in long)
    what = (
        f"the lengths up to {joints} are {', '.join(f'{x:.2f}' for x in factors)} times those described: it is from "
        "another robot"
    )
    kind = "other lengths" if np.any(np.abs(factors - 1) > _OTHER_LENGTH) else NO_FAULT.kind
    cure = f"give the description of the robot that was recorded, such as another one of the family of {robot.name}"
    return Fault(kind, (), what, cure, freedom=FREEDOM * (robot.n - 1))


def zero_fault(names: tuple[str, ...], j: int, zero: float) -> Fault:
    """True positions of a joint are ``zero`` more than those in the log, which is off by as much the other way."""
    n, degrees = len(names), -float(np.rad2deg(zero))
    what = f"the zero of {names[j]} is off by {degrees:.3g} degrees"
    line = f"use `{_each('offset', n, j, f'{degrees:.3g}', '0')}` for the positions in the mapping"
    cure = f"{line} where their unit is deg, or {-zero:.3g} in rad"
    return Fault("zero", (names[j],), what, cure, positions=(np.eye(n), np.where(np.arange(n) == j, zero, 0.0)))


def _each(key: str, n: int, j: int, value: str, other: str = "1") -> str:
    """Line of a mapping with a value for each joint."""
    return f"{key}: [{', '.join(value if k == j else other for k in range(n))}]"


def _order(names: tuple[str, ...], order: list[int]) -> str:
    return f": the columns that now stand for {', '.join(names[k] for k in order)}, in this order"


def every_joint_moves(target: IdentificationTarget) -> bool:
    """Whether the equations are the torques of every joint, and all of them move."""
    equations = target.model.torque_equations()
    return equations is not None and equations.every_joint and target.motion.complete


_LOAD_INSTANTS = 1500
_LOAD_ROUNDS = 3  # of weights by the residuals
_LEAST_LOAD = 0.02  # of the torque: less is not searched for a load
_EXPLAINED = 0.4  # of the differences that may be left
_FARTHEST = 1.0  # from the last link's frame to the centre of mass [m]
_LIGHTEST = 0.05  # [kg]


def load_that_explains(
    target: IdentificationTarget, motion: Samples, difference: Array, measured: Array
) -> tuple[float, str] | None:
    """The load at the last link that explains most of a difference of joint torques, if one does.

    Its mass [kg], negative where the load is missing, and a sentence on its mass and place, and what it explains.
    """
    # difference, measured (N, n)
    if not (every_joint_moves(target) and target.robot.is_chain):  # the last links of a tree may all carry one
        return None
    size = float(np.linalg.norm(measured))
    before = float(np.linalg.norm(difference)) / size if size > 0 else 0.0
    if not _LEAST_LOAD < before < np.inf:
        return None
    some = np.unique(np.linspace(0, len(difference) - 1, _LOAD_INSTANTS).astype(int))
    y = difference[some]
    K = PayloadModel(target.robot).instants(motion.rows(some)).reshape(*y.shape, -1)
    deviation = np.sqrt(np.mean(y**2, axis=0))
    phi = np.zeros(K.shape[2])
    for _ in range(_LOAD_ROUNDS):
        weight = 1 / np.maximum(deviation, 1e-3 * deviation.max())
        phi = np.linalg.lstsq((K * weight[:, None]).reshape(-1, phi.size), (y * weight).ravel(), rcond=1e-8)[0]
        deviation = np.sqrt(np.mean((y - K @ phi) ** 2, axis=0))
    after = float(np.linalg.norm(y - K @ phi) / np.linalg.norm(measured[some]))
    mass = float(phi[0])
    if not (after < _EXPLAINED * before and is_load(phi if mass > 0 else -phi)):
        return None
    place = ", ".join(f"{x:.3f}" for x in phi[1:4] / mass)
    return mass, (
        f"a load of {abs(mass):.3g} kg at the last link, its centre at ({place}) m, would lower the "
        f"difference from {percent(before)} to {percent(after)} of the torque"
    )


def is_load(phi: Array) -> bool:
    """Whether the mass and the centre of ten parameters are those of a load."""
    return bool(phi[0] > _LIGHTEST and np.linalg.norm(phi[1:4]) < _FARTHEST * phi[0])
