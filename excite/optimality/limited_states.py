"""The states (y, dy, ddy) within the limits of joints and drives, and rows of the regressor at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from constraints.linear import LinearConstraint
from excite.design.formulation import Formulation
from excite.information.target import model_of
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index, Samples

_SLACK = 1e-9  # of a bound, by which a limit may be exceeded and still count as held
_ALIKE = 1e-9
_EXTREME = 0.15  # exponent that draws most directions towards corners
_HALVINGS = 30
_ORDERS = ("position", "velocity", "acceleration")


@dataclass(frozen=True, eq=False)
class LimitedStates:
    """Convex set of states of k coordinates, by bounds on m functions ``z = D y`` and on their derivatives.

    A trigonometric polynomial f of degree N and period T that stays within R has ``df^2 + (N w f)^2 <= (N w R)^2``,
    w = 2 pi / T [Szegoe 1928]; this links position with velocity and velocity with acceleration.
    """

    directions: Array  # (m, k) ``D``, the largest number of each row is 1
    low: Array  # (m,) bounds on z [rad or m]; infinite where there are none
    high: Array  # (m,)
    velocity: Array  # (m,) bounds on ``|dz|`` and ``|ddz|``; infinite where there are none
    acceleration: Array  # (m,)
    bandwidth: float | None  # ``N w`` [rad/s]; None for motions without a highest frequency
    centre: Array  # (k,) A pose inside the bounds
    speeds: NDArray[np.bool_]  # (m,) functions whose velocity is limited by itself, such as those of drives

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.directions.shape[1])

    @property
    def middle(self) -> Array:
        """Middle of the positions' range, shape (m,); NaN where it is not bounded."""
        return np.where(np.isfinite(self.high - self.low), 0.5 * (self.low + self.high), np.nan)

    @property
    def radius(self) -> Array:
        """Half the positions' range, shape (m,); infinite where it is not bounded."""
        return 0.5 * (self.high - self.low)

    def extent(self, order: int) -> Array:
        """Largest absolute value of each coordinate, or of a derivative, shape (k,); infinite where it has none."""
        bound = (self.radius, self.velocity, self.acceleration)[order]
        return _extent(self.directions, bound)

    def excess(self, S: Array) -> Array:
        """Largest relative excess over a bound of each state, shape (N,); at most zero inside."""  # S (N, 3 k)
        z, dz, ddz = (part @ self.directions.T for part in np.split(S, 3, axis=1))
        bounded = np.isfinite(self.radius)
        z, dz_of = (z - self.middle)[:, bounded], dz[:, bounded]
        R, V, A = self.radius[bounded], self.velocity, self.acceleration
        parts = [np.abs(z) / R, np.abs(dz) / V, np.abs(ddz) / A]
        if self.bandwidth is not None:
            parts.append(np.hypot(z, dz_of / self.bandwidth) / R)
            moving = np.isfinite(V)
            parts.append(np.hypot(dz, ddz / self.bandwidth)[:, moving] / V[moving])
        return np.asarray(np.concatenate(parts, axis=1).max(axis=1) - 1.0)

    def hold(self, S: Array) -> NDArray[np.bool_]:
        """Whether each state is inside, to rounding, shape (N,)."""
        return np.asarray(self.excess(S) <= _SLACK)

    def drawn(self, count: int, rng: np.random.Generator) -> Array:
        """Random states, many of them on the boundary, shape (N, 3 k) with N about ``count``."""
        k = self.n
        S = np.zeros((count, 3 * k))
        S[:, :k] = self.centre
        free = ~np.isfinite(self.extent(0))
        S[:, :k][:, free] = rng.uniform(-np.pi, np.pi, (count, int(free.sum())))
        for block in (slice(0, k), slice(k, 2 * k), slice(2 * k, 3 * k)):
            S = self._moved_out(S, block, rng)
        return S[self.hold(S)]

    def _moved_out(self, S: Array, block: slice, rng: np.random.Generator) -> Array:
        """States moved in random directions of one block, most of them as far as the bounds allow."""
        count, k = len(S), self.n
        u = rng.uniform(-1.0, 1.0, (count, k)) * (rng.random((count, k)) < 0.8)
        step = np.zeros_like(S)
        direction = np.sign(u) * np.abs(u) ** rng.choice([_EXTREME, 1.0], size=(count, 1))
        order = block.start // k
        extent = self.extent(order)
        step[:, block] = direction * np.where(np.isfinite(extent), extent, 0.0)
        part = self._reach(S, step)
        part *= np.where(rng.random(count) < 0.6, 1.0, rng.random(count))
        return np.asarray(S + part[:, None] * step)

    def _reach(self, S: Array, step: Array) -> Array:
        """Largest part of a step, at most 2, that stays inside, by bisection."""
        low, high = np.zeros(len(S)), np.full(len(S), 2.0)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            inside = self.excess(S + middle[:, None] * step) <= 0.0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return low


