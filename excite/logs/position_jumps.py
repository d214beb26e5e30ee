"""Positions that jump further than a joint can move: resets of an encoder, and single wrong readings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from excite.logs.event import SPIKE
from excite.logs.log import Log
from excite.logs.noise_level import quantum
from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array

_TIMES_SPEED = 1.5
_TIMES_OWN = 3.0  # the speed of the motion, where the joint has no limit
_NOISE = 12.0
_AROUND = 10  # rows whose median step is the speed about a jump
_BACK = 5  # rows after which a wrong reading is over
_BESIDE = 0.2  # of a jump
_RARE = 0.01  # of the rows: what jumps more often is no jump, but of another unit
_ALIKE = 0.2  # of a jump, by which the jump back may differ


@dataclass(frozen=True)
class Jump:
    """A joint's position that is another from a row on."""

    joint: int
    row: int  # first row after it, 0 for the first of the log
    size: float  # beyond the joint's motion [rad or m]


def without_spikes(log: Log, robot: Robot) -> Log:
    """Leave out rows in which a position jumps away and back.

    A position jumps where it changes from one row to the next by 1.5 times more than its velocity limit allows, and by
    12 times its noise. Of a joint without a limit, three times the speed of its motion stands for it.
    """
    lost = np.zeros(log.count, dtype=bool)
    for jumps, _ in _all_jumps(log, robot):
        for jump, back in _pairs(jumps):
            if back is not None:
                lost[jump.row : back.row] = True
    return log.without(SPIKE, lost) if lost.any() else log


def check_resets(log: Log, robot: Robot) -> None:
    """Refuse a log whose positions jump and do not come back."""
    for jumps, unit in _all_jumps(log, robot):
        for jump, back in _pairs(jumps):
            if back is None:
                raise _reset(log, log.joints[jump.joint], jump, unit)


def _all_jumps(log: Log, robot: Robot) -> Iterator[tuple[list[Jump], str]]:
    """Jumps of each joint that the robot has, and the unit of its position."""
    if log.count < 4 * _AROUND:
        return
    for k, name in enumerate(log.joints):
        if name in robot.joint_names:
            j = robot.joint_index(name)
            yield _jumps(log, k, float(robot.limits.velocity[j])), robot.joints[j].unit


def _pairs(jumps: list[Jump]) -> Iterator[tuple[Jump, Jump | None]]:
    """Jumps with the ones that undo them, where they are undone soon."""
    while jumps:
        first, *jumps = jumps
        back = next((k for k, jump in enumerate(jumps) if _undoes(first, jump)), None)
        yield first, None if back is None else jumps[back]
        jumps = jumps if back is None else jumps[back + 1 :]


def _jumps(log: Log, joint: int, fastest: float) -> list[Jump]:
    q, time = log.q[:, joint], log.time
    usual = float(np.median(np.diff(time)))
    change = np.diff(q)
    if 2.0 * float(np.abs(change).max()) <= _TIMES_SPEED * fastest * usual < np.inf:
        return []  # no change can be that far from the median of others
    motion = _median_about(change)
    beyond = change - motion
    if not np.isfinite(fastest):
        fastest = _TIMES_OWN * float(np.abs(motion).max()) / usual
    noise = max(_NOISE * _noise(change), 3.0 * float(quantum(q[:, None])[0]))
    most = np.maximum(_TIMES_SPEED * fastest * np.maximum(np.diff(time), usual), noise)
    rows = np.flatnonzero((np.abs(beyond) > most) & ~_accompanied(beyond))
    return [] if rows.size > _RARE * q.size + 2 else [Jump(joint, int(k) + 1, float(beyond[k])) for k in rows]


def _accompanied(beyond: Array) -> NDArray[np.bool_]:
    """Whether a change has others like it beside it, as of a joint that was hit and does move so fast."""
    beside = [np.roll(beyond, k) for k in (-2, -1, 1, 2)]
    return np.asarray(np.any([other * np.sign(beyond) > np.abs(beyond) * _BESIDE for other in beside], axis=0))


def _noise(change: Array) -> float:
    """Deviation of the changes of a position, whatever single ones are [rad or m]."""
    second = np.diff(change)
    return float(np.median(np.abs(second - np.median(second)))) / 0.6745


def _median_about(change: Array) -> Array:
    return np.asarray(scipy.ndimage.median_filter(change, 2 * _AROUND + 1, mode="nearest"))


def _undoes(jump: Jump, other: Jump) -> bool:
    near = other.row - jump.row <= _BACK
    return near and abs(jump.size + other.size) <= _ALIKE * abs(jump.size)


def _reset(log: Log, name: str, jump: Jump, unit: str) -> InputError:
    number, first, last = (int(log.row_numbers[k]) for k in (jump.row, 0, -1))
    return InputError(
        f"{log.source}: the position of joint {name} jumps by {jump.size:.3g} {unit} in row {number}, more than it "
        "can move: its encoder was reset, or two recordings are joined; use the rows before it "
        f"(`rows='{first}:{number - 1}'`) or from it on (`rows='{number}:{last}'`), whichever positions are right"
    )
