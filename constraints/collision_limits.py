"""Limits that keep a robot's links apart from each other and from obstacles."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain, product

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from constraints.clearance import DEEP, Frames, Gap, gaps
from constraints.geometry import Obstacle, RangesApart, Shape, World
from constraints.hulls import NEARLY
from constraints.nonlinear import Limit, NonlinearConstraint, motion_symbols
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.robot.robot import BASE, Robot, finite_ranges
from regressors.robot.shapes import Capsule
from regressors.robot.symbolic.intervals import OverBoxes, interval_function
from regressors.robot.symbolic.kinematics import sparse
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Samples

_POSES, _FEW = 2000, 64
_SCALE = 0.1  # m: a distance that counts as large
_STILL = 1e-9  # m: a distance that varies by less counts as independent of the motion


@dataclass(frozen=True)
class Pair:
    """Two bodies that must stay apart."""

    link: str  # link that carries capsules; the one further from the base, if both do
    capsules: tuple[Capsule, ...]  # in the link's frame
    other: str  # the other link, or an obstacle
    carrier: str  # body that carries the other one: the link itself, or the base
    shapes: tuple[Shape, ...]  # in the carrier's frame
    clearance: float  # least distance [m]
    mounting: bool = False  # whether the robot is fastened to the other body

    @property
    def is_obstacle(self) -> bool:
        """True if the other body is not part of the robot."""
        return self.other != self.carrier

    @property
    def label(self) -> str:
        """Label of the pair, such as ``link_5 to table``."""
        return f"{self.link} to {self.other}"


class Clearance(NonlinearConstraint):
    """Distances of capsules on links from other bodies.

    With d the sum of radii and clearance, ``(|p - y|^2 - d^2) / (2 d) + clearance >= clearance``, which at the bound
    equals the distance between the surfaces in value and slope; for a plane ``n . p - offset - radius``. The distances
    between surfaces are reported.
    """

    def __init__(self, robot: Robot, motion: PartialMotion, pairs: Sequence[Pair], world: World) -> None:
        self.robot, self.motion, self.pairs, self.world = robot, motion, tuple(pairs), world
        self.joints = motion.matrix.shape[1]
        reach, squared = (np.array([getattr(gap, name) for _, gap in self._gaps]) for name in ("reach", "squared"))
        clearance = np.array([pair.clearance for pair, _ in self._gaps])
        d = reach + clearance

        def shown(values: Array) -> Array:
            square = 2 * d * (values - clearance) + d**2
            return np.where(squared, np.sqrt(np.maximum(square, 0.0)) - reach, values)

        bounds = clearance, np.full(d.size, np.inf), np.full(d.size, _SCALE)
        texts = tuple(pair.label for pair, _ in self._gaps), ("m",) * d.size
        super().__init__(self.joints, self._at, *bounds, *texts, shown, "distance")

    def _at(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.substitute(self._expressions[0], motion_symbols(self.joints)[0], q)

    @cached_property
    def _gaps(self) -> list[tuple[Pair, Gap]]:
        frames, found = _frames(self.robot, self.motion), []
        for pair in self.pairs:
            common = frames.common(pair.link, pair.carrier)
            pose, other = frames.pose(pair.link, common), frames.pose(pair.carrier, common)
            both = product(pair.capsules, pair.shapes)
            each = (gaps(capsule, pose, shape, other, self.world.tolerance) for capsule, shape in both)
            found += [(pair, gap) for gap in chain.from_iterable(each)]
        return found

    @cached_property
    def _expressions(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """The functions, the same with symbols for held values, the symbols, and their expressions."""
        open_form = ca.vertcat(*(_value(gap, pair.clearance) for pair, gap in self._gaps))
        held = [pair for _, gap in self._gaps for pair in gap.held]
        symbols, meaning = (ca.vertcat(ca.SX(0, 1), *(pair[k] for pair in held)) for k in (0, 1))
        return ca.substitute(open_form, symbols, meaning), open_form, symbols, meaning

    @cached_property
    def jacobian(self) -> VectorisedFunction:
        """``dg / d(q, dq, ddq)``, shape (k, 3 n), for many instants at once."""
        q, dq, ddq, _ = motion_symbols(self.joints)
        _, g, held, meaning = self._expressions
        slopes = ca.substitute(ca.jacobian(g, q), held, meaning)
        return VectorisedFunction([q, dq, ddq], ca.horzcat(slopes, ca.SX(g.numel(), 2 * self.joints)))

    @cached_property
    def derivatives(self) -> tuple[int, ...]:
        """Positions alone."""
        return (0,)

    @cached_property
    def varies(self) -> NDArray[np.bool_]:
        """Those whose expression contains a coordinate: the Jacobians of most are never asked for."""
        return np.array(ca.which_depends(self._expressions[1], motion_symbols(self.joints)[0], 1, True))

    @cached_property
    def rate(self) -> OverBoxes:
        """``dg/dt`` of (q, dq, ddq, dddq), enclosed over boxes."""
        q, dq, ddq, dddq = motion_symbols(self.joints)
        _, g, held, meaning = self._expressions
        return interval_function([q, dq, ddq, dddq], ca.substitute(ca.jtimes(g, q, dq), held, meaning))


@lru_cache(maxsize=1)
def _frames(robot: Robot, motion: PartialMotion) -> Frames:
    """Frames at the symbols, which the limits of a motion share."""
    q, *_ = motion_symbols(motion.matrix.shape[1])
    return Frames(robot, ca.mtimes(sparse(motion.matrix), q) + ca.DM(motion.offset))


def _value(gap: Gap, clearance: float) -> ca.SX:
    d = gap.reach + clearance
    return (gap.value - d**2) / (2 * d) + clearance if gap.squared else gap.value


def collision_limits(robot: Robot, world: World, motion: PartialMotion) -> list[NonlinearConstraint]:
    """Limits that keep a robot apart from itself and from obstacles, for each link from bodies nearer to the base.

    Left out are: adjacent links; ignored pairs; constant distances that keep the clearance; what never moves away from
    the surface that the robot is fastened to; and pairs of links, or of a link and that surface, that collide in every
    one of 2000 random poses, or nearly so: their capsules touch by construction, and the limits list them.
    Links that ranges of joints keep apart are limited by these ranges instead.
    """
    world.check(robot)
    return _limits(robot, world, motion, _pairs(robot, world, motion).values())


def _limits(
    robot: Robot, world: World, motion: PartialMotion, groups: Iterable[list[Pair]]
) -> list[NonlinearConstraint]:
    clearances: list[Clearance] = []
    notes: defaultdict[str, list[str]] = defaultdict(list)  # pairs by what is to be known of them
    poses = _poses(robot, motion)
    for pairs in (pairs for pairs in groups if pairs):
        limit = Clearance(robot, motion, pairs, world)
        kept = _kept(limit, poses, notes)
        if kept:
            clearances.append(limit if kept == list(pairs) else Clearance(robot, motion, kept, world))
    limits = [*clearances, *_within_ranges(robot, world, motion)]
    if limits:
        limits[0].unchecked = {", ".join(pairs): _TOUCH for pairs in (notes.pop(_TOUCH, None),) if pairs}
        limits[0].notes += tuple(f"{', '.join(pairs)}: {what}" for what, pairs in notes.items())
    return limits


def _kept_by_ranges(robot: Robot, world: World, motion: PartialMotion) -> list[RangesApart]:
    """Pairs that ranges of joints keep apart: those whose joints move, or stand still within them."""
    ignored, still = [set(pair) for pair in world.ignored], ~np.any(motion.matrix, axis=1)

    def can_keep(joint: int, lower: float, upper: float) -> bool:
        return not still[joint] or bool(lower <= motion.offset[joint] <= upper)

    return [
        each
        for each in world.apart
        if world.self_collision
        and set(each.links) not in ignored
        and all(can_keep(robot.joint_names.index(name), *ends) for name, *ends in each.within)
    ]


def _within_ranges(robot: Robot, world: World, motion: PartialMotion) -> list[NonlinearConstraint]:
    """Limit of the joints that must stay within such ranges, where their own limits do not see to that."""
    low, high = finite_ranges(robot)
    rows = [
        (joint, max(lower, float(low[joint])), min(upper, float(high[joint])), " to ".join(each.links[::-1]))
        for each in _kept_by_ranges(robot, world, motion)
        for joint, lower, upper in ((robot.joint_names.index(name), a, b) for name, a, b in each.within)
        if np.any(motion.matrix[joint]) and (lower > low[joint] + _STILL or upper < high[joint] - _STILL)
    ]
    if not rows:
        return []
    joints, lower, upper = (list(column) for column in list(zip(*rows, strict=True))[:3])
    N, q0 = sparse(motion.matrix[joints]), ca.DM(motion.offset[joints])
    names = [robot.joint_names[joint] for joint in joints]
    units = tuple("m" if robot.joints[joint].kind == "prismatic" else "rad" for joint in joints)
    limit = NonlinearConstraint(
        motion.matrix.shape[1],
        lambda q, dq, ddq: ca.mtimes(N, q) + q0,
        np.where(lower > low[joints] + _STILL, lower, -np.inf),
        np.where(upper < high[joints] - _STILL, upper, np.inf),
        np.subtract(upper, lower) / 2,
        tuple(f"{row[3]}, by {name}" for row, name in zip(rows, names, strict=True)),
        units,
        quantity="distance",
    )
    limit.notes = tuple(
        f"{pair}: kept apart by {name}, which stays between {lower:.4g} and {upper:.4g} {unit}; their capsules touch "
        "in many poses"
        for (_, lower, upper, pair), name, unit in zip(rows, names, units, strict=True)
    )
    return [limit]


_ALWAYS = f"closer than allowed, or nearly so, in all of {_POSES} random poses"
_TOUCH = f"their capsules are {_ALWAYS}; several of them a link (`world`) fit closer"


def _kept(limit: Clearance, poses: Array, notes: defaultdict[str, list[str]]) -> list[Pair]:
    """Pairs whose distance varies and is allowed in some pose; notes list pairs left out without being safe."""
    if len(poses) > _FEW and (few := _kept(limit, poses[:_FEW], defaultdict(list))) == list(limit.pairs):
        return few  # more poses would keep them too
    distance = limit.shown(limit.values(Samples.at_rest(poses)))
    kept = []
    for pair in limit.pairs:
        own, allowed = distance[:, [label == pair.label for label in limit.labels]], pair.clearance
        if pair.mounting:
            kept += _above_mounting(pair, own, notes)
            continue
        fixed, widest = bool(np.all(np.ptp(own, axis=0) < _STILL)), float(own.min(axis=1).max())
        if fixed and pair.is_obstacle and widest < allowed:
            raise InputError(
                f"{pair.label}: they are {widest:.4g} m apart, and no motion of {', '.join(limit.motion.labels)} "
                f"changes that; expected the clearance of {allowed:g} m or more; move the object, or list the pair "
                "under ignore"
            )
        if widest < allowed + NEARLY and not pair.is_obstacle:
            notes[_TOUCH].append(pair.label)
        elif not fixed:
            kept.append(pair)
    return kept


def _above_mounting(pair: Pair, distance: Array, notes: defaultdict[str, list[str]]) -> list[Pair]:
    """A pair with the surface that the robot is fastened to, without ends of capsules that never leave it."""
    # distance (poses, ends)
    still, near = np.ptp(distance, axis=0) < _STILL, distance.max(axis=0) < pair.clearance
    if np.any(near & ~still):
        notes[f"checked in part, as some of the shape is {_ALWAYS}"].append(pair.label)
    if (depth := -distance[0, still].min(initial=np.inf)) > DEEP:
        where = f"in every pose some of its shape, which no joint raises, is {depth:.2g} m below it"
        notes[f"not checked in full, as {where}; check its height (`floor`)"].append(pair.label)
    kept, column = [], iter(~(still | near))
    for capsule in pair.capsules:
        ends = [capsule.start] if capsule.length == 0 else [capsule.start, capsule.end]
        moving = [end for end in ends if next(column)]
        kept += [Capsule(moving[0], moving[-1], capsule.radius)] if moving else []
    return [dataclasses.replace(pair, capsules=tuple(kept))] if kept else []


def _pairs(robot: Robot, world: World, motion: PartialMotion) -> dict[str, list[Pair]]:
    """All pairs that must stay apart: for each link, those with bodies nearer to the base."""
    capsules: dict[str, tuple[Capsule, ...]] = {}
    for part in world.parts:
        capsules[part.link] = (*capsules.get(part.link, ()), part.capsule)
    capsules = {link: _outermost(own) for link, own in capsules.items()}
    order = [BASE, *(body.name for body in robot.bodies)]
    links = sorted(capsules, key=order.index)
    parent = Frames(robot, ca.SX(robot.n, 1)).parent
    ignored = [set(pair) for pair in world.ignored]
    ignored += [set(each.links) for each in _kept_by_ranges(robot, world, motion)]
    pairs_of: dict[str, list[Pair]] = {}
    for number, link in enumerate(links):
        own = capsules[link]
        pairs = [_from_obstacle(link, own, each, world) for each in world.obstacles if link != BASE]
        if world.self_collision:
            nearer = (other for other in links[:number] if parent[link] != other)
            pairs += [Pair(link, own, other, other, capsules[other], world.clearance) for other in nearer]
        pairs = [pair for pair in pairs if {link, pair.other} not in ignored]
        if pairs:
            pairs_of[link] = pairs
    return pairs_of


def _outermost(capsules: Iterable[Capsule]) -> tuple[Capsule, ...]:
    """Those that no other one contains, such as fingers in a capsule about the whole hand."""
    kept: list[Capsule] = []
    for capsule in sorted(dict.fromkeys(capsules), key=lambda each: (each.radius, each.length), reverse=True):
        ends = np.array([capsule.start, capsule.end])
        if not any(max(map(other.distance, ends)) <= -capsule.radius for other in kept):
            kept.append(capsule)
    return tuple(capsule for capsule in dict.fromkeys(capsules) if capsule in kept)


def _from_obstacle(link: str, capsules: tuple[Capsule, ...], obstacle: Obstacle, world: World) -> Pair:
    clearance = world.clearance if obstacle.clearance is None else obstacle.clearance
    return Pair(link, capsules, obstacle.name, BASE, (obstacle.shape,), clearance, obstacle.mounting)


def _poses(robot: Robot, motion: PartialMotion) -> Array:
    """Random poses of the moving coordinates, within the position limits, shape (poses, k)."""
    q = np.random.default_rng(0).uniform(*finite_ranges(robot), (_POSES, robot.n))
    return np.asarray((q - motion.offset) @ np.linalg.pinv(motion.matrix).T)


@checked
@dataclass(frozen=True)
class Collisions(Limit):
    """Distances between a robot's links, and between links and obstacles.

    Parameters
    ----------
    world : World
        Shape of the robot, obstacles, clearance.
    """

    world: World

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """See `collision_limits`."""
        return collision_limits(robot, self.world, motion)


# designs of one robot after the other have the same limits, whose functions are compiled
_KNOWN: dict[Hashable, list[NonlinearConstraint]] = {}
_MOST_KNOWN = 16


@dataclass(frozen=True)
class SelfCollisions(Collisions):
    """The same, each pair of bodies a constraint of its own."""

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """The limits of `collision_limits`, each pair of bodies on its own: a search can do with a few of them."""
        self.world.check(robot)
        case = (robot.sha256(), motion.labels, motion.matrix.tobytes(), motion.offset.tobytes(), self.world)
        if case not in _KNOWN:
            pairs = [pair for pairs in _pairs(robot, self.world, motion).values() for pair in pairs]
            heights = [pair for pair in pairs if pair.mounting]  # which share most of their terms, and are one limit
            groups = [*([pair] for pair in pairs if not pair.mounting), heights]
            _KNOWN[case] = _limits(robot, self.world, motion, groups)
            if len(_KNOWN) > _MOST_KNOWN:
                del _KNOWN[next(iter(_KNOWN))]
        return list(_KNOWN[case])