def limited_states(limits: Sequence[LinearConstraint], centre: Array, bandwidth: float | None) -> LimitedStates:
    """States within linear limits on the moving coordinates."""  # centre (k,)
    D: list[Array] = []
    bounds: list[list[float]] = []
    for limit in limits:
        if limit.derivative > 2:
            continue
        for row, offset, lower, upper in zip(limit.matrix, limit.offset, limit.lower, limit.upper, strict=True):
            scale = float(row[np.argmax(np.abs(row))])
            index = _place(D, bounds, row / scale)
            ends = sorted(((lower - offset) / scale, (upper - offset) / scale))
            _tighten(bounds[index], limit.derivative, ends)
    low, high, velocity, acceleration = np.array(bounds, dtype=float).T
    half, speeds = 0.5 * (high - low), np.isfinite(velocity)
    if bandwidth is not None:
        velocity = np.minimum(velocity, bandwidth * half)
        acceleration = np.minimum(acceleration, bandwidth * velocity)
    states = LimitedStates(np.array(D), low, high, velocity, acceleration, bandwidth, centre, speeds)
    for order in (1, 2):
        if not np.all(np.isfinite(states.extent(order))):
            raise InputError(
                f"no limit bounds the {_ORDERS[order]} of every coordinate, so that no bound on the criterion exists; "
                f"give `{_ORDERS[order]}`"
            )
    return states


def _place(D: list[Array], bounds: list[list[float]], direction: Array) -> int:
    for index, known in enumerate(D):
        if np.allclose(known, direction, rtol=0.0, atol=_ALIKE):
            return index
    D.append(direction)
    bounds.append([-np.inf, np.inf, np.inf, np.inf])
    return len(D) - 1


def _tighten(bound: list[float], derivative: int, ends: Sequence[float]) -> None:
    if derivative == 0:
        bound[0], bound[1] = max(bound[0], ends[0]), min(bound[1], ends[1])
    else:
        bound[derivative + 1] = min(bound[derivative + 1], max(abs(end) for end in ends))


def _extent(D: Array, bound: Array) -> Array:
    """Bound of each coordinate from those of functions: by the function itself, or by a combination of all."""
    finite = np.isfinite(bound)
    A, b = D[finite], bound[finite]
    extent = np.full(D.shape[1], np.inf)
    if not A.size:
        return extent
    inverse = np.linalg.pinv(A)
    spanned = np.isclose(np.diag(inverse @ A), 1.0, atol=_ALIKE)
    extent[spanned] = (np.abs(inverse) @ b)[spanned]
    for row, limit in zip(A, b, strict=True):
        (used,) = np.nonzero(np.abs(row) > _ALIKE)
        if used.size == 1:
            extent[used[0]] = min(extent[used[0]], limit / abs(row[used[0]]))
    return extent


@dataclass(frozen=True, eq=False)
class StateRows:
    """``M = mean of F(s) + P`` with ``F = Y'Y``: Y the rows of one state, divided by their noise, times T."""

    model: RegressorModel  # of single instants, with exact friction
    motion: PartialMotion  # from the k moving coordinates to the joints
    index: Index  # (b,) base columns
    transform: Array  # (b, b) T
    noise: Array  # (r,)
    prior: Array  # (b, b) P, per instant, in the columns of the convention

    def __call__(self, S: Array) -> Array:
        """Y at every state, shape (N, r, b)."""  # S (N, 3 k)
        y, dy, ddy = np.split(S, 3, axis=1)
        N, offset = self.motion.matrix.T, self.motion.offset
        q, dq, ddq = y @ N + offset, dy @ N, ddy @ N
        samples = Samples(np.arange(float(len(S))), q, dq, ddq, np.zeros_like(q))
        W = self.model.instants(samples)[:, self.index] @ self.transform
        return W.reshape(len(S), self.noise.size, -1) / self.noise[:, None]

    def expression(self, y: ca.SX, dy: ca.SX, ddy: ca.SX) -> ca.SX:
        """Y as an expression of the moving coordinates, shape (r, b)."""
        N, offset = ca.DM(self.motion.matrix), ca.DM(self.motion.offset)
        Y = self.model.expression(ca.mtimes(N, y) + offset, ca.mtimes(N, dy), ca.mtimes(N, ddy))
        weighted = ca.mtimes(ca.DM(np.diag(1.0 / self.noise)), Y[:, self.index.tolist()])
        return ca.mtimes(weighted, ca.DM(self.transform))

    def positions_that_count(self) -> NDArray[np.bool_]:
        """Coordinates whose position enters Y at all, shape (k,): not joint 1 of an arm with a vertical first axis."""
        symbols = [ca.SX.sym(name, self.motion.matrix.shape[1]) for name in ("y", "dy", "ddy")]
        Y = ca.vec(ca.cse(self.expression(*symbols)))
        return np.asarray(ca.which_depends(Y, symbols[0], 1, False), dtype=bool)


def state_rows(formulation: Formulation) -> StateRows:
    """Rows at single states of a design problem."""
    blueprint, task = formulation.blueprint, formulation.task
    model = model_of(formulation.target.robot, task).restricted(blueprint.motion, task.model.equations)
    if model.window is not None or not _is_instantaneous(model):
        raise InputError(
            f"{type(model).__name__} integrates over time windows: its information matrix is no mean over states, and "
            "no bound on it is known; give a design of a model of single instants, such as `differential`"
        )
    instants = model.times(task.trajectory.period, task.output.rate).size
    T = blueprint.transform
    return StateRows(
        model, blueprint.motion, blueprint.index, T, blueprint.noise, T.T @ blueprint.precision @ T / instants
    )


def _is_instantaneous(model: RegressorModel) -> bool:
    return type(model).assemble is RegressorModel.assemble
