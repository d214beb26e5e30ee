"""All limits of a motion on the grid of its family, for solvers.

Bounds are tightened so that constraints that hold on the grid hold at all times: rigorously, by the family's factor,
for functions that are linear in the motion; by a reserve, which the design's certificate checks, for the others.

The grid is fine enough to impose limits on; most of it is far from every bound, and a search need not look there.
Between two coarse instants it looks at every one where the larger use, and what a parabola through three of them may
rise above it, comes near the bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from constraints.linear import LinearConstraint
from constraints.nonlinear import JoinedConstraint, NonlinearConstraint, StackedConstraint
from excite.trajectories.family import GridMotion
from regressors.models.partial import ClosedMotion, PartialMotion
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class GridLimits:
    """Limits of a design problem."""

    linear: tuple[GridConstraint, ...]  # on positions and their derivatives: linear in the motion, not necessarily in x
    nonlinear: tuple[GridConstraint, ...] = ()  # on torques, the tool and distances
    stated: tuple[GridConstraint, ...] = ()  # on torques and distances by default, left out until a motion breaks them
    # the nonlinear ones as a search evaluates them: those that were asked for as one
    together: tuple[GridConstraint, ...] = ()

    @classmethod
    def imposed(
        cls,
        grid: GridMotion,
        linear: Sequence[LinearConstraint],
        nonlinear: Sequence[NonlinearConstraint],
        motion: PartialMotion,
        stated: Sequence[NonlinearConstraint] = (),
    ) -> GridLimits:
        """Build the constraints on a grid."""
        joints = GridJoints(grid, motion)
        each = tuple(GridConstraint.on_joints(limit, joints) for limit in nonlinear)
        return cls(
            tuple(GridConstraint.on_coordinates(limit, grid) for limit in linear),
            each,
            tuple(GridConstraint.on_joints(limit, joints) for limit in stated),
            _as_one(each, StackedConstraint),
        )

    def with_broken(self, x: Array) -> GridLimits:
        """With those that hold by default, but not for this x, among the others; itself if there are none."""
        return self._with([limit for limit in self.stated if not limit.holds(x)])

    def with_near(self, motions: Sequence[Array]) -> GridLimits:
        """With those that hold by default, and that some motions use almost whole, among the others."""
        return self._with([limit for limit in self.stated if any(limit.is_near(x) for x in motions)])

    def _with(self, more: Sequence[GridConstraint]) -> GridLimits:
        if not more:
            return self
        kept = tuple(limit for limit in self.stated if limit not in more)
        together = _as_one((*self.together, *more), JoinedConstraint)
        return GridLimits(self.linear, (*self.nonlinear, *more), kept, together)

    def with_expected(self, motions: Sequence[Array]) -> GridLimits:
        """With those that hold by default, but not for all of some motions, among the others, evaluated as one."""
        kept = self.stated
        for x in motions:  # where all joints are is computed once a motion
            kept = tuple(limit for limit in kept if limit.holds(x))
        limits = self._with([limit for limit in self.stated if limit not in kept])
        return replace(limits, together=_as_one(limits.nonlinear, StackedConstraint))

    @property
    def linear_in_x(self) -> tuple[GridConstraint, ...]:
        """Constraints whose rows are the same at every x."""
        return tuple(limit for limit in (*self.linear, *self.nonlinear) if limit.linear)

    @property
    def nonlinear_in_x(self) -> tuple[GridConstraint, ...]:
        """Constraints that enter a programme as tangents."""
        return tuple(limit for limit in (*self.linear, *self.together) if not limit.linear)

    @property
    def instructions(self) -> int:
        """Those of the nonlinear limits at one instant."""
        functions = [limit.function for limit in self.together]
        return sum(f.constraint.function.instructions for f in functions if isinstance(f, JointFunction))

    def linear_values(self, x: Array) -> list[Array]:
        """Values of the linear limits' functions on the grid."""
        return [limit.values(x) for limit in self.linear]

    def largest_part(self, values: list[Array], step: Array, end: Array) -> float:
        """Largest fraction >= 0 of a step that stays within the linear limits; it leaves the shape unchanged."""
        pairs = zip(self.linear, values, strict=True)
        changes = ((g, value, g.values(step) if g.linear else g.values(end) - value) for g, value in pairs)
        return max(min((limit.largest_part(value, change) for limit, value, change in changes), default=np.inf), 0.0)


