"""The fault of a log that explains why the model does not explain the measurements, if one explains it best by far.

Every fault of `excite.identification.log_faults` is undone and the model fitted again, by weighted least squares at
some instants of the log. With ``X_j = [W_j, Y]``, the rows of equation j beside all torque columns, a fault of the
torques changes only which combination of columns of Y is the right-hand side, so that the fit needs ``X_j' X_j``
alone; a fault of the positions changes W, and so does gravity, in which W is affine. Friction, rotors and other
parameters of one sign keep it, and the described robot is believed a little, so that a fault that the parameters of
one joint could take up shows all the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import product

import numpy as np
import scipy.optimize

from excite.identification.choices.timing import LONGEST
from excite.identification.impossible_parameters import described_coefficients, inertial_columns, signs_of_bodies
from excite.identification.large_residual import Doubt
from excite.identification.log_faults import (
    LEAST_ERROR,
    NO_FAULT,
    UNTOLD_LOAD,
    Fault,
    Flags,
    column_faults,
    delay_fault,
    every_joint_moves,
    gain_fault,
    gains_fault,
    gravity_fault,
    obvious_faults,
    zero_fault,
)
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.event import within
from regressors.errors import percent
from regressors.models.base import base_parameters, few_states, random_states
from regressors.models.load import PayloadModel
from regressors.robot.columns import COULOMB, OFFSET, ROTOR
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_with_friction, friction_rows, moving_drive_numbers
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

INSTANTS = 600  # more name no other fault
_BELIEF = 0.01  # weight of the described torques beside the measured ones: off by 100 % counts as an error of 10 %
_ROUNDS = 4  # of weights by the residuals
_RIDGE, _NOTHING = 1e-9, 1e-9  # of the scaled normal equations; of the largest
GAIN = 0.4  # in the logarithm of the errors of all joints together that a fault must win on none, and for each joint
_GAIN_EACH = 0.15  # that it concerns: what a model lacks of friction gains up to a third of it by a delay
MARGIN = 0.25  # and on the next fault
_ONE_JOINT = 1.2  # factor by which the error of one joint at least must fall
_EXPLAINED = 0.5  # a larger error of the joints explains nothing, as where noise hides the accelerations
SPOILT = "the log is spoilt:"
_NOISY, _SMALL = 1.5, 0.01  # an error of one joint of more than so many times the noise, and of the torque, is searched
_DELAYS = np.array([-0.03, -0.01, 0.01, 0.03, 0.06, 0.1])  # [s]
_IN_MOTION = 0.1  # of the root mean square speed of each drive
_OF_LOG = 0.1  # of the shortest log: longer delays are not searched
_LOG_GAIN, _OFF, _SHOWN = (-14.0, 14.0), 1.5, 0.1  # a factor shows where so many times it explains so much less
_OBLIQUE, _ASIDE = np.array([3.0, 4.0, -5.0]), 0.3  # gravity along no axis; first steps of its direction
_ZEROS = np.deg2rad([-8.0, 8.0, -90.0, 90.0, 180.0])
_GAINS = np.log([1e-3, 1e-2, 0.05, 0.1, 0.2, 0.35, 0.6, 0.8, 1.25, 1.6, 2.8, 5.0, 10.0, 20.0, 100.0, 1e3])


def spoilt_log(
    target: IdentificationTarget,
    parts: tuple[PreparedLog, ...],
    friction: FrictionCurves | None,
    *,
    doubtful: bool,
    timed: bool,
) -> Doubt | None:
    """Doubt that names the fault of a log, if one explains clearly more than none and than any other.

    A delay of all torques that left-out torques have decided on (``timed``) is not judged again.
    """
    if not every_joint_moves(target):
        return None
    for fault in obvious_faults(target.robot.joint_names, parts):
        return Doubt(f"{SPOILT} {fault.what}", "no robot measures such torques", fault.cure, about="torques")
    search = FaultSearch.of(target, parts, friction)
    none = search.plain.fit(NO_FAULT)
    if not doubtful and not np.any(none.errors > np.maximum(_NOISY * search.noise, _SMALL)):
        return None
    fits = [search.with_load(), *search.fits(), *FaultSearch.of(target, parts, friction, _IN_MOTION).late_joints(none)]
    return named(none, [fit for fit in fits if not timed or fit.kind != "late" or fit.longest > LONGEST])


def named(none: Fault, fits: list[Fault]) -> Doubt | None:
    """Doubt of the best fault, or of the best two if they concern the same joint and explain the same."""
    ranked = sorted(fits, key=lambda fit: fit.size)
    best = ranked[0]
    close = [fit for fit in ranked[1:] if fit.size - best.size <= MARGIN]
    alike = [best, *(fit for fit in close if fit.joints == best.joints)]
    ratios = [fit for fit in close if fit.kind == best.kind == "torque gain"]  # only a ratio shows, in every joint
    alike += [fit for fit in ratios if np.all(fit.errors < _ONE_JOINT * np.maximum(best.errors, LEAST_ERROR))]
    falls = float(np.max(none.errors / np.maximum(best.errors, LEAST_ERROR)))
    needed = max(GAIN, _GAIN_EACH * len(best.joints))
    clear = none.size - best.size > needed and falls > _ONE_JOINT and best.error < _EXPLAINED
    if not (clear and len(close) < len(alike) <= 2) or best.kind == UNTOLD_LOAD.kind:  # which is no fault of the log
        return None
    return Doubt(
        f"{SPOILT} {', or '.join(fault.what for fault in alike)}",
        f"without this fault the error of the joints is {percent(best.error)} instead of {percent(none.error)}",
        ", or ".join(fault.cure for fault in alike),
        about="torques",
    )


@dataclass(frozen=True, eq=False)
class FaultSearch:
    """Faults tried on some instants of the logs."""

    target: IdentificationTarget
    samples: Samples  # (N,)
    step: float  # [s]
    longest: float  # delay that is searched [s]
    # those measured some steps later than the instants, (n,) -> (N, n): whole steps, since noise between two measured
    # values is less than in each
    torques: Callable[[Index], Array]
    noise: Array  # (n,) white noise of the torques, over them
    described: Array | None  # (b,) base parameters of the description
    signs: Array  # (b,) of the base parameters of real bodies and drives
    friction: FrictionCurves | None  # what is known of it

    @staticmethod
    def of(
        target: IdentificationTarget,
        parts: tuple[PreparedLog, ...],
        friction: FrictionCurves | None,
        least_speed: float = 0.0,
    ) -> FaultSearch:
        """The search at instants evenly spread over the rows that make equations, with all drives moving."""
        chosen = [_chosen(part, target.robot, INSTANTS // len(parts), least_speed) for part in parts]
        samples = [part.samples.rows(rows) for part, rows in zip(parts, chosen, strict=True)]
        joined = Samples.joined(samples)
        uniform = [_on_grid(part) for part in parts]

        def torques(late: Index) -> Array:
            pairs = zip(uniform, chosen, strict=True)
            return np.concatenate([_later(y, rows, late) for y, rows in pairs])

        described = described_coefficients(target)
        step = float(np.median(np.diff(parts[0].samples.time)))
        signs = signs_of_bodies(target.base)
        longest = _OF_LOG * min(float(np.ptp(part.samples.time)) for part in parts)
        return FaultSearch(target, joined, step, longest, torques, _noise(uniform), described, signs, friction)

    @cached_property
    def plain(self) -> Equations:
        """The equations as the log has them."""
        return Equations.of(
            self, self.samples, self.columns, self.torques(np.zeros(self.samples.q.shape[1], dtype=int))
        )

    @cached_property
    def columns(self) -> Array:
        """Rows of W at the instants as the log has them, shape (N, n, b)."""
        return self.columns_of(self.samples)

    def columns_of(self, samples: Samples) -> Array:
        """Rows of W at some instants, shape (N, n, b)."""
        base, n = self.target.base, samples.q.shape[1]
        return self.target.model.selected(samples, base.index).reshape(-1, n, base.rank)

    def fits(self) -> list[Fault]:
        """Fits with each fault undone."""
        names, n = self.target.robot.joint_names, self.samples.q.shape[1]
        fits = [*map(self._fit, column_faults(names)), self._with_gains(), *self._tilted()]
        fits.append(self._delayed(np.ones(n, dtype=int)))
        fits += [self._at_best(partial(zero_fault, names, j), _ZEROS, 0.14, maxiter=7) for j in range(n)]
        fits += [self._at_best(partial(gain_fault, names, j), _GAINS, 0.6, xatol=0.01) for j in range(n)]
        return [fit for fit in fits if fit.kind != NO_FAULT.kind]

    def late_joints(self, none: Fault) -> list[Fault]:
        """The torques of one joint late, in motion (friction that reverses late looks like them), beside ``none``."""
        own = np.maximum(self.plain.fit(NO_FAULT).errors, LEAST_ERROR)
        fits = (self._delayed(which) for which in np.eye(len(own), dtype=int))
        return [replace(fit, errors=np.maximum(fit.errors, LEAST_ERROR) / own * none.errors) for fit in fits]

    def with_load(self) -> Fault:
        """Fit where the robot may carry a load that is not described."""
        n = self.samples.q.shape[1]
        K = PayloadModel(self.target.robot).instants(self.samples).reshape(-1, n, 10)
        measured = self.torques(np.zeros(n, dtype=int))
        return Equations.of(self, self.samples, self.columns, measured, K).fit(UNTOLD_LOAD)

    def _fit(self, fault: Fault) -> Fault:
        """Fit with a fault undone."""
        if fault.positions is None and fault.late is None:
            return self.plain.fit(fault)
        late = np.zeros(len(self.target.robot.joint_names), dtype=int) if fault.late is None else fault.late
        if fault.positions is None:
            return Equations.of(self, self.samples, self.columns, self.torques(late)).fit(fault)
        A, b = fault.positions
        s = self.samples
        samples = replace(s, q=s.q @ A.T + b, dq=s.dq @ A.T, ddq=s.ddq @ A.T)
        return Equations.of(self, samples, self.columns_of(samples), self.torques(late)).fit(fault)

    def _at_best(self, fault: Callable[[float], Fault], grid: Array, reach: float, **options: float) -> Fault:
        """Fit with the fault of the best value undone: the best on a grid, refined within reach of it."""

        def size(value: float) -> float:
            return self._fit(fault(value)).size

        best = grid[int(np.argmin([size(value) for value in grid.tolist()]))]
        bounds = (best - reach, best + reach)
        refined = scipy.optimize.minimize_scalar(size, bounds=bounds, method="bounded", options=options)
        return self._fit(fault(float(refined.x)))

    def _with_gains(self) -> Fault:
        """The best gains of all joints, from those with which the described torques are the measured ones."""
        n, known = self.samples.q.shape[1], self.described is not None

        def size(log_gains: Array) -> float:
            return self.plain.fit(replace(NO_FAULT, torques=np.diag(np.exp(log_gains)))).size

        dd, dy = self.plain.products[:, -1, -1], np.diagonal(self.plain.products[:, -1, -1 - n : -1])
        start = np.log(dd / np.abs(dy)) if np.all(dd * dy != 0) else np.zeros(n)
        for unit in np.eye(n):  # where friction hides the described torque, the start may be far off
            start = min((start + step * unit for step in (0.0, *_GAINS)), key=size)
        best = scipy.optimize.minimize(size, start, method="L-BFGS-B", bounds=[_LOG_GAIN] * n, options={"eps": 1e-4})
        gains = np.exp(best.x if known else best.x - np.median(best.x))
        off = (min(size(best.x + step), size(best.x - step)) for step in np.log(_OFF) * np.eye(n))
        shown = np.array([least - best.fun > _SHOWN for least in off])
        return self.plain.fit(gains_fault(self.target.robot.joint_names, gains, shown, known=known))

    def _tilted(self) -> list[Fault]:
        """The best directions of gravity, in which rows are affine; where it is oblique, all base parameters show."""
        down, robot = self.target.robot.gravity, self.target.robot
        length = float(np.linalg.norm(down))
        if length == 0:
            return []
        oblique, *models = (self.target.model.on(robot.replace(gravity=g)) for g in (_OBLIQUE, np.zeros(3), *np.eye(3)))
        base = base_parameters(oblique, states=random_states(robot, few_states(oblique)))
        still, *along = (replace(self.target, model=model, base=base) for model in models)
        search = replace(self, target=still, described=described_coefficients(still), signs=signs_of_bodies(base))
        W0 = search.columns
        changes = np.array([replace(search, target=target).columns_of(self.samples) - W0 for target in along])
        measured = self.torques(np.zeros(robot.n, dtype=int))

        def fit(direction: Array) -> Fault:
            g = length / float(np.linalg.norm(direction)) * direction
            rows = Equations.of(search, self.samples, W0 + np.tensordot(g, changes, 1), measured)
            return rows.fit(gravity_fault(down, g))

        grid = [np.array(g) / np.linalg.norm(g) for g in product((-1.0, 0.0, 1.0), repeat=3) if any(g)]
        found: list[Array] = []
        for half in (down, -down):
            start = min((g for g in grid if g @ half > 0), key=lambda g: fit(g).size)
            options = {"initial_simplex": start + _ASIDE * np.eye(4, 3), "xatol": 2e-3, "fatol": 1e-3}
            found.append(scipy.optimize.minimize(lambda g: fit(g).size, start, method="Nelder-Mead", options=options).x)
        best, other = sorted(found, key=lambda g: fit(g).size)
        return [fit(best), *([fit(other)] if gravity_fault(best, other).kind != NO_FAULT.kind else [])]

    def _delayed(self, which: Index) -> Fault:
        """The torques of some joints late by the best delay."""
        names = self.target.robot.joint_names
        grid = np.unique(np.round(np.clip(_DELAYS, -self.longest, self.longest) / self.step).astype(int))

        @cache
        def size(steps: int) -> float:
            if not steps or abs(steps) * self.step > self.longest:
                return np.inf
            return self._fit(delay_fault(names, steps * which, self.step)).size

        best, stride = min(grid.tolist(), key=size), max(1, round(0.01 / self.step))
        while stride:
            best = min((best - stride, best, best + stride), key=size)
            stride //= 2
        return self._fit(delay_fault(names, best * which, self.step))


def _chosen(part: PreparedLog, robot: Robot, most: int, least_speed: float) -> Index:
    """Rows of some instants that make equations, while all drives move where there are such."""
    rows = ~within(part.samples.time, part.left_out)
    rows = rows if rows.any() else ~rows
    speed = np.abs(part.samples.dq @ friction_rows(robot).T)
    moving = rows & np.all(speed >= least_speed * np.sqrt(np.mean(speed**2, axis=0)), axis=1)
    kept = np.flatnonzero(moving if np.count_nonzero(moving) > most // 4 else rows)
    return np.asarray(kept[np.unique(np.linspace(0, kept.size - 1, most).astype(int))])


def _on_grid(part: PreparedLog) -> Array:
    """Torques as recorded, at the instants of the motion, shape (N, n)."""
    assert part.log.effort is not None
    return np.column_stack([np.interp(part.samples.time, part.log.time, y) for y in part.log.effort.T])


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
    """Products of the columns of each equation, ``[W, Y, described torque]``."""

    products: Array  # (n, k, k) with k = b + n + 1
    signs: Array  # (b,)
    believed: Array  # (b,) 1 for the parameters that the description states

    @staticmethod
    def of(search: FaultSearch, samples: Samples, W: Array, measured: Array, further: Array | None = None) -> Equations:
        """The equations along a motion, with further columns of any sign, shape (N, n, k)."""
        base, n = search.target.base, measured.shape[1]
        inertial = inertial_columns(base)
        added, added_signs = _added_columns(search.target, search.friction, samples)
        if further is not None:
            added = np.concatenate([added, further], axis=2)
            added_signs = np.concatenate([added_signs, np.zeros(further.shape[2])])
        described = (
            np.zeros(W.shape[:2]) if search.described is None else W[:, :, inertial] @ search.described[inertial]
        )
        believed = inertial.astype(float) * (search.described is not None)
        Y = np.broadcast_to(measured[:, None, :], (len(measured), n, n))
        X = np.concatenate([W, added, Y, described[:, :, None]], axis=2)
        products = np.array([X[:, j].T @ X[:, j] for j in range(n)])
        return Equations(
            products,
            np.concatenate([search.signs, added_signs]),
            np.concatenate([believed, np.zeros(added.shape[2])]),
        )

    def fit(self, fault: Fault) -> Fault:
        """Fit by least squares that weights each equation by its own residual."""
        n = len(self.products)
        b = self.signs.size
        T = np.eye(n) if fault.torques is None else fault.torques
        WW, WY, YY = self.products[:, :b, :b], self.products[:, :b, b : b + n], self.products[:, b : b + n, b : b + n]
        Wd, dd = self.products[:, :b, -1], self.products[:, -1, -1]
        right, size = np.einsum("jbn,jn->jb", WY, T), np.einsum("jn,jnm,jm->j", T, YY, T)
        size = np.where(size > 0, size, 1.0)
        belief = _BELIEF * self.believed
        normal = WW + np.sqrt(belief)[:, None] * WW * np.sqrt(belief)
        right_all = right + belief * Wd
        square, bound = size, np.zeros(b, dtype=bool)
        for _ in range(_ROUNDS):
            weight = 1 / np.maximum(square, LEAST_ERROR**2 * size)
            x = _of_one_sign(np.tensordot(weight, normal, 1), weight @ right_all, self.signs, bound)
            square = np.einsum("b,jbc,c->j", x, normal, x) - 2 * right_all @ x + size
            square = np.maximum(square + _BELIEF * dd * np.any(self.believed), 0.0)
        return replace(fault, errors=np.sqrt(square / size))


_EXCHANGES, _AT_ONCE = 60, 6


def _of_one_sign(A: Array, right: Array, signs: Array, bound: Flags) -> Array:
    """Solution of normal equations in which parameters keep their sign, by exchanging those at their bound of zero.

    All that violate the conditions of optimality at once, later the last one alone [Portugal, Judice and Vicente 1994].
    ``bound`` holds those at zero, and is changed.
    """
    scale = np.sqrt(np.diag(A))
    present = scale > _NOTHING * scale.max(initial=0.0)
    x = np.zeros(right.size)
    for k in range(_EXCHANGES):
        free = np.flatnonzero(present & ~bound)
        M = A[np.ix_(free, free)] / np.outer(scale[free], scale[free])
        x[:] = 0.0
        x[free] = np.linalg.solve(M + _RIDGE * np.eye(free.size), right[free] / scale[free]) / scale[free]
        wrong = np.where(bound, present & (signs * (right - A @ x) > _NOTHING * np.abs(right)), signs * x < 0)
        if not wrong.any():
            break
        bound ^= wrong if k < _AT_ONCE else np.arange(x.size) == np.flatnonzero(wrong)[-1]
    return x


def _added_columns(
    target: IdentificationTarget, friction: FrictionCurves | None, samples: Samples
) -> tuple[Array, Array]:
    """What drives have and a model may lack, in the equation of each joint, shape (N, n, k), with the signs."""
    n = samples.q.shape[1]
    modelled = {(target.base.columns[j].kind, target.base.columns[j].owner) for j in target.base.index}
    kinds = {kind for kind, _ in modelled}
    numbers = moving_drive_numbers(target.robot)
    columns = [np.zeros((len(samples.q), n, 0))]
    signs: list[float] = []
    for name, row in drives_with_friction(target.robot):
        speed = samples.dq @ row
        known = None if friction is None else friction.curve(name)
        torques = [np.sign(speed), speed] if known is None else [known.torque(speed)]
        if (COULOMB, numbers[name]) not in modelled:
            columns += [(torque[:, None] * row)[:, :, None] for torque in torques]
            signs += [1.0] * len(torques)
    for kind, values, sign in ((ROTOR, samples.ddq, 1.0), (OFFSET, np.ones_like(samples.q), 0.0)):
        if kind not in kinds:
            columns.append(values[:, :, None] * np.eye(n))
            signs += [sign] * n
    return np.concatenate(columns, axis=2), np.array(signs)
