"""Where to measure the friction of a coordinate: a pose about which gravity cancels by symmetry, if there is one.

On the line ``q(s) = p + N s`` the coordinate needs ``g(s) = N' tau_g(q(s))`` against gravity. Where ``g(-s) = -g(s)``,
its mean over a stretch that is symmetric about p vanishes, and eq. (20) of [KD96] needs no model; a single revolute
joint has that symmetry in every pose in which its gravity torque vanishes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from constraints.certificate import LimitUse
from constraints.collision_limits import collision_limits
from constraints.enclosure import enclose
from constraints.geometry import World
from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.models.partial import PartialMotion, of_joints
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot, Structure, finite_ranges
from regressors.samples import Array, Samples

NONE, CANCELS, SUBTRACTED, STATED = "none", "cancels", "subtracted", "stated"
_RESERVE = 0.01  # part of each position range that is left free at both ends
_FREE = np.pi  # rad or m to both sides, where nothing bounds the coordinate
_NOTHING = 1e-8  # Nm or N
_EVEN = 1e-6  # largest even part of the gravity torque, relative to the largest gravity torque
_ASIDE = 1e-3  # rad or m
_SAME = 1e-6  # of a stroke: a difference that does not count
_GRID, _VALUES, _DRAWN = 241, 9, 40


def gravity_of(robot: Robot) -> Callable[[Array, Array], Array]:
    """Gravity torque ``N' tau_g`` along a line N in some poses; NaN where a body of unknown inertia loads it."""
    model = DifferentialModel(robot.replace(structure=Structure()), Terms.inertial_only())
    known = standard_values(robot)
    theta = np.array([known.get(name, np.nan) for name in model.definition()[1]])
    unknown = np.isnan(theta)

    def along(line: Array, q: Array) -> Array:
        rows = model.instants(Samples.at_rest(q))
        W = np.einsum("j,ijp->ip", line, rows.reshape(len(q), line.size, -1))
        if np.abs(W[:, unknown]).max(initial=0.0) > 1e-9:
            return np.full(len(q), np.nan)
        return np.asarray(W @ np.where(unknown, 0.0, theta))

    return along


@dataclass(frozen=True, eq=False)
class Place:
    """Where a coordinate is measured."""

    pose: Array  # (n,) p, the middle of every run [rad or m]
    low: float  # range of s about it that all position limits allow, less 1 % of it at both ends [rad or m]
    high: float
    # no gravity torque anywhere; odd about the pose; neither, so that a model has to be subtracted; unknown, but
    # stated by the user to cancel
    gravity: str
    # pair that is too near beyond the ends of the range, such as ``forearm to table``; empty where a position limit
    # ends it
    below: str = ""
    above: str = ""

    @property
    def half(self) -> float:
        """Largest stroke to both sides [rad or m]."""
        return min(-self.low, self.high)

    @property
    def obstacle(self) -> str:
        """Pair of bodies that bounds the stroke, empty where a position limit does."""
        return self.below if -self.low <= self.high else self.above

    def moved(self, s: float, line: Array, gravity: str) -> Place:
        """The same line with its origin elsewhere."""
        return replace(self, pose=self.pose + s * line, low=self.low - s, high=self.high - s, gravity=gravity)