def _as_one(limits: tuple[GridConstraint, ...], kind: type[StackedConstraint]) -> tuple[GridConstraint, ...]:
    """The same limits as one: a search asks for values, uses and tangents once, however many there are."""
    functions = [limit.function for limit in limits if isinstance(limit.function, JointFunction)]
    if len(functions) < 2:
        return limits
    return (GridConstraint.on_joints(kind([each.constraint for each in functions]), functions[0].joints),)


_RESERVE = 0.005  # of a function's scale, kept in reserve for the time between the instants of the grid
_CURVATURE = 0.01  # of the scale: reserve for the curvature along a step


#: Functions at T instants of a grid, linearised about one x: derivatives with respect to the flat x, one function at
#: one of the instants per row, shape (rows, x.size), from the numbers of both.
ConstraintTangent = Callable[[Index, Index], Array]


@dataclass(frozen=True, eq=False)
class GridConstraint:
    """``lower <= g <= upper`` for k functions of the motion at the N instants of a grid."""

    function: GridFunction  # g
    grid: GridMotion  # the motion at the instants as a function of x
    lower: Array  # (k,) bounds, tightened for the time between the instants
    upper: Array  # (k,)
    scale: Array  # (k,) magnitude of each function
    reserve: Array  # (k,) reserve that a programme on tangents keeps for the curvature of its step

    @classmethod
    def on_coordinates(cls, constraint: LinearConstraint, grid: GridMotion) -> GridConstraint:
        """Make one from a constraint that is linear in the motion of the moving coordinates."""
        middle = 0.5 * (constraint.lower + constraint.upper)
        half = 0.5 * (constraint.upper - constraint.lower) * grid.factor(constraint.derivative)
        centre = middle - constraint.offset
        lower, upper = centre - half, centre + half
        scale = np.asarray(0.5 * (upper - lower))
        return cls(LinearFunction(constraint, grid), grid, lower, upper, scale, np.zeros_like(lower))

    @classmethod
    def on_joints(cls, constraint: NonlinearConstraint, joints: GridJoints) -> GridConstraint:
        """Make one from a constraint on torques, the tool or distances, as a function of all joints."""
        scale, kept = constraint.scale, _RESERVE * constraint.scale
        lower, upper = constraint.lower + kept, constraint.upper - kept
        return cls(JointFunction(constraint, joints), joints.grid, lower, upper, scale, _CURVATURE * scale)

    @property
    def linear(self) -> bool:
        """Whether its functions are linear in x, so that one tangent is exact everywhere."""
        return self.function.linear and self.grid.linear

    @cached_property
    def sampled(self) -> Callable[[Array], SampledUse]:
        """The functions at the instants that a search looks at, as a function of x, see `sampled_use`."""
        return keeping_last(lambda x: sampled_use(self, x))

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return self.function.values(x)

    def tangent(self, x: Array, instants: Index | None = None) -> ConstraintTangent:
        """The functions at all or some instants, linearised about x."""
        if instants is None:
            instants = np.arange(self.values(x).shape[1])
        slopes = self.function.slopes(x, instants)  # with respect to the motion
        motion = self.grid.tangent(x, self.function.derivatives, instants)
        return lambda function, place: motion(slopes(function, place), place)

    def uses(self, values: Array) -> Array:
        """Use of the bounds by each value, shape (k, N): 1 at a bound, more beyond, 0 one scale away from both."""
        room = self.upper[:, None] - values
        np.minimum(room, values - self.lower[:, None], out=room)
        room /= self.scale[:, None]
        return np.asarray(np.subtract(1.0, room, out=room))

    def excess(self, values: Array) -> float:
        """Largest excess over a bound, relative to the scale; <= 0 inside."""
        beyond = np.maximum(values - self.upper[:, None], self.lower[:, None] - values) / self.scale[:, None]
        return float(beyond.max(initial=-np.inf))

    @cached_property
    def holds(self) -> Callable[[Array], bool]:
        """Whether every value at an x is within the bounds, as far as a search looks, see `sampled_use`."""
        broken: Index = np.zeros(0, dtype=np.intp)  # asked first: a search shortens a step until none is

        def holds(x: Array) -> bool:
            nonlocal broken
            if broken.size and np.any(self.uses(self.function.values(x, broken)) > 1.0):
                return False
            instants, _, uses = self.sampled(x)
            use = uses.max(axis=0, initial=-np.inf)
            if not np.any(use > 1.0):
                return True
            broken = instants[np.argsort(-use)[: min(_FEW, int(np.sum(use > 1.0)))]]
            return False

        return holds

    def is_near(self, x: Array) -> bool:
        """Whether the motion uses a bound almost whole: others like it are likely to break it."""
        return bool(self.sampled(x)[2].max(initial=-np.inf) > _NEAR)

    def largest_part(self, value: Array, change: Array) -> float:
        """Largest s for which ``value + s change`` stays within the bounds, each of shape (k, N); infinite if any."""
        room = np.where(change > 0, self.upper[:, None] - value, self.lower[:, None] - value)
        ratio = np.divide(room, change, out=np.full_like(room, np.inf), where=change != 0)
        return float(ratio.min(initial=np.inf))


