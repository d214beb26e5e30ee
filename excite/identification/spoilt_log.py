"""The fault of a log that explains why the model does not explain the measurements, if one explains it best by far.

Every fault of `excite.identification.log_faults` is undone and the model fitted again, by weighted least squares at
some instants of the log. With ``X_j = [W_j, Y]``, the rows of equation j beside all torque columns, a fault of the
torques changes only which combination of columns of Y is the right-hand side, so that the fit needs ``X_j' X_j``
alone; a fault of the positions changes W, and so does gravity, in which W is affine. Friction, rotors and other
parameters of one sign keep it, and the described robot is believed a little, so that a fault that the parameters of
one joint could take up shows all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import product

import numpy as np
import scipy

from excite.identification.choices.timing import LONGEST
from excite.identification.impossible_parameters import described_coefficients, inertial_columns, signs_of_bodies
from excite.identification.large_residual import Doubt
from excite.identification.log_faults import (
    FREEDOM,
    LEAST_ERROR,
    NO_FAULT,
    OTHER_MASSES,
    UNTOLD_LOAD,
    Fault,
    Flags,
    Moment,
    column_faults,
    delay_fault,
    drift_fault,
    every_joint_moves,
    gain_fault,
    gains_fault,
    gravity_fault,
    is_load,
    late_from_fault,
    lengths_fault,
    moved_fault,
    obvious_faults,
    zero_fault,
)
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.event import within
from excite.logs.signals.method import interpolated
from regressors.errors import percent
from regressors.models.base import base_parameters, few_states, random_states
from regressors.models.load import PayloadModel
from regressors.models.nominal import standard_values
from regressors.robot.columns import COULOMB, OFFSET, ROTOR, VISCOUS
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
_NEARLY, _SHARE = 2.0, 0.5  # of a factor of a unit; of a joint's torque, what its friction makes at least
_EXPLAINED = 0.5  # a larger error of the joints explains nothing, as where noise hides the accelerations
_SAME_SIGNS = ({"torque gain", "gains"}, {"zero", "gravity"})  # kinds of which a log may not tell which it is
SPOILT = "the log is spoilt:"
_NOISY, _SMALL = 1.5, 0.01  # an error of one joint of more than so many times the noise, and of the torque, is searched
_DELAYS = np.array([-0.03, -0.01, 0.01, 0.03, 0.06, 0.1])  # [s]
_IN_MOTION = 0.1  # of the root mean square speed of each drive
_OF_LOG = 0.1  # of the shortest log: longer delays are not searched
_LOG_GAIN, _OFF, _SHOWN = (-14.0, 14.0), 1.5, 0.1  # a factor shows where so many times it explains so much less
_OBLIQUE, _TURNS = np.array([3.0, 4.0, -5.0]), 4  # gravity along no axis; steps of its direction
_TILT, _AROUND = np.deg2rad(20.0), np.arange(0.0, 2 * np.pi, np.pi / 3)  # of a base that moved, at first
_STEPS = (1.0, 0.5, 0.25, 0.0)  # shares of one that are tried
_SPLITS = 10  # instants from which on something may have changed, before the best is refined
_SHORT = 0.02  # lengths that are not fitted [m]
_LENGTH_ROUNDS, _COMMON, _STEP = 7, 2, 1e-3  # of their fit, those with one factor for all, and of the differences
_LONGER, _SHORTEST = 0.3, 0.3  # most by which a factor changes at once; least and, inverted, largest
_MASSES = (np.log(0.3), np.log(3.0))
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
        return Doubt(f"{SPOILT} {fault.what}", "no sound log has this, whatever the robot", fault.cure, about="torques")
    search = FaultSearch.of(target, parts, friction)
    none = search.plain.fit(NO_FAULT)
    for fault in search.in_other_units(none):
        cause = "its friction would be so many times that described, and no other is"
        return Doubt(f"{SPOILT} {fault.what}", cause, fault.cure, about="torques")
    if not doubtful and not np.any(none.errors > np.maximum(_NOISY * search.noise, _SMALL)):
        return None
    fits = [*search.fits(), *FaultSearch.of(target, parts, friction, _IN_MOTION).late_joints(none)]
    fits += [search.with_load()] if target.robot.is_chain else []
    fits = [fit for fit in fits if not timed or fit.kind != "late" or fit.longest > LONGEST]
    best = min([none, *_of_faults(fits)], key=lambda fit: fit.size)
    if best.kind == "gravity":  # of which, to joints that are parallel, a tilt sideways only takes a part
        fits.append(search.with_other_masses())
    return named(none, fits if np.all(best.errors < _NOISY * search.noise) else [*fits, search.with_lengths()])


def _of_faults(fits: list[Fault]) -> list[Fault]:
    return [fit for fit in fits if fit.kind != NO_FAULT.kind]


def named(none: Fault, fits: list[Fault]) -> Doubt | None:
    """Doubt of the best fault, or of the best two if they concern the same joint and explain the same."""
    ranked = sorted(_of_faults(fits), key=lambda fit: fit.size)
    if not ranked:
        return None
    best = ranked[0]
    close = [fit for fit in ranked[1:] if fit.size - best.size <= MARGIN]
    alike = [best, *(fit for fit in close if fit.joints == best.joints or {fit.kind, best.kind} in _SAME_SIGNS)]
    ratios = [fit for fit in close if fit.kind == best.kind == "torque gain"]  # only a ratio shows, in every joint
    alike += [fit for fit in ratios if np.all(fit.errors < _ONE_JOINT * np.maximum(best.errors, LEAST_ERROR))]
    falls = float(np.max(none.errors / np.maximum(best.errors, LEAST_ERROR)))
    needed = max(GAIN, _GAIN_EACH * len(best.joints))
    clear = none.size - best.size > needed and falls > _ONE_JOINT and best.error < _EXPLAINED
    few = len(alike) <= 2 or {fit.kind for fit in alike} == _SAME_SIGNS[0]
    if not (clear and len(close) < len(alike) and few) or not best.what:
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
    moments: tuple[Moment, ...]  # (N,)
    # those measured some steps later than the instants, (n,) or (N, n) -> (N, n): whole steps, since noise between two
    # measured values is less than in each
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
        return FaultSearch(target, joined, step, longest, moments, torques, _noise(uniform), described, signs, friction)

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

    def fits(self) -> list[Fault]:
        """Fits with each fault undone."""
        names, n = self.target.robot.joint_names, self.samples.q.shape[1]
        fits = [*map(self._fit, column_faults(names)), self._with_gains(), *self._tilted()]
        fits += [self._delayed(np.ones(n, dtype=int)), self._late_from(), self._drifting(), self._moved()]
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
        fit = Equations.of(self, self.samples, self.columns, self.measured, K).fit(UNTOLD_LOAD)
        return fit if is_load(fit.parameters[-10:]) else NO_FAULT

    def with_other_masses(self) -> Fault:
        """Fit where all described masses may be too large, or too small, by one factor."""

        def fit(log_factor: float) -> Fault:
            known = None if self.described is None else self.described * np.exp(log_factor)
            return Equations.of(replace(self, described=known), self.samples, self.columns, self.measured).fit(
                replace(OTHER_MASSES, freedom=FREEDOM)
            )

        found = scipy.optimize.minimize_scalar(lambda x: fit(x).size, bounds=_MASSES, method="bounded")
        return fit(float(found.x))

    def in_other_units(self, none: Fault) -> Iterator[Fault]:
        """The torques of a joint whose friction, beside the other joints', is a unit off the described one.

        Where its own friction explains most of its torque, no other joint says so.
        """
        known = standard_values(self.target.robot)
        columns = [self.target.base.columns[j] for j in self.target.base.index]
        friction = np.array([known.get(c.name, 0.0) * (c.kind in (COULOMB, VISCOUS)) for c in columns])
        if none.error > _EXPLAINED:
            return
        described, found = self.columns @ friction, self.columns @ (none.parameters[: friction.size] * (friction != 0))
        share = np.linalg.norm(found, axis=0) / np.linalg.norm(self.measured, axis=0)
        ratio = np.sum(described * found, axis=0) / np.maximum(np.sum(described**2, axis=0), _NOTHING)
        ratio = np.log(np.maximum(ratio, _NOTHING) / max(float(np.median(ratio)), _NOTHING))
        for log_gain in np.log([1e-3, 1e3]).tolist():
            odd = np.flatnonzero((np.abs(ratio + log_gain) < np.log(_NEARLY)) & (share > _SHARE))
            if odd.size == 1 < ratio.size:
                yield gain_fault(self.target.robot.joint_names, int(odd[0]), log_gain)

    def with_lengths(self) -> Fault:
        """The lengths between joints that fit best, by the Gauss-Newton method with free bodies."""
        robot, b = self.target.robot, self.target.base.rank
        search = replace(self, described=None)
        described = np.array([joint.translation for joint in robot.joints])
        places = np.nonzero((np.abs(described) > _SHORT) & (np.arange(robot.n) > 0)[:, None])

        def lengths(factors: Array) -> Array:
            scaled = described.copy()
            scaled[places] *= factors
            return scaled

        def columns(factors: Array) -> Array:
            pairs = zip(robot.joints, lengths(factors), strict=True)
            joints = tuple(replace(joint, translation=translation) for joint, translation in pairs)
            model = self.target.model.on(robot.replace(joints=joints))
            return replace(search, target=replace(self.target, model=model)).columns_of(self.samples)

        def fit(W: Array, further: Array | None = None) -> Fault:
            return Equations.of(search, self.samples, W, self.measured, further).fit(NO_FAULT)

        factors, fits = np.ones(places[0].size), []
        for k in range(_LENGTH_ROUNDS if factors.size else 0):
            W = columns(factors)
            fits.append((fit(W), factors))
            steps = np.ones((1, factors.size)) if k < _COMMON else np.eye(factors.size)
            changes = [(columns(factors + _STEP * step) - W) @ fits[-1][0].parameters[:b] / _STEP for step in steps]
            linear = fit(W, np.stack(changes, axis=2))
            if k == 0 and fits[0][0].size - linear.size < _SHOWN:
                return NO_FAULT  # robots of a family are longer or shorter as a whole, before all else
            change = np.clip(linear.parameters[-len(steps) :], -_LONGER, _LONGER)
            factors = np.clip(factors + change @ steps, _SHORTEST, 1 / _SHORTEST)
        if not fits:
            return NO_FAULT
        best, factors = min(fits, key=lambda one: one[0].size)
        others = [fit(columns(np.where(places[0] == j, 1.0, factors))).size for j in range(robot.n)]
        ratios = np.linalg.norm(lengths(factors), axis=1) / np.maximum(np.linalg.norm(described, axis=1), _SHORT)
        fault = lengths_fault(robot, ratios, np.array(others) - best.size > _SHOWN)
        return replace(fault, errors=best.errors) if fits[0][0].size - best.size > GAIN + fault.freedom else NO_FAULT

    def _fit(self, fault: Fault) -> Fault:
        """Fit with a fault undone."""
        if fault.positions is None:
            return (self.plain if fault.late is None else self.plain.of_torques(self.torques(fault.late))).fit(fault)
        A, b = fault.positions
        s = self.samples
        samples = replace(s, q=s.q @ A.T + b, dq=s.dq @ A.T, ddq=s.ddq @ A.T)
        return Equations.of(self, samples, self.columns_of(samples), self.measured).fit(fault)

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

        dd, dy = self.plain.products[:, -1, -1], np.diagonal(self.plain.right[:, -1])
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
        down = self.target.robot.gravity
        length = float(np.linalg.norm(down))
        if length == 0:
            return []
        fit = partial(self._in_gravity, 0)
        grid = [length * np.array(g) / np.linalg.norm(g) for g in product((-1.0, 0.0, 1.0), repeat=3) if any(g)]
        found = []
        for way in (1.0, 0.0, -1.0):  # as on the floor, on a wall, under a ceiling
            tilted = min((g for g in grid if np.sign(np.round(g @ down, 6)) == way), key=lambda g: fit(g).size)
            for _ in range(_TURNS):
                tilted = self._turned(0, tilted)
            found.append(tilted)
        best, other, _ = sorted(found, key=lambda g: fit(g).size)
        return [fit(best), *([fit(other)] if gravity_fault(best, other).kind != NO_FAULT.kind else [])]

    @cached_property
    def _of_gravity(self) -> tuple[FaultSearch, Array, Array]:
        """The search with the base of an oblique gravity, its rows, and what each component of gravity adds to them."""
        robot = self.target.robot
        oblique, *models = (self.target.model.on(robot.replace(gravity=g)) for g in (_OBLIQUE, np.zeros(3), *np.eye(3)))
        base = base_parameters(oblique, states=random_states(robot, few_states(oblique)))
        still, *along = (replace(self.target, model=model, base=base) for model in models)
        search = replace(self, target=still, described=described_coefficients(still), signs=signs_of_bodies(base))
        W0 = search.columns
        changes = np.array([replace(search, target=one).columns_of(self.samples) - W0 for one in along])
        return search, W0 + np.tensordot(robot.gravity, changes, 1), changes

    def _in_gravity(self, split: int, gravity: Array, before: Fault | None = None) -> Fault:
        """Fit with that gravity from an instant on, or with three more columns for its change."""
        down, moment = self.target.robot.gravity, self.moments[split]
        search, level, changes = self._of_gravity
        after = (np.arange(len(level)) >= split)[:, None, None]
        W = level + after * np.tensordot(gravity - down, changes, 1)
        K = None if before is None else after * np.moveaxis(changes @ before.parameters[: W.shape[2]], 0, 2)
        fault = moved_fault(down, gravity, moment) if split else gravity_fault(down, gravity)
        return Equations.of(search, self.samples, W, self.measured, K).fit(fault)

    def _turned(self, split: int, gravity: Array) -> Array:
        """A better gravity from an instant on, linear in its change, by the Gauss-Newton method."""
        step = self._in_gravity(split, gravity, self._in_gravity(split, gravity)).parameters[-3:]
        turned = [gravity + share * step for share in _STEPS]
        turned = [g * np.linalg.norm(gravity) / np.linalg.norm(g) for g in turned]
        return min(turned, key=lambda g: self._in_gravity(split, g).size)

    def _moved(self) -> Fault:
        """The best gravity after the best instant."""
        gravity, stride = self.target.robot.gravity, max(len(self.moments) // _SPLITS, 1)
        if not gravity.any() or not self._splits:
            return NO_FAULT

        def size(gravity: Array, split: int) -> float:
            return self._in_gravity(split, gravity).size if split in self._splits else np.inf

        level = self._in_gravity(0, gravity)
        split = min(self._splits[::stride], key=lambda split: self._in_gravity(split, gravity, level).size)
        across = np.linalg.norm(gravity) * scipy.linalg.null_space(gravity[None])
        tilted = (gravity * np.cos(_TILT) + np.sin(_TILT) * across @ (np.cos(a), np.sin(a)) for a in _AROUND)
        gravity = min((gravity, *tilted), key=lambda g: size(g, split))
        for _ in range(_TURNS):
            gravity = self._turned(split, gravity)
            split = _refined(split, stride // 2, partial(size, gravity))
        return self._in_gravity(split, gravity)

    def _drifting(self) -> Fault:
        """Friction of every drive that changes in proportion to the time of each log."""
        F, lacking = _friction_columns(self.target, self.friction, self.samples)
        passed = np.array([moment.passed for moment in self.moments])[:, None, None]
        fit = Equations.of(self, self.samples, self.columns, self.measured, passed * F).fit(NO_FAULT)
        of_model = np.array([self.target.base.columns[j].kind in (COULOMB, VISCOUS) for j in self.target.base.index])
        x, added = np.split(fit.parameters, [of_model.size])
        at_first = self.columns[:, :, of_model] @ x[of_model] + F[:, :, lacking] @ added[: np.count_nonzero(lacking)]
        change = F @ added[added.size - F.shape[2] :]
        size = np.sum(at_first**2, axis=0)
        falls = -np.sum(at_first * change, axis=0) / np.where(size > 0, size, 1.0)
        return replace(drift_fault(self.target.robot.joint_names, falls), errors=fit.errors)

    def _late_from(self) -> Fault:
        """All torques late from the best instant on."""
        N, n = self.samples.q.shape
        names = self.target.robot.joint_names

        def fit(split: int, late: int) -> Fault:
            rows = late * np.repeat(np.arange(N) >= split, n).reshape(N, n)
            return self._fit(late_from_fault(names, rows, self.step * late, self.moments[split]))

        def size(late: int, split: int) -> float:
            near = split in self._splits and abs(late) * self.step <= self.longest
            return fit(split, late).size if near else np.inf

        splits = self._splits[:: max(N // _SPLITS, 1)]
        starts = [(size(late, split), late, split) for split in splits for late in self._delays if late]
        _, late, split = min(starts, default=(0.0, 0, 0))
        for stride in (8, 4, 2, 1) if starts else ():
            split = _refined(split, N // _SPLITS // 2, partial(size, late))
            late = min((size(x, split), x) for x in (late - stride, late, late + stride))[1]
        return fit(split, late) if late else NO_FAULT

    @property
    def _splits(self) -> range:
        """Instants from which on something may have changed, with enough on both sides."""
        least = max(len(self.moments) // _SPLITS, 1)
        return range(least, len(self.moments) - least + 1)

    @property
    def _delays(self) -> list[int]:
        """Delays that are tried first, in steps."""
        steps = np.clip(_DELAYS, -self.longest, self.longest) / self.step
        return sorted({round(x) for x in steps.tolist()})

    def _delayed(self, which: Index) -> Fault:
        """The torques of some joints late by the best delay."""
        names = self.target.robot.joint_names

        def size(steps: int) -> float:
            if not steps or abs(steps) * self.step > self.longest:
                return np.inf
            return self._fit(delay_fault(names, steps * which, self.step)).size

        best = _refined(min(self._delays, key=size), max(1, round(0.01 / self.step)), size)
        return self._fit(delay_fault(names, best * which, self.step))


def _refined(best: int, stride: int, size: Callable[[int], float]) -> int:
    """The best whole number near one, by steps that are halved."""
    size = cache(size)
    while stride:
        best = min((best - stride, best, best + stride), key=size)
        stride //= 2
    return best


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
    def of(search: FaultSearch, samples: Samples, W: Array, measured: Array, further: Array | None = None) -> Equations:
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
        right, squares = _with_torques(X, measured)
        return Equations(
            X,
            np.array([x.T @ x for x in X.transpose(1, 0, 2)]),
            right,
            squares,
            np.concatenate([search.signs, added_signs]),
            np.concatenate([believed, np.zeros(added.shape[2])]),
        )

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
        x[free] = np.linalg.solve(M[np.ix_(free, free)], y[free])
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
    of_friction, lacking = _friction_columns(target, friction, samples)
    columns, signs = [of_friction[:, :, lacking]], [1.0] * np.count_nonzero(lacking)
    for kind, values, sign in ((ROTOR, samples.ddq, 1.0), (OFFSET, np.ones_like(samples.q), 0.0)):
        if kind not in kinds:
            columns.append(values[:, :, None] * np.eye(n))
            signs += [sign] * n
    return np.concatenate(columns, axis=2), np.array(signs)


def _friction_columns(
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