@dataclass(frozen=True, eq=False)
class PlaceSearch:
    """Where one coordinate can be measured."""

    robot: Robot
    gravity: Callable[[Array, Array], Array]  # see `gravity_of`
    motion: PartialMotion
    limits: Sequence[LinearConstraint]
    checks: CollisionChecks | None = None

    @property
    def line(self) -> Array:
        """N of ``q = p + N s``, shape (n,)."""
        return self.motion.matrix[:, 0]

    def given(self, pose: Array, *, balanced: bool = False) -> Place:
        """Place in a given pose; its range ends where bodies come too near, unless they already are."""
        whole = _on_line(pose, self.line, self.limits)
        place = self._free(whole) or whole
        g = self._along(pose, np.linspace(place.low, place.high, _GRID))
        if np.any(np.isnan(g)):
            if not balanced:
                raise self._unknown_gravity()
            return replace(place, gravity=STATED)
        size = np.abs(g).max()
        kind = NONE if size <= _NOTHING else CANCELS if self._odd(place, size) else SUBTRACTED
        return replace(place, gravity=kind)

    def found(self, enough: float, wanted: float, seed: int = 0) -> Place:
        """Find a collision-free pose about which gravity cancels and that has room to both sides.

        The other joints stay at home, at zero, or in the middle of their ranges, in this order; where none of these has
        enough room, one of them is moved, then all are drawn at random. Where none offers half of the room that there
        is regardless of gravity, gravity has to be subtracted.
        """
        best: Place | None = None
        plain: Place | None = None
        for number, poses in enumerate((_ordinary(self.robot), _unusual(self.robot, seed))):
            for pose in poses:
                for on_line in self._likely(_on_line(pose, self.line, self.limits)):
                    place = self._symmetric(on_line, enough, wanted)
                    best = self._roomier(best, place, wanted)
                    if best is None or best.half < enough:
                        middle = on_line.moved(_nearest(on_line, wanted), self.line, SUBTRACTED)
                        plain = self._roomier(plain, middle, enough)
                if best is not None and best.half >= (enough if number else wanted):
                    return best
            if best is not None and best.half >= enough:
                return best
        if best is not None and (plain is None or best.half >= 0.5 * min(enough, plain.half)):
            return best
        if plain is None:
            raise self._nowhere()
        return plain

    def _roomier(self, place: Place | None, other: Place | None, enough: float) -> Place | None:
        """The first of two places if it has enough room, or no less than is proven for the other, else the other."""
        if other is None or (place is not None and place.half >= min(enough, other.half * (1.0 - _SAME))):
            return place
        proven = self._free(other)
        return place if proven is None or (place is not None and place.half >= proven.half) else proven

    def _likely(self, place: Place) -> list[Place]:
        """Parts of a place's range in which nothing comes too near, by a check of sampled poses."""
        if place.high <= place.low:
            return []
        if self.checks is None:
            return [place]
        return self.checks.likely(place.pose, self.line, place.low, place.high)

    def _free(self, place: Place) -> Place | None:
        """Limit a place to the range in which provably nothing comes too near; None where bodies do in the pose."""
        if self.checks is None or place.high <= place.low:
            return place
        for part in self.checks.free(place.pose, self.line, place.low, place.high):
            if part.low <= 0.0 <= part.high:
                below, above = part.below or place.below, part.above or place.above
                return replace(place, low=part.low, high=part.high, below=below, above=above)
        return None

    def _unknown_gravity(self) -> InputError:
        """Error where a body of unknown inertia loads a coordinate."""
        return InputError(
            f"{self.motion.labels[0]}: gravity acts on it and the inertias of links are not known, so no pose is known "
            "in which it cancels; state the inertias in the robot's file, or give `pose` together with `balanced`, a "
            "pose about which gravity is known to cancel"
        )

    def _nowhere(self) -> InputError:
        """Error where no pose is left."""
        label = self.motion.labels[0]
        near = "" if self.checks is None else self.checks.nearest(_ordinary(self.robot)[0], self.line)
        if not near:
            return InputError(f"{label}: no pose of the other joints keeps all position limits; give `pose`")
        return InputError(
            f"{label}: no pose was found that keeps all position limits and distances; in the first one that was tried "
            f"{near} are too close; give `pose`, or correct the world file, `floor` or `self_collision`"
        )

    def _symmetric(self, on_line: Place, enough: float, wanted: float) -> Place | None:
        """Place where gravity vanishes or is odd: with room, then upright, then with most room, then nearest."""
        line, s = self.line, np.linspace(on_line.low, on_line.high, _GRID)
        g = self._along(on_line.pose, s)
        if np.any(np.isnan(g)):
            raise self._unknown_gravity()
        size = np.abs(g).max()
        if size <= _NOTHING:
            return on_line.moved(_nearest(on_line, wanted), line, NONE)

        def quality(place: Place) -> tuple[bool, bool, float, float]:
            away = float(np.abs(place.pose - on_line.pose).max())
            return place.half >= enough, self._upright(place), min(place.half, wanted), -away

        places = [on_line.moved(zero, line, CANCELS) for zero in self._zeros(on_line, s, g)]
        odd = [place for place in places if place.half > 0.0 and self._odd(place, size)]
        return max(odd, key=quality, default=None)

    def _upright(self, place: Place) -> bool:
        """Whether the links are upright (maximum potential energy), rather than hanging where the floor may be."""
        before, after = self._along(place.pose, np.array([-_ASIDE, _ASIDE]))
        return bool(before > after)

    def _zeros(self, on_line: Place, s: Array, g: Array) -> Iterator[float]:
        """Zeros of gravity to rounding accuracy: every bracket is repeatedly divided by 16."""
        for k in np.flatnonzero(np.sign(g[:-1]) * np.sign(g[1:]) < 0.0):
            low, high = s[k], s[k + 1]
            for _ in range(10):
                fine = np.linspace(low, high, 17)
                value = np.sign(self._along(on_line.pose, fine))
                at = int(np.argmax(value != value[0]))
                low, high = fine[max(at - 1, 0)], fine[at]
            yield 0.5 * (low + high)
        yield from s[g == 0.0]

    def _odd(self, place: Place, size: float) -> bool:
        """Whether gravity is odd about a place, over the whole stroke to both sides."""
        s = np.linspace(0.0, max(place.half, 0.0), 61)
        even = self._along(place.pose, s) + self._along(place.pose, -s)
        return bool(np.abs(even).max() <= _EVEN * size)

    def _along(self, pose: Array, s: Array) -> Array:
        """Gravity at some positions of the line through a pose, shape (N,)."""
        return self.gravity(self.line, pose + s[:, None] * self.line)