_COARSE = 4  # every so many instants of the grid
_FEW = 8  # instants that are asked first
_NEAR = 0.95  # of a bound
_RISE = 0.25  # of the second difference: twice what a parabola rises above the larger one of its values


#: k functions at T of a grid's instants: the instants in order, (T,); the values, (k, T); and their use of the bounds,
#: (k, T), see `GridConstraint.uses`.
SampledUse = tuple[Index, Array, Array]


def sampled_use(limit: GridConstraint, x: Array) -> SampledUse:
    """Values and uses where a search looks at them; at all instants where the grid itself depends on x."""
    count = len(limit.grid.values(x, 0))
    if not limit.grid.linear or count <= 2 * _COARSE:
        values = limit.values(x)
        return np.arange(count), values, limit.uses(values)
    coarse = limit.function.values(x, slice(0, None, _COARSE))
    use = limit.uses(coarse)
    between = _between(use[limit.function.varies], count)
    instants = np.arange(0, count, _COARSE)
    if not between.size:
        return instants, coarse, use
    fine = limit.function.values(x, between)
    instants = np.concatenate([instants, between])
    order = np.argsort(instants)
    values = np.concatenate([coarse, fine], axis=1).take(order, axis=1)
    return instants[order], values, np.concatenate([use, limit.uses(fine)], axis=1).take(order, axis=1)


def _between(use: Array, count: int) -> Index:
    """Instants between coarse ones at which a bound may be near."""
    second = np.abs(use[:, 2:] - 2.0 * use[:, 1:-1] + use[:, :-2])
    rise = np.empty_like(use)
    rise[:, 1:-1], rise[:, 0], rise[:, -1] = second, second[:, 0], second[:, -1]
    highest = (use + _RISE * rise).max(axis=0, initial=-np.inf) > _NEAR
    near = highest.copy()  # the part of the grid that begins at each coarse instant
    near[:-1] |= highest[1:]
    first = _COARSE * np.flatnonzero(near)
    between = (first[:, None] + np.arange(1, _COARSE)).ravel()
    return np.asarray(between[between < count])


#: Derivatives of one function at one of the instants per row, shape (rows, derivatives, n), from the numbers of both.
Slopes = Callable[[Index, Index], Array]


