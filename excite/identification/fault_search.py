"""Faults of `excite.identification.log_faults` tried on a log, each with the values that explain it best."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, cached_property, partial
from itertools import product

import numpy as np
import scipy

from excite.identification.fault_equations import Equations, Instants, friction_columns
from excite.identification.impossible_parameters import described_coefficients, signs_of_bodies
from excite.identification.log_faults import (
    LEAST_ERROR,
    NO_FAULT,
    OTHER_MASSES,
    UNTOLD_LOAD,
    Fault,
    column_faults,
    delay_fault,
    drift_fault,
    gain_fault,
    gain_or_masses,
    gains_fault,
    gravity_fault,
    is_load,
    late_from_fault,
    lengths_fault,
    log_gain,
    moved_fault,
    zero_fault,
)
from regressors.models.base import base_parameters, few_states, random_states
from regressors.models.load import PayloadModel
from regressors.models.nominal import standard_values
from regressors.robot.columns import COULOMB, VISCOUS
from regressors.robot.robot import Robot
from regressors.samples import Array, Index

GAIN = 0.4  # in the logarithm of the errors of all joints together that a fault must win on none
EXPLAINED = 0.5  # a larger error of the joints explains nothing, as where noise hides the accelerations
_NOTHING = 1e-9
_NEARLY, _SHARE = 2.0, 0.5  # of a factor of a unit; of a joint's torque, what its friction makes at least
_DELAYS = np.array([-0.03, -0.01, 0.01, 0.03, 0.06, 0.1])  # [s]
_LOG_GAIN, _OFF, _SHOWN = (-14.0, 14.0), 1.5, 0.1  # a factor shows where so many times it explains so much less
_OBLIQUE, _TURNS = np.array([0.5, 3.0, 4.0]), 4  # gravity along no axis, by itself and across; steps of its direction
_TILT, _AROUND = np.deg2rad(20.0), np.arange(0.0, 2 * np.pi, np.pi / 3)  # of a base that moved, at first
_STEPS = (1.0, 0.5, 0.25)  # shares of one that are tried
_SPLITS = 10  # instants from which on something may have changed, before the best is refined
_SHORT = 0.02  # lengths that are not fitted [m]
_LENGTH_ROUNDS, _COMMON, _STEP = 7, 2, 1e-3  # of their fit, those with one factor for all, and of differences
_LONGER, _SHORTEST = 0.3, 0.3  # most by which a factor changes at once; least and, inverted, largest
_MASSES = (np.log(0.3), np.log(3.0))
_ZEROS, _LARGE_ZERO = np.deg2rad([-8.0, 8.0, -90.0, 90.0, 180.0]), np.deg2rad(45.0)
_CENTRE = 0.03  # that descriptions may be off in the centre of a body [m]
_REACH, _MOVES, _EDGE = 0.6, 5, 0.9  # of the logarithm of a gain; moves by almost a whole reach, which go on
_GAINS = np.log([1e-3, 1e-2, 0.05, 0.1, 0.2, 0.35, 0.6, 0.8, 1.25, 1.6, 2.8, 5.0, 10.0, 20.0, 100.0, 1e3])


class FaultSearch(Instants):
    """Faults tried on some instants of the logs, and what may look like one."""

    def fits(self) -> list[Fault]:
        """Fits with each fault undone."""
        names, n = self.target.robot.joint_names, self.samples.q.shape[1]
        fits = [*map(self.fit, column_faults(names)), self._with_gains(), *self._tilted()]
        fits += [self._delayed(np.ones(n, dtype=int)), self._late_from(), self._drifting(), self._moved()]
        fits += [self._with_zero(j) for j in range(n)]
        return [fit for fit in [*fits, *self._gains_of_one()] if fit.kind != NO_FAULT.kind]

    @cached_property
    def free(self) -> FaultSearch:
        """The search with free bodies, which take up what a description has wrong."""
        return replace(self, described=None)

    def _with_zero(self, j: int) -> Fault:
        """The best zero of a joint: as free bodies need it, or else a large one, which the described masses need.

        One that moves the centre of the joint's own body by little is one of a wrong description.
        """
        none, fault = self.free.fit(NO_FAULT), partial(zero_fault, self.target.robot.joint_names, j)
        zero = self._at_best(fault, _ZEROS, 0.14, maxiter=7)
        shows = self.gain_of_zeros > _SHOWN  # else its own angle need not be searched for
        own = self.free._at_best(fault, np.array([zero.zero]), 0.14, maxiter=7) if shows else self.free.fit(zero)
        if none.size - own.size > _SHOWN:
            return replace(self.fit(own), shown=none.size - own.size)
        large = abs(zero.zero) > _LARGE_ZERO and _moved_centre(self.target.robot, j, zero.zero) > _CENTRE
        return zero if large else NO_FAULT

    def _gains_of_one(self) -> list[Fault]:
        """The best gain of each joint: as free bodies need it, or else a large one, which the described masses need."""
        names, found, none = self.target.robot.joint_names, [], self.free.fit(NO_FAULT)
        for j in range(len(names)):
            fault = partial(gain_fault, names, j)
            gain = self._at_best(fault, _GAINS, _REACH, xatol=0.01)
            own = self.free._at_best(fault, np.array([log_gain(gain)]), _REACH, xatol=0.01)
            found.append((gain, own, none.size - own.size))
        most = max(shown for _, _, shown in found)
        return [
            self.fit(own) if shown > max(_SHOWN, most - _SHOWN) else gain_or_masses(gain) for gain, own, shown in found
        ]

    @cached_property
    def gain_of_zeros(self) -> float:
        """What zeros of all joints explain that free bodies do not, linear in their changes."""
        free, W = self.free, self.free.columns  # zeros explain what a description has wrong, too
        none = free.plain.fit(NO_FAULT)
        x = none.parameters[: self.target.base.rank]
        moved = (replace(self.samples, q=self.samples.q + _STEP * unit) for unit in np.eye(self.samples.q.shape[1]))
        K = np.stack([(self.columns_of(samples) - W) @ x / _STEP for samples in moved], axis=2)
        return none.size - Equations.of(free, self.samples, W, self.measured, K).fit(NO_FAULT).size

    def late_joints(self, none: Fault) -> list[Fault]:
        """The torques of one joint late, in motion (friction that reverses late looks like them), beside ``none``."""
        own = np.maximum(self.plain.fit(NO_FAULT).errors, LEAST_ERROR)
        fits = (self._delayed(which) for which in np.eye(len(own), dtype=int))
        return [replace(fit, errors=np.maximum(fit.errors, LEAST_ERROR) / own * none.errors) for fit in fits]

    def with_load(self) -> Fault:
        """Fit where the robot may carry a load that is not described."""
        K = PayloadModel(self.target.robot).instants(self.samples).reshape(*self.samples.q.shape, 10)
        fit = Equations.of(self, self.samples, self.columns, self.measured, K).fit(UNTOLD_LOAD)
        return fit if is_load(fit.parameters[-10:]) else NO_FAULT

    def with_other_masses(self) -> Fault:
        """Fit where all described masses may be too large, or too small, by one factor."""

        def fit(log_factor: float) -> Fault:
            other = replace(self, described=None if self.described is None else self.described * np.exp(log_factor))
            return Equations.of(other, self.samples, self.columns, self.measured).fit(OTHER_MASSES)

        found = scipy.optimize.minimize_scalar(lambda x: fit(x).size, bounds=_MASSES, method="bounded")
        return fit(float(found.x))

    def in_other_units(self, none: Fault) -> Iterator[Fault]:
        """The torques of a joint whose friction, beside the other joints', is a unit off the described one.

        Where its own friction explains most of its torque, no other joint says so.
        """
        known = standard_values(self.target.robot)
        columns = [self.target.base.columns[j] for j in self.target.base.index]
        friction = np.array([known.get(c.name, 0.0) * (c.kind in (COULOMB, VISCOUS)) for c in columns])
        if none.error > EXPLAINED:
            return
        described, found = self.columns @ friction, self.columns @ (none.parameters[: friction.size] * (friction != 0))
        share = np.linalg.norm(found, axis=0) / np.linalg.norm(self.measured, axis=0)
        ratio = np.sum(described * found, axis=0) / np.maximum(np.sum(described**2, axis=0), _NOTHING)
        ratio = np.log(np.maximum(ratio, _NOTHING) / max(float(np.median(ratio)), _NOTHING))
        for unit in np.log([1e-3, 1e3]).tolist():
            odd = np.flatnonzero((np.abs(ratio + unit) < np.log(_NEARLY)) & (share > _SHARE))
            if odd.size == 1 < ratio.size:
                yield gain_fault(self.target.robot.joint_names, int(odd[0]), unit)

    def with_lengths(self) -> Fault:
        """The lengths between joints that fit best, by the Gauss-Newton method with free bodies."""
        robot, b, search = self.target.robot, self.target.base.rank, self.free
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

    def _at_best(self, fault: Callable[[float], Fault], grid: Array, reach: float, **options: float) -> Fault:
        """Fit with the fault of the best value undone: the best on a grid, and then within reach of the best so far."""

        def size(value: float) -> float:
            return self.fit(fault(value)).size

        least, best = min((size(value), value) for value in grid.tolist())
        for _ in range(_MOVES):
            before, above, bounds = best, least, (best - reach, best + reach)
            found = scipy.optimize.minimize_scalar(size, bounds=bounds, method="bounded", options=options)
            best, least = found.x, found.fun
            if abs(best - before) < _EDGE * reach or above - least < _SHOWN:
                break
        return self.fit(fault(float(best)))

    def _with_gains(self) -> Fault:
        """The best gains of all joints, from those with which the described torques are the measured ones."""
        n, known = self.samples.q.shape[1], self.described is not None

        right, squares = np.einsum("jbj->jb", self.plain.right[:, :-1]), np.diagonal(self.plain.squares)

        def fit(log_gains: Array) -> Fault:
            return self.plain.fit(replace(NO_FAULT, torques=np.diag(np.exp(log_gains))))

        def size(log_gains: Array) -> float:
            return fit(log_gains).size

        def size_and_slope(log_gains: Array) -> tuple[float, Array]:
            """With the slope beside the parameters that fit best, which their change does not change."""
            found, gains = fit(log_gains), np.exp(log_gains)
            of_square = 1 - (right @ found.parameters) / np.maximum(gains * squares, _NOTHING)
            slope = of_square / np.maximum(found.errors, LEAST_ERROR) ** 2 - 1
            return found.size, np.where(found.errors > LEAST_ERROR, slope, 0.0)

        dd, dy = self.plain.products[:, -1, -1], np.diagonal(self.plain.right[:, -1])
        start = np.log(dd / np.abs(dy)) if np.all(dd * dy != 0) else np.zeros(n)
        for unit in np.eye(n):  # where friction hides the described torque, the start may be far off
            start = min((start + step * unit for step in (0.0, *_GAINS)), key=size)
        best = scipy.optimize.minimize(size_and_slope, start, jac=True, method="L-BFGS-B", bounds=[_LOG_GAIN] * n)
        off = (min(size(best.x + step), size(best.x - step)) for step in np.log(_OFF) * np.eye(n))
        shown = np.array([least - best.fun > _SHOWN for least in off])
        gains = np.exp(best.x if known or not shown.any() else best.x - np.median(best.x[shown]))
        return self.plain.fit(gains_fault(self.target.robot.joint_names, gains, shown, known=known))

    def _tilted(self) -> list[Fault]:
        """The best directions of gravity, in which rows are affine; where it is oblique, all base parameters show."""
        down = self.target.robot.gravity
        length = float(np.linalg.norm(down))
        if length == 0:
            return []
        fit, axes = partial(self._in_gravity, 0), np.column_stack([down / length, scipy.linalg.null_space(down[None])])
        grid = [np.array(g) / np.linalg.norm(g) for g in product((1.0, 0.0, -1.0), repeat=3) if any(g)]
        found = []
        for way in (1.0, 0.0, -1.0):  # as on the floor, on a wall, under a ceiling
            tilted = min((length * axes @ g for g in grid if np.sign(g[0]) == way), key=lambda g: fit(g).size)
            found.append(self._turned(0, tilted, _TURNS))
        (best, of_best), (other, of_other), _ = sorted(found, key=lambda one: one[1].size)
        return [of_best, *([of_other] if gravity_fault(best, other).kind != NO_FAULT.kind else [])]

    @cached_property
    def _of_gravity(self) -> tuple[FaultSearch, Array, Array]:
        """The search with the base of an oblique gravity, its rows, and what each component of gravity adds to them."""
        robot, down = self.target.robot, self.target.robot.gravity
        across = scipy.linalg.null_space(down[None])
        gravities = np.array([down, np.column_stack([down, across]) @ _OBLIQUE, across[:, 0], np.zeros(3)])
        models = [self.target.model.on(robot.replace(gravity=g)) for g in gravities]
        base = base_parameters(models[1], states=random_states(robot, few_states(models[1])))
        own = replace(self.target, base=base, model=models[0])
        search = replace(self, target=own, described=described_coefficients(own), signs=signs_of_bodies(base))
        W = np.array([replace(search, target=replace(own, model=model)).columns_of(self.samples) for model in models])
        affine = np.linalg.inv(np.column_stack([gravities, np.ones(len(models))]))
        return search, W[0], np.tensordot(affine[:3], W, 1)

    def _in_gravity(self, split: int, gravity: Array, before: Fault | None = None) -> Fault:
        """Fit with that gravity from an instant on, or with three more columns for its change."""
        down, moment = self.target.robot.gravity, self.moments[split]
        search, level, changes = self._of_gravity
        after = (np.arange(len(level)) >= split)[:, None, None]
        W = level + after * np.tensordot(gravity - down, changes, 1)
        K = None if before is None else after * np.moveaxis(changes @ before.parameters[: W.shape[2]], 0, 2)
        fault = moved_fault(down, gravity, moment) if split else gravity_fault(down, gravity)
        return Equations.of(search, self.samples, W, self.measured, K).fit(fault)

    def _turned(self, split: int, gravity: Array, turns: int) -> tuple[Array, Fault]:
        """A better gravity from an instant on, linear in its change, by the Gauss-Newton method, and its fit."""
        here = self._in_gravity(split, gravity)
        for _ in range(turns):
            step = self._in_gravity(split, gravity, here).parameters[-3:]
            turned = [gravity + share * step for share in _STEPS]
            turned = [g * np.linalg.norm(gravity) / np.linalg.norm(g) for g in turned]
            fits = [*(self._in_gravity(split, g) for g in turned), here]
            best = min(range(len(fits)), key=lambda k: fits[k].size)
            if fits[best] is here:
                break
            gravity, here = turned[best], fits[best]
        return gravity, here

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
            turned, _ = self._turned(split, gravity, 1)
            refined = _refined(split, stride // 2, partial(size, turned))
            if turned is gravity and refined == split:
                break
            gravity, split = turned, refined
        return self._in_gravity(split, gravity)

    def _drifting(self) -> Fault:
        """Friction of every drive that changes in proportion to the time of each log."""
        F, lacking = friction_columns(self.target, self.friction, self.samples)
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
            return self.fit(late_from_fault(names, rows, self.step * late, self.moments[split]))

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
            return self.fit(delay_fault(names, steps * which, self.step)).size

        best = _refined(min(self._delays, key=size), max(1, round(0.01 / self.step)), size)
        return self.fit(delay_fault(names, best * which, self.step))


def _moved_centre(robot: Robot, j: int, angle: float) -> float:
    """How far the turn of a joint moves the described centre of its own body [m]."""
    theta = robot.links[j].theta
    if theta is None or theta[0] <= 0:
        return 0.0
    return float(2 * np.sin(angle / 2) * np.linalg.norm(np.cross(robot.joints[j].axis, theta[1:4])) / theta[0])


def _refined(best: int, stride: int, size: Callable[[int], float]) -> int:
    """The best whole number near one, by steps that are halved."""
    size = cache(size)
    while stride:
        best = min((best - stride, best, best + stride), key=size)
        stride //= 2
    return best