def _nearest(on_line: Place, room: float) -> float:
    """Point of a line nearest to its origin with some room to both sides, else the middle."""
    if on_line.high - on_line.low < 2 * room:
        middle = 0.5 * (on_line.low + on_line.high)
        return middle if abs(middle) > _NOTHING else 0.0
    return float(np.clip(0.0, on_line.low + room, on_line.high - room))


def _on_line(pose: Array, line: Array, limits: Sequence[LinearConstraint]) -> Place:
    """Range of s in which all position limits hold; empty (high below low) where joints at rest violate theirs."""
    low, high, kept = -np.inf, np.inf, True
    for limit in limits:
        if limit.derivative == 0:
            slope, value = limit.matrix @ line, limit.matrix @ pose + limit.offset
            reserve = np.where(np.isfinite(limit.upper - limit.lower), _RESERVE * (limit.upper - limit.lower), 0.0)
            moves = np.abs(slope) > 1e-12
            kept &= bool(np.all((value >= limit.lower - 1e-9)[~moves] & (value <= limit.upper + 1e-9)[~moves]))
            below, above = limit.lower + reserve - value, limit.upper - reserve - value
            ends = np.sort(np.stack([below, above])[:, moves] / slope[moves], axis=0)
            low, high = max(low, ends[0].max(initial=-np.inf)), min(high, ends[1].min(initial=np.inf))
    if not kept:
        return Place(pose, 0.0, -1.0, SUBTRACTED)
    return Place(pose, -_FREE if low == -np.inf else float(low), _FREE if high == np.inf else float(high), SUBTRACTED)


def _ordinary(robot: Robot) -> list[Array]:
    """Home, zero, the middle of all ranges."""
    lower, upper = finite_ranges(robot)
    home = [] if robot.home is None else [robot.home]
    return [*home, np.clip(np.zeros(robot.n), lower, upper), 0.5 * (lower + upper)]


def _unusual(robot: Robot, seed: int) -> Iterator[Array]:
    """The first ordinary pose with one joint elsewhere, then poses drawn from the ranges."""
    lower, upper = finite_ranges(robot)
    for joint in range(robot.n):
        for value in np.linspace(lower[joint], upper[joint], _VALUES + 2)[1:-1]:
            pose = _ordinary(robot)[0].copy()
            pose[joint] = value
            yield pose
    yield from np.random.default_rng(seed).uniform(lower, upper, (_DRAWN, robot.n))


_INTERVALS, _PARTS, _DEPTH = 512, 8, 2
_LOOKED_AT = 512
_MARGIN = 2e-3  # of a function's scale: more than the gap between a certificate and the true minimum