@dataclass(frozen=True, eq=False)
class LinearFunction:
    """``A y^(d)`` of a constraint on the moving coordinates; its offset is part of the bounds."""

    constraint: LinearConstraint  # k functions of the moving coordinates
    grid: GridMotion
    linear = True  # in the motion

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The limited derivative, 0 for position to 3 for jerk."""
        return (self.constraint.derivative,)

    @property
    def varies(self) -> NDArray[np.bool_]:
        """All with an entry in A."""
        return np.asarray(self.constraint.matrix.any(axis=1))

    def values(self, x: Array, instants: Index | slice | None = None) -> Array:
        """Values at all N instants or some, shape (k, N)."""
        values = self.grid.combined(x, self.constraint.matrix, self.constraint.derivative)
        return values if instants is None else values[:, instants]

    def slopes(self, x: Array, instants: Index) -> Slopes:
        """Rows of the matrix, for every instant."""
        return lambda function, _: self.constraint.matrix[function][:, None, :]


@dataclass(frozen=True, eq=False)
class JointFunction:
    """``g(q, dq, ddq)`` of torques, the tool or distances."""

    constraint: NonlinearConstraint  # k functions of all joints
    joints: GridJoints  # motion of all joints on the grid
    linear = False

    @property
    def derivatives(self) -> tuple[int, ...]:
        """Those of position, velocity and acceleration that they depend on."""
        of_joints = self.constraint.derivatives
        return of_joints if self.joints.motion.straight else tuple(range(max(of_joints) + 1))

    @property
    def varies(self) -> NDArray[np.bool_]:
        """Those with a nonzero in the Jacobian."""
        return self.constraint.varies

    def values(self, x: Array, instants: Index | slice | None = None) -> Array:
        """Values at all N instants or some, shape (k, N)."""
        return self.constraint.at_instants(self.joints(x, instants))

    def slopes(self, x: Array, instants: Index) -> Slopes:
        """Derivatives with respect to the moving coordinates' position, velocity and acceleration, where used."""
        of_joints = self.constraint.slopes_at_instants(self.joints(x, instants))
        n, orders = self.constraint.joints, np.array(self.derivatives)
        to_coordinates = self.joints.to_coordinates(x, instants)

        def slopes(function: Index, place: Index) -> Array:
            columns = (orders[:, None] * n + np.arange(n)).ravel()
            return to_coordinates(of_joints(function, place, columns).reshape(function.size, orders.size, n), place)

        return slopes


#: k functions of the motion of the moving coordinates at each of N instants.
GridFunction = LinearFunction | JointFunction

T = TypeVar("T")


def keeping_last(function: Callable[[Array], T]) -> Callable[[Array], T]:
    """The function of x, with its last result kept: a search asks several times for the values at one iterate."""
    last: list[tuple[Array, T]] = []

    def kept(x: Array) -> T:
        if not last or not np.array_equal(x, last[0][0]):
            last[:] = [(x.copy(), function(x))]
        return last[0][1]

    return kept


class GridJoints:
    """Position, velocity and acceleration of all joints on a grid of N instants, as functions of x."""

    def __init__(self, grid: GridMotion, motion: PartialMotion) -> None:
        self.grid, self.motion = grid, motion
        self._last = keeping_last(self._all)

    def __call__(self, x: Array, instants: Index | slice | None = None) -> list[Array]:
        """Three arrays of shape (n, N), at all instants or some; not to be changed."""
        motion = self._last(x)
        return motion if instants is None else [part[:, instants] for part in motion]

    def to_coordinates(self, x: Array, instants: Index) -> Callable[[Array, Index], Array]:
        """Slopes with respect to the coordinates from those with respect to joints, each at one of some instants.

        Both of shape (rows, derivatives, joints or coordinates), of the first derivatives.
        """
        motion = self.motion
        if not isinstance(motion, ClosedMotion):
            return lambda slopes, place: slopes if motion.complete else np.asarray(slopes @ motion.matrix)
        q, loops = self(x, instants)[0], motion.loops
        rates = [self.grid.values(x, order)[instants].T for order in (1, 2)]

        def closed(slopes: Array, place: Index) -> Array:
            orders = slopes.shape[1]
            each = [slopes[:, k].T if k < orders else np.zeros((len(q), place.size)) for k in range(3)]
            found = loops.pullback(q[:, place], [rate[:, place] for rate in rates], each)
            return np.stack([part.T for part in found[:orders]], axis=1)

        return closed

    def _all(self, x: Array) -> list[Array]:
        if isinstance(self.motion, ClosedMotion):
            return self.motion.loops.moved([np.ascontiguousarray(self.grid.values(x, k).T) for k in range(3)])
        q, dq, ddq = (self.grid.combined(x, self.motion.matrix, derivative) for derivative in range(3))
        return [q + self.motion.offset[:, None], dq, ddq]
