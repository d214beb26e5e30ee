"""Equations of a log at some instants, fitted again for every fault that is tried.

With ``X_j = [W_j, Y]``, the rows of equation j beside all torque columns, a fault of the torques changes only which
combination of columns of Y is the right-hand side, so that a fit needs ``X_j' X_j`` alone; a fault of the positions
changes W. Friction, rotors and other parameters of one sign keep it, and the described robot is believed a little, so
that a fault that the parameters of one joint could take up shows all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import scipy

from excite.identification.impossible_parameters import described_coefficients, inertial_columns, signs_of_bodies
from excite.identification.log_faults import LEAST_ERROR, Fault, Flags, Moment
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.event import within
from excite.logs.signals.method import interpolated
from regressors.robot.columns import COULOMB, OFFSET, ROTOR
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_with_friction, friction_rows, moving_drive_numbers
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

INSTANTS = 600  # more name no other fault
_BELIEF = 0.01  # weight of the described torques beside the measured ones: off by 100 % counts as an error of 10 %
_ROUNDS = 4  # of weights by the residuals
_RIDGE, _NOTHING = 1e-9, 1e-9  # of the scaled normal equations; of the largest
_OF_LOG = 0.1  # of the shortest log: longer delays are not searched


@dataclass(frozen=True, eq=False)
class Instants:
    """Some instants of the logs, evenly spread over the rows that make equations."""

    target: IdentificationTarget
    samples: Samples  # (N,)
    step: float  # [s]
    longest: float  # delay that is searched [s]
    moments: tuple[Moment, ...]  # (N,)
    # those measured some steps later than the instants, (n,) or (N, n) -> (N, n): whole steps, since noise between two
    # measured values is less than in each
    torques: Callable[[Index], Array]
    noise: Array  # (n,) white noise of the torques, over them
    described: Array | None  # (b,) base parameters of the description
    signs: Array  # (b,) of the base parameters of real bodies and drives
    friction: FrictionCurves | None  # what is known of it

    @classmethod
    def of(
        cls,
        target: IdentificationTarget,
        parts: tuple[PreparedLog, ...],
        friction: FrictionCurves | None,
        least_speed: float = 0.0,
    ) -> Self:
        """Instants with all drives moving."""
        chosen = [_chosen(part, target.robot, INSTANTS // len(parts), least_speed) for part in parts]
        samples = [part.samples.rows(rows) for part, rows in zip(parts, chosen, strict=True)]
        joined = Samples.joined(samples)
        uniform = [interpolated(part.samples.time, part.log.time, np.asarray(part.log.effort)) for part in parts]

        ends = np.cumsum([rows.size for rows in chosen])[:-1]

        def torques(late: Index) -> Array:
            each = np.split(np.broadcast_to(late, joined.q.shape), ends)
            return np.concatenate([_later(*one) for one in zip(uniform, chosen, each, strict=True)])

        moments = tuple(moment for pair in zip(parts, samples, strict=True) for moment in _moments(*pair))
        described = described_coefficients(target)
        step = float(np.median(np.diff(parts[0].samples.time)))
        signs = signs_of_bodies(target.base)
        longest = _OF_LOG * min(float(np.ptp(part.samples.time)) for part in parts)
        return cls(target, joined, step, longest, moments, torques, _noise(uniform), described, signs, friction)

    @cached_property
    def plain(self) -> Equations:
        """The equations as the log has them."""
        return Equations.of(self, self.samples, self.columns, self.measured)

    @cached_property
    def added(self) -> tuple[Array, Array]:
        """What drives have and the model may lack at the instants, with the signs."""
        return _added_columns(self.target, self.friction, self.samples)

    @cached_property
    def measured(self) -> Array:
        """The torques at the instants, shape (N, n)."""
        return self.torques(np.zeros(self.samples.q.shape[1], dtype=int))

    @cached_property
    def columns(self) -> Array:
        """Rows of W at the instants as the log has them, shape (N, n, b)."""
        return self.columns_of(self.samples)

    def columns_of(self, samples: Samples) -> Array:
        """Rows of W at some instants, shape (N, n, b)."""
        base, n = self.target.base, samples.q.shape[1]
        return self.target.model.selected(samples, base.index).reshape(-1, n, base.rank)

    def fit(self, fault: Fault) -> Fault:
        """Fit with a fault undone."""
        if fault.positions is None:
            return (self.plain if fault.late is None else self.plain.of_torques(self.torques(fault.late))).fit(fault)
        A, b = fault.positions
        s = self.samples
        samples = replace(s, q=s.q @ A.T + b, dq=s.dq @ A.T, ddq=s.ddq @ A.T)
        return Equations.of(self, samples, self.columns_of(samples), self.measured).fit(fault)


def _chosen(part: PreparedLog, robot: Robot, most: int, least_speed: float) -> Index:
    """Rows of some instants that make equations, while all drives move where there are such."""
    rows = ~within(part.samples.time, part.left_out)
    rows = rows if rows.any() else ~rows
    speed = np.abs(part.samples.dq @ friction_rows(robot).T)
    moving = rows & np.all(speed >= least_speed * np.sqrt(np.mean(speed**2, axis=0)), axis=1)
    kept = np.flatnonzero(moving if np.count_nonzero(moving) > most // 4 else rows)
    return np.asarray(kept[np.unique(np.linspace(0, kept.size - 1, most).astype(int))])


def _moments(part: PreparedLog, samples: Samples) -> Iterator[Moment]:
    """When each instant of a log was."""
    log, first, last = part.log, part.samples.time[0], part.samples.time[-1]
    for time in samples.time.tolist():
        row = int(log.row_numbers[min(int(np.searchsorted(log.time, time)), log.count - 1)])
        yield Moment(log.source, time, row, (time - first) / max(last - first, 1e-9))


def _noise(logs: list[Array]) -> Array:
    """White noise of the torques by their third differences, jumps of friction apart, over their size, shape (n,)."""
    third = np.concatenate([np.diff(y, 3, axis=0) for y in logs])
    size = np.sqrt(np.mean(np.concatenate(logs) ** 2, axis=0))
    return np.asarray(1.4826 * np.median(np.abs(third), axis=0) / np.sqrt(20) / np.where(size > 0, size, 1.0))


def _later(y: Array, rows: Index, late: Index) -> Array:
    """Each column some rows later, shape (k, n)."""
    places = np.clip(rows[:, None] + late, 0, len(y) - 1)
    return np.asarray(np.take_along_axis(y, places, axis=0))


@dataclass(frozen=True, eq=False)
class Equations:
    """Products of the columns X of each equation, ``[W, described torque]``, and of the torques Y of all joints."""

    X: Array  # (N, n, k) with k = b + 1
    products: Array  # (n, k, k)
    right: Array  # (n, k, n)
    squares: Array  # (n, n)
    signs: Array  # (b,)
    believed: Array  # (b,) 1 for the parameters that the description states

    @staticmethod
    def of(search: Instants, samples: Samples, W: Array, measured: Array, further: Array | None = None) -> Equations:
        """The equations along a motion, with further columns of any sign, shape (N, n, k)."""
        inertial = inertial_columns(search.target.base)
        of_log = samples is search.samples
        added, added_signs = search.added if of_log else _added_columns(search.target, search.friction, samples)
        if further is not None:
            added = np.concatenate([added, further], axis=2)
            added_signs = np.concatenate([added_signs, np.zeros(further.shape[2])])
        known = np.zeros(inertial.size) if search.described is None else search.described * inertial
        believed = inertial.astype(float) * (search.described is not None)
        X = np.concatenate([W, added, (W @ known)[:, :, None]], axis=2)
        products, signs = np.array([x.T @ x for x in X.transpose(1, 0, 2)]), np.concatenate([search.signs, added_signs])
        believed = np.concatenate([believed, np.zeros(added.shape[2])])
        return Equations(X, products, *_with_torques(X, measured), signs, believed)

    def of_torques(self, measured: Array) -> Equations:
        """The same equations of other torques, shape (N, n)."""
        right, squares = _with_torques(self.X, measured)
        return replace(self, right=right, squares=squares)

    def fit(self, fault: Fault) -> Fault:
        """Fit by least squares that weights each equation by its own residual."""
        n, b = len(self.products), self.signs.size
        T = np.eye(n) if fault.torques is None else fault.torques
        WW, Wd, dd = self.products[:, :b, :b], self.products[:, :b, -1], self.products[:, -1, -1]
        right, size = np.einsum("jbn,jn->jb", self.right[:, :b], T), np.sum((T @ self.squares) * T, axis=1)
        size = np.where(size > 0, size, 1.0)
        belief = np.sqrt(_BELIEF) * self.believed
        normal = WW + belief[:, None] * WW * belief
        right_all = right + np.sqrt(_BELIEF) * belief * Wd
        square, bound = size, np.zeros(b, dtype=bool)
        for _ in range(_ROUNDS):
            weight = 1 / np.maximum(square, LEAST_ERROR**2 * size)
            x = _of_one_sign(np.tensordot(weight, normal, 1), weight @ right_all, self.signs, bound)
            square = (normal @ x - 2 * right_all) @ x + size
            square = np.maximum(square + _BELIEF * dd * np.any(self.believed), 0.0)
        return replace(fault, errors=np.sqrt(square / size), parameters=x)


def _with_torques(X: Array, Y: Array) -> tuple[Array, Array]:
    """``X_j' Y`` and ``Y' Y``."""
    return np.array([x.T @ Y for x in X.transpose(1, 0, 2)]), Y.T @ Y


_EXCHANGES, _AT_ONCE = 60, 6


def _of_one_sign(A: Array, right: Array, signs: Array, bound: Flags) -> Array:
    """Solution of normal equations in which parameters keep their sign, by exchanging those at their bound of zero.

    All that violate the conditions of optimality at once, later the last one alone [Portugal, Judice and Vicente 1994].
    ``bound`` holds those at zero, and is changed.
    """
    scale = np.sqrt(np.diag(A))
    present = scale > _NOTHING * scale.max(initial=0.0)
    scale = np.where(present, scale, 1.0)
    M, y, x = A / np.outer(scale, scale) + _RIDGE * np.eye(scale.size), right / scale, np.zeros(right.size)
    for k in range(_EXCHANGES):
        free = np.flatnonzero(present & ~bound)
        x[:] = 0.0
        x[free] = scipy.linalg.lapack.dposv(M[np.ix_(free, free)], y[free], overwrite_a=True)[1]
        wrong = np.where(bound, present & (signs * (y - M @ x) > _NOTHING * np.abs(y)), signs * x < 0)
        if not wrong.any():
            break
        bound ^= wrong if k < _AT_ONCE else np.arange(x.size) == np.flatnonzero(wrong)[-1]
    return np.asarray(x / scale)


def _added_columns(
    target: IdentificationTarget, friction: FrictionCurves | None, samples: Samples
) -> tuple[Array, Array]:
    """What drives have and a model may lack, in the equation of each joint, shape (N, n, k), with the signs."""
    n = samples.q.shape[1]
    kinds = {target.base.columns[j].kind for j in target.base.index}
    of_friction, lacking = friction_columns(target, friction, samples)
    columns, signs = [of_friction[:, :, lacking]], [1.0] * np.count_nonzero(lacking)
    for kind, values, sign in ((ROTOR, samples.ddq, 1.0), (OFFSET, np.ones_like(samples.q), 0.0)):
        if kind not in kinds:
            columns.append(values[:, :, None] * np.eye(n))
            signs += [sign] * n
    return np.concatenate(columns, axis=2), np.array(signs)


def friction_columns(
    target: IdentificationTarget, friction: FrictionCurves | None, samples: Samples
) -> tuple[Array, Flags]:
    """Friction of all drives in the equation of each joint, shape (N, n, k), and which of it the model lacks, (k,)."""
    modelled = {(target.base.columns[j].kind, target.base.columns[j].owner) for j in target.base.index}
    numbers = moving_drive_numbers(target.robot)
    columns, lacking = [np.zeros((*samples.q.shape, 0))], []
    for name, row in drives_with_friction(target.robot):
        speed = samples.dq @ row
        known = None if friction is None else friction.curve(name)
        torques = [np.sign(speed), speed] if known is None else [known.torque(speed)]
        columns += [(torque[:, None] * row)[:, :, None] for torque in torques]
        lacking += [(COULOMB, numbers[name]) not in modelled] * len(torques)
    return np.concatenate(columns, axis=2), np.array(lacking, dtype=bool)