class CollisionChecks:
    """Distances that a robot has to keep."""

    def __init__(self, robot: Robot, world: World) -> None:
        self.limits = collision_limits(robot, world, of_joints(robot, range(robot.n)))
        self.notes = tuple(note for limit in self.limits for note in limit.notes)
        self.unchecked = [each for limit in self.limits for each in limit.unchecked.items()]  # what, and why
        self._labels = [*(label for limit in self.limits for label in limit.labels), ""]

    def free(self, pose: Array, line: Array, low: float, high: float) -> list[Place]:
        """Stretches of a line on which every distance is proven to be kept, to about 1/30,000 of the line."""
        half = 0.5 * (high - low) / _INTERVALS
        middle = np.asarray(low + half * (2 * np.arange(_INTERVALS) + 1))
        ends: list[tuple[float, float, str]] = []  # of each interval, and what is too near there
        for depth in range(_DEPTH + 1):
            kept, lost, nearest = self._decided(pose, line, middle, half)
            remaining = kept | lost if depth < _DEPTH else np.ones_like(kept)
            ends += self._ends(middle[remaining], half, kept[remaining], nearest[remaining])
            parts = half * ((2 * np.arange(_PARTS) + 1) / _PARTS - 1.0)
            middle = (middle[~remaining, None] + parts).ravel()
            half /= _PARTS
            if middle.size == 0:
                break
        return _joined(pose, sorted(ends))

    def likely(self, pose: Array, line: Array, low: float, high: float) -> list[Place]:
        """Quick estimate of `free` from the distances in 512 poses of the line; nothing is proven."""
        half = 0.5 * (high - low) / _LOOKED_AT
        middle = np.asarray(low + half * (2 * np.arange(_LOOKED_AT) + 1))
        room = self._room(pose, line, middle)
        return _joined(pose, self._ends(middle, half, np.all(room >= 0.0, axis=1), room.argmin(axis=1)))

    def _ends(
        self, middle: Array, half: float, kept: NDArray[np.bool_], nearest: NDArray[np.intp]
    ) -> list[tuple[float, float, str]]:
        """Ends of intervals, and what is too near in each."""
        rows = zip(middle.tolist(), kept, nearest.tolist(), strict=True)
        return [(m - half, m + half, "" if ok else self._labels[number]) for m, ok, number in rows]

    def uses(self, pose: Array, line: Array, low: float, high: float) -> list[LimitUse]:
        """Certificate of each pair of bodies over a stretch; its time is ``s - low``."""

        def passed(time: Array) -> Samples:
            still = np.zeros((time.size, line.size))
            return Samples(time, pose + np.outer(low + time, line), still + line, still, still)

        straight = np.zeros(line.size)
        return [use for limit in self.limits for use in enclose(limit, passed, high - low, straight).uses(limit)]

    def nearest(self, pose: Array, line: Array) -> str:
        """Pair that is too near, or nearest to it, where s is zero."""
        room = self._decided(pose, line, np.zeros(1), 0.0)[2]
        return self._labels[int(room[0])]

    def _decided(
        self, pose: Array, line: Array, middle: Array, half: float
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.intp]]:
        """Intervals of a line that keep all distances, those that violate one throughout, and the least distance."""
        room = self._room(pose, line, middle)
        spread = [_spread(limit, pose, line, middle, half) for limit in self.limits]
        slack = np.hstack([*spread, np.zeros((middle.size, 1))])
        return np.all(room >= slack, axis=1), np.any(room < -slack, axis=1), room.argmin(axis=1)

    def _room(self, pose: Array, line: Array, middle: Array) -> Array:
        """Margins of all distances in poses of a line, with a last column of infinity, shape (N, k)."""
        samples = Samples.at_rest(pose + np.outer(middle, line))
        values = [(limit, limit.values(samples)) for limit in self.limits]
        kept = [np.minimum(g - limit.lower, limit.upper - g) - _MARGIN * limit.scale for limit, g in values]
        return np.hstack([*kept, np.full((middle.size, 1), np.inf)])


def _spread(limit: NonlinearConstraint, pose: Array, line: Array, middle: Array, half: float) -> Array:
    """Bound on the change of functions within intervals of a line from their middle, shape (N, k)."""
    q = pose + np.outer(middle, line)
    still, along = np.zeros_like(q), np.broadcast_to(line, q.shape)
    reach = half * np.abs(line)
    low, high = ([np.ascontiguousarray(x.T) for x in (q + side * reach, along, still, still)] for side in (-1, 1))
    slow, fast = limit.rate(low, high)
    return np.asarray(half * np.maximum(np.abs(slow), np.abs(fast)).T)


def _joined(pose: Array, ends: list[tuple[float, float, str]]) -> list[Place]:
    """Neighbouring free intervals as one."""
    groups = [list(group) for _, group in itertools.groupby(ends, key=lambda end: end[2] == "")]
    joined = []
    for k, group in enumerate(groups):
        if group[0][2] == "":
            below = groups[k - 1][-1][2] if k > 0 else ""
            above = groups[k + 1][0][2] if k + 1 < len(groups) else ""
            joined.append(Place(pose, group[0][0], group[-1][1], SUBTRACTED, below, above))
    return joined
