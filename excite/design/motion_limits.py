"""Limits of a motion over continuous time: certified when it is designed, and again when its file is read.

The grid of a family is fine enough to impose limits on; most of it is far from every bound, and a search need not look
there. Between two coarse instants it looks at every one where the larger use, and what a parabola through three of them
may rise above it, comes near the bound.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from constraints.bounds.certificate import EXACT, LimitUse, limit_uses
from constraints.bounds.enclosure import enclose
from constraints.bounds.extrema import Extrema
from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.imposed_limits import nonlinear_limits
from excite.design.stated_limits import StatedWorld, stated_limits
from regressors.errors import InputError
from regressors.samples import Array, Index, Samples

if TYPE_CHECKING:
    from excite.design.grid_limits import GridConstraint
    from excite.design.stored_design import StoredDesign


class BoundedMotion(Protocol):
    """A motion whose extrema over continuous time are known: that of a trajectory, or an approach."""

    @property
    def duration(self) -> float:
        """Duration from start to end [s]."""

    @property
    def jerk(self) -> Array:
        """Largest magnitude of every joint's jerk [rad/s^3 or m/s^3]."""

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]."""

    def extrema(self, constraint: LinearConstraint, /) -> Extrema:
        """Extrema of a linear constraint's functions."""


def uses_of(
    motion: BoundedMotion, linear: Iterable[LinearConstraint], nonlinear: Iterable[NonlinearConstraint] = ()
) -> tuple[LimitUse, ...]:
    """Certificate of every limit for a motion: exact extrema of linear ones, enclosures of the others."""
    exact = (use for limit in linear for use in limit_uses(limit, motion.extrema(limit)))
    enclosures = ((limit, enclose(limit, motion.samples, motion.duration, motion.jerk)) for limit in nonlinear)
    return (*exact, *(use for limit, enclosure in enclosures for use in enclosure.uses(limit)))


def imposed_on(design: StoredDesign, joints: tuple[str, ...]) -> tuple[NonlinearConstraint, ...]:
    """Limits of a stored design that are not linear: those that its task asks for, and those that hold by default."""
    robot, task = design.robot, design.task
    by_default = stated_limits(robot, joints, task, StatedWorld(design.shape)).constraints
    unclaimed = {each.limit for each in design.unchecked}
    kept = (limit for limit in by_default if limit.quantity not in unclaimed)
    return (*nonlinear_limits(robot, joints, task), *kept)


def _uses(stated: Iterable[Mapping[str, Any]]) -> tuple[LimitUse, ...]:
    return tuple(LimitUse(**{name: value for name, value in each.items() if name != "holds"}) for each in stated)


@dataclass(frozen=True)
class RecomputedLimits:
    """Limits of a stored design, computed from its coefficients, whatever its file says of them."""

    motion: tuple[LimitUse, ...]
    transfers: dict[str, tuple[LimitUse, ...]]  # on the approach and the return, where there are any
    believed: str  # which of them are those that the file states, and why; empty if none are

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> RecomputedLimits:
        """What a ``design.json`` states, unseen."""
        played = content.get("played", {})
        transfers = {name: _uses(played[name]["limits"]) for name in ("approach", "return") if name in played}
        return cls(_uses(content["limits"]), transfers, "limits are those that its file states")


def recomputed_limits(design: StoredDesign, *, enclosed: bool = True) -> RecomputedLimits:
    """Limits of the motion of a stored design.

    Those of positions and their derivatives need nothing but the robot. Others need the parts and files that the task
    names; without them those of the file stay. Limits of torques are not computed where the file does not claim them.
    """
    robot, task, moving, stated = design.robot, design.task, design.moving, RecomputedLimits.of(design.content)
    ways = {} if design.transfers is None else design.transfers.transfers
    whole = linear_limits(task.limits.applied(robot)) if ways else ()
    reason = ""
    of_motion: tuple[NonlinearConstraint, ...] = ()
    of_ways: tuple[NonlinearConstraint, ...] = ()
    try:
        if enclosed:
            of_motion = design.nonlinear
        if enclosed and ways:
            alike = moving.joint_names == robot.joint_names
            of_ways = of_motion if alike else imposed_on(design, robot.joint_names)
    except InputError as error:
        reason = f": {error}"
    motion, believed = _with_stated(uses_of(design.trajectory, linear_limits(moving), of_motion), stated.motion)
    transfers = {}
    for name, way in ways.items():
        uses = uses_of(way, whole, of_ways)
        transfers[name], more = _with_stated(uses, stated.transfers.get(name, ()))
        believed = (*believed, *more)
    kinds = list(dict.fromkeys(use.quantity for use in believed))
    named = " and ".join(filter(None, [", ".join(kinds[:-1]), *kinds[-1:]]))
    said = f"limits of {named} are those that its file states{reason}" if believed else ""
    return RecomputedLimits(motion, transfers, said)


