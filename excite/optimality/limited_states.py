"""The states (y, dy, ddy) within the limits of joints and drives, and rows of the regressor at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
        return np.asarray(0.5 * (np.where(np.isfinite(self.radius), self.low, np.nan) + self.high))

    @property
    def radius(self) -> Array:
        """Half the positions' range, shape (m,); infinite where it is not bounded."""
        return 0.5 * (self.high - self.low)

    def part(self, kept: Index, others: Index) -> LimitedStates:
        """Of some coordinates, by the functions of these alone."""
        own = ~np.any(self.directions[:, others] != 0.0, axis=1)
        bounds = {name: getattr(self, name)[own] for name in ("low", "high", "velocity", "acceleration", "speeds")}
        return replace(self, directions=self.directions[np.ix_(own, kept)], centre=self.centre[kept], **bounds)

    def extent(self, order: int) -> Array:
        """Largest absolute value of each coordinate, or of a derivative, shape (k,); infinite where it has none."""
        bound = (self.radius, self.velocity, self.acceleration)[order]
        finite = np.isfinite(bound)
        A, b = self.directions[finite], bound[finite]
        extent = np.full(self.n, np.inf)
        if not A.size:
            return extent
        inverse = np.linalg.pinv(A)  # by a combination of all functions, or by one that is the coordinate itself
        spanned = np.isclose(np.diag(inverse @ A), 1.0, atol=_ALIKE)
        extent[spanned] = (np.abs(inverse) @ b)[spanned]
        for row, limit in zip(A, b, strict=True):
            (used,) = np.nonzero(np.abs(row) > _ALIKE)
            if used.size == 1:
                extent[used[0]] = min(extent[used[0]], limit / abs(row[used[0]]))
        return extent

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
        extent = self.extent(block.start // k)
        step[:, block] = direction * np.where(np.isfinite(extent), extent, 0.0)
        part = self._reach(S, step) * np.where(rng.random(count) < 0.6, 1.0, rng.random(count))
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
    for limit in (each for each in limits if each.derivative <= 2):
        for row, offset, lower, upper in zip(limit.matrix, limit.offset, limit.lower, limit.upper, strict=True):
            scale = float(row[np.argmax(np.abs(row))])
            same = (k for k, known in enumerate(D) if np.allclose(known, row / scale, rtol=0.0, atol=_ALIKE))
            if (index := next(same, len(D))) == len(D):
                D.append(row / scale)
                bounds.append([-np.inf, np.inf, np.inf, np.inf])
            bound, ends = bounds[index], sorted(((lower - offset) / scale, (upper - offset) / scale))
            if limit.derivative == 0:
                bound[0], bound[1] = max(bound[0], ends[0]), min(bound[1], ends[1])
            else:
                bound[limit.derivative + 1] = min(bound[limit.derivative + 1], max(abs(end) for end in ends))
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

    def moved_by(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Coordinates that enter each column at all, and those whose position does, shape (b, k) each."""
        symbols = [ca.SX.sym(name, self.motion.matrix.shape[1]) for name in ("y", "dy", "ddy")]
        columns = ca.horzsplit(ca.cse(self.expression(*symbols)))
        depends = [[ca.which_depends(ca.vec(each), symbol, 1, False) for each in columns] for symbol in symbols]
        return np.any(depends, axis=0), np.array(depends[0], dtype=bool)

    def positions_that_count(self) -> NDArray[np.bool_]:
        """Coordinates whose position enters Y at all, shape (k,): not joint 1 of an arm with a vertical first axis."""
        return np.asarray(self.moved_by()[1].any(axis=0))

    def part(self, columns: Index, kept: Index, others: Index, centre: Array) -> StateRows:
        """Some columns, which the kept coordinates alone move; the others rest in the centre."""  # centre (others,)
        N, q0 = self.motion.matrix, self.motion.offset
        labels, units = ([names[i] for i in kept] for names in (self.motion.labels, self.motion.units))
        motion = PartialMotion(tuple(labels), tuple(units), N[:, kept], q0 + N[:, others] @ centre)
        prior = self.prior[np.ix_(columns, columns)]
        return replace(self, motion=motion, transform=self.transform[:, columns], prior=prior)


def state_rows(formulation: Formulation) -> StateRows:
    """Rows at single states of a design problem."""
    blueprint, task = formulation.blueprint, formulation.task
    model = model_of(formulation.target.robot, task).restricted(blueprint.motion, task.model.equations)
    if model.window is not None or type(model).assemble is not RegressorModel.assemble:
        raise InputError(
            f"{type(model).__name__} integrates over time windows: its information matrix is no mean over states, and "
            "no bound on it is known; give a design of a model of single instants, such as 'differential'"
        )
    T = blueprint.transform
    prior = T.T @ blueprint.precision @ T / model.times(task.trajectory.period, task.output.rate).size
    return StateRows(model, blueprint.motion, blueprint.index, T, blueprint.noise, prior)


_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class MomentConditions:
    """``E[h(s)] = B p``, p the triangles of positive semidefinite matrices."""

    states: LimitedStates
    counted: NDArray[np.bool_]  # (k,) coordinates whose bounded positions are used
    # (K,) angular frequencies of the motions' harmonics [rad/s]; none for motions without a spectrum
    frequencies: Array

    @property
    def _scales(self) -> Array:
        """Of u, shape (1 + counted + 2 k,)."""
        extents = [self.states.extent(order) for order in range(3)]
        return np.concatenate([[1.0], extents[0][self.counted], extents[1], extents[2]])

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the positive semidefinite matrices."""
        if not self.frequencies.size:
            return ()
        return (1 + int(self.counted.sum()), *(2 * self.states.n for _ in self.frequencies))

    def values(self, S: Array) -> Array:
        """``h`` at every state, shape (N, m)."""
        y, dy, ddy = np.split(S, 3, axis=1)
        counted = (y - self.states.centre)[:, self.counted]
        u = np.concatenate([np.ones((len(S), 1)), counted, dy, ddy], axis=1) / self._scales
        moments = triangle(np.einsum("ni,nj->nij", u, u)) if self.frequencies.size else self._derivatives_of_products(u)
        return np.concatenate([moments, self._derivatives_of_speeds(S)], axis=1)

    def _derivatives_of_products(self, u: Array) -> Array:
        """``d/dt (a b)`` of all a, b among 1, y and dy, in scaled units, shape (N, m)."""
        p, k, scales = int(self.counted.sum()), self.states.n, self._scales
        velocity = 1 + p + np.arange(k)
        after = np.concatenate([velocity[self.counted], velocity + k])  # of y and dy
        before = np.arange(1, 1 + p + k)
        rate = np.zeros_like(u[:, : 1 + p + k])
        rate[:, before] = u[:, after] * scales[after] / scales[before]
        kept = u[:, : 1 + p + k]
        rows, columns = np.tril_indices(1 + p + k)
        of_products = rate[:, rows] * kept[:, columns] + kept[:, rows] * rate[:, columns]
        others = np.flatnonzero(~self.counted)  # d/dt y of those whose position does not count
        return np.concatenate([of_products[:, 1:], u[:, velocity[others]]], axis=1)

    def _derivatives_of_speeds(self, S: Array) -> Array:
        """``d/dt`` of ``|dz|``, ``|dz| dz`` and ``|dz| (z - middle)`` of every limited function z, shape (N, m)."""
        states = self.states
        y, dy, ddy = np.split(S, 3, axis=1)
        columns = []
        for index in np.flatnonzero(states.speeds & np.isfinite(states.acceleration)):
            row, middle, R = states.directions[index], states.middle[index], states.radius[index]
            V, A = states.velocity[index], states.acceleration[index]
            v, a = dy @ row, ddy @ row
            columns += [np.sign(v) * a / A, np.abs(v) * a / (A * V)]
            if np.isfinite(R) and np.all(self.counted[np.abs(row) > 0]):
                z = y @ row - middle
                columns.append((np.sign(v) * a * z + np.abs(v) * v) / (A * R + V**2))
        return np.stack(columns, axis=1) if columns else np.zeros((len(S), 0))

    def cone(self) -> Array:
        """``B``, shape (m, p); its rows for conditions without P are zero."""
        if not self.frequencies.size:
            return np.zeros((0, 0))
        n, p = self.states.n, int(self.counted.sum())
        embedded = np.pad(triangle_basis(1 + p), ((0, 0), (0, 2 * n), (0, 2 * n)))
        blocks = [triangle(embedded / np.outer(self._scales, self._scales))]
        basis = triangle_basis(2 * n)
        for w in self.frequencies:
            cosine, sine = self._harmonic(float(w))
            blocks.append(triangle(0.5 * (cosine @ basis @ cosine.T + sine @ basis @ sine.T)))
        return np.concatenate(blocks, axis=0).T

    def _harmonic(self, w: float) -> tuple[Array, Array]:
        """Factors of cos(w t) and sin(w t) in u for ``y = a cos(w t) + b sin(w t)``, by (a, b), shape (u, 2 n) each."""
        n = self.states.n
        a, b = np.eye(n, 2 * n), np.eye(n, 2 * n, n)
        rows = [(a[self.counted], b[self.counted]), (w * b, -w * a), (-(w**2) * a, -(w**2) * b)]
        scales = self._scales[1:, None] * w  # P in units of velocity
        cosine, sine = (np.concatenate([row[i] for row in rows]) / scales for i in range(2))
        zero = np.zeros((1, 2 * n))
        return np.concatenate([zero, cosine]), np.concatenate([zero, sine])

    def admitted(self, c: Array) -> Array:
        """Multipliers with ``E[c' h] >= 0`` for every motion, from those of a solver, which are so to a tolerance.

        ``B' c`` must be positive semidefinite, matrix by matrix. What is missing comes from ``u' u``, whose mean is
        positive in every harmonic.
        """
        if not self.frequencies.size:
            return c
        B = self.cone()
        of_second = len(B)
        unit = triangle(np.eye(len(self._scales))[None])[0]
        missing = 0.0
        for adjoint, strictly in zip(self._parts(B.T @ c[:of_second]), self._parts(B.T @ unit), strict=True):
            lowest = float(np.linalg.eigvalsh(adjoint)[0]) - _ROUNDING * float(np.abs(adjoint).max())
            missing = max(missing, -lowest / float(np.linalg.eigvalsh(strictly)[0]))
        changed = c.copy()
        changed[:of_second] += missing * unit
        return changed

    def _parts(self, p: Array) -> list[Array]:
        ends = np.cumsum([size * (size + 1) // 2 for size in self.sizes])
        return [matrix_of(part, size) for part, size in zip(np.split(p, ends[:-1]), self.sizes, strict=True)]


def triangle(M: Array) -> Array:
    """Vectors of symmetric matrices, shape (..., n, n) to (..., n (n + 1) / 2); off-diagonal entries times sqrt 2."""
    column, row = np.tril_indices(M.shape[-1])
    return np.asarray(M[..., row, column] * np.where(row == column, 1.0, np.sqrt(2.0)))


def matrix_of(v: Array, size: int) -> Array:
    """Symmetric matrix of a vector, the inverse of `triangle`, shape (size, size)."""
    column, row = np.tril_indices(size)
    M = np.zeros((size, size))
    M[row, column] = M[column, row] = v / np.where(row == column, 1.0, np.sqrt(2.0))
    return M


def triangle_basis(size: int) -> Array:
    """Symmetric matrices whose vectors are unit vectors, shape (n (n + 1) / 2, size, size)."""
    return np.stack([matrix_of(e, size) for e in np.eye(size * (size + 1) // 2)])
