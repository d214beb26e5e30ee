"""Rows near standstill, where friction may hold a drive: its torque is then anything up to the break-away torque.

Friction of a drive at rest is what the rest of its torque asks for, not a function of the motion. A row of the
equations that contains it says nothing about the parameters then, and biases those of a small torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from excite.identification.friction_directions import drive_rows
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.movement import runs
from regressors.errors import InputError
from regressors.samples import Array

SPEEDS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)  # candidates, of the typical speed of the drives that move
_NOTHING = 1e-12  # of a drive's torque in an equation


def without_standstill(part: PreparedLog, target: IdentificationTarget, speed: float | None) -> PreparedLog:
    """The log with the stretches of each equation in which a drive whose torque it contains hardly moves."""
    if not speed:
        return part
    equations = target.model.torque_equations()
    if equations is None:
        raise InputError("`standstill` is for models of joint torques at single instants")
    slow = least_speeds(part, target) < speed
    labels = [name for name, _ in target.model.row_labels]
    each = ", ".join(f"{100 * share:.2g} % of {name}" for name, share in zip(labels, slow.mean(axis=0), strict=True))
    note = f"rows left out while a drive is slower than {speed:.3g} rad/s (m/s), where friction may hold it: {each}"
    time = part.samples.time
    spans = tuple(tuple((float(time[a]), float(time[b - 1])) for a, b in runs(column)) for column in slow.T)
    return replace(part, standing=spans, notes=(*part.notes, note))


def standstill_candidates(target: IdentificationTarget, parts: Sequence[PreparedLog]) -> tuple[float, ...]:
    """Speeds for `without_standstill` to choose from, `SPEEDS` times the typical speed of the drives that move."""
    if target.model.torque_equations() is None:
        return (0.0,)
    typical = typical_speed(target, parts)
    return tuple(share * typical for share in SPEEDS) if typical > 0 else (0.0,)


def typical_speed(target: IdentificationTarget, parts: Sequence[PreparedLog]) -> float:
    """Median over the drives that move of the root mean square of their speed; 0 where none does [rad/s or m/s]."""
    speeds = np.concatenate([part.samples.dq for part in parts]) @ drive_rows(target.robot).T
    sizes = np.sqrt(np.mean(speeds**2, axis=0))
    return float(np.median(sizes[sizes > 0])) if np.any(sizes > 0) else 0.0


def least_speeds(part: PreparedLog, target: IdentificationTarget) -> Array:
    """Least speed of the drives whose torque each equation contains, shape (N, r); infinite where there is none."""
    equations = target.model.torque_equations()
    assert equations is not None
    rows = drive_rows(target.robot)
    speed = np.abs(part.samples.dq @ rows.T)
    acts = np.abs(rows @ equations.directions) > _NOTHING
    return np.column_stack([np.min(speed, axis=1, where=drives, initial=np.inf) for drives in acts.T])