def _with_stated(
    uses: tuple[LimitUse, ...], stated: tuple[LimitUse, ...]
) -> tuple[tuple[LimitUse, ...], tuple[LimitUse, ...]]:
    """Uses with those of a file that could not be computed, and these alone; exact ones are always computed."""
    known = {use.label for use in uses}
    believed = tuple(use for use in stated if use.method != EXACT and use.label not in known)
    return (*uses, *believed), believed


_COARSE = 4  # every so many instants of the grid
_FEW = 8  # instants that are asked first
_NEAR = 0.95  # of a bound
_RISE = 0.25  # of the second difference: twice what a parabola rises above the larger one of its values


@dataclass(frozen=True, eq=False)
class SampledUse:
    """k functions at T of a grid's instants."""

    instants: Index  # (T,) in order
    values: Array  # (k, T)
    use: Array  # (k, T) of the bounds, see `GridConstraint.uses`


class BoundsCheck:
    """Whether a limit holds, asked first where it was last broken: a search shortens a step until none is."""

    def __init__(self, limit: GridConstraint) -> None:
        self._limit = limit
        self._broken: Index = np.zeros(0, dtype=np.intp)

    def __call__(self, x: Array) -> bool:
        """True if every value is within the bounds."""
        limit = self._limit
        if self._broken.size and np.any(limit.uses(limit.function.values(x, self._broken)) > 1.0):
            return False
        sampled = limit.sampled(x)
        use = sampled.use.max(axis=0, initial=-np.inf)
        if not np.any(use > 1.0):
            return True
        self._broken = sampled.instants[np.argsort(-use)[: min(_FEW, int(np.sum(use > 1.0)))]]
        return False


def sampled_use(limit: GridConstraint, x: Array) -> SampledUse:
    """Values and uses where a search looks at them; at all instants where the grid itself depends on x."""
    count = len(limit.grid.values(x, 0))
    if not limit.grid.linear or count <= 2 * _COARSE:
        values = limit.values(x)
        return SampledUse(np.arange(count), values, limit.uses(values))
    coarse = limit.function.values(x, slice(0, None, _COARSE))
    use = limit.uses(coarse)
    between = _between(use[limit.function.varies], count)
    instants = np.arange(0, count, _COARSE)
    if not between.size:
        return SampledUse(instants, coarse, use)
    fine = limit.function.values(x, between)
    instants = np.concatenate([instants, between])
    order = np.argsort(instants)
    values, uses = np.concatenate([coarse, fine], axis=1), np.concatenate([use, limit.uses(fine)], axis=1)
    return SampledUse(instants[order], values[:, order], uses[:, order])


def _between(use: Array, count: int) -> Index:
    """Instants between coarse ones at which a bound may be near."""
    second = np.abs(use[:, 2:] - 2.0 * use[:, 1:-1] + use[:, :-2])
    rise = np.empty_like(use)
    rise[:, 1:-1], rise[:, 0], rise[:, -1] = second, second[:, 0], second[:, -1]
    highest = (use + _RISE * rise).max(axis=0) > _NEAR
    near = highest.copy()  # the part of the grid that begins at each coarse instant
    near[:-1] |= highest[1:]
    first = _COARSE * np.flatnonzero(near)
    between = (first[:, None] + np.arange(1, _COARSE)).ravel()
    return np.asarray(between[between < count])
