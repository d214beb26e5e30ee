"""Limits of a motion over continuous time: certified when it is designed, and again whenever its file is read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from constraints.bounds.certificate import EXACT, LimitUse, limit_uses
from constraints.bounds.enclosure import enclose
from constraints.bounds.extrema import Extrema
from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.imposed_limits import nonlinear_limits
from excite.design.stated_limits import StatedWorld, stated_limits
from regressors.errors import InputError
from regressors.samples import Array, Samples

if TYPE_CHECKING:
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
