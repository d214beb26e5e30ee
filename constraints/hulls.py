"""Ranges of joints in which two links stay apart, by the convex hulls of their shapes.

Capsules around links that are two joints apart often touch in every pose, though the links do not. Where one of them
is, seen from the other, depends on both joints; with it swept over the range of the one, on the other joint alone,
whose range is searched step by step. Convex bodies are apart by d where a direction n has ``min_b n.b - max_a n.a >=
d``: such a direction proves it, however it was found; it is searched for as by Gilbert, Johnson and Keerthi (1988).
Hulls that are not apart are halved, down to small pieces of the meshes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import pairwise, product

import numpy as np
import scipy

from constraints.clearance import link_poses
from constraints.geometry import Part, RangesApart
from regressors.robot.robot import BASE, Robot, finite_ranges, placed_bodies
from regressors.robot.shapes import Capsule
from regressors.samples import Array

_STEPS = 360  # of a turn, or of the range of a prismatic joint
_COARSE, _SWEPT = 10, 11.25  # of them: in a first search, and between places of the swept link
_LEAST_SHARE, _WHOLE = 0.5, 0.999  # of a range, or of a turn: a joint that is narrowed further has too little room
_HALVINGS, _TRIES = 8, 24
_FASTEST = 4.0  # turns of a joint for one of the coordinate that it follows, so that no step is half a turn
_POSES, _FEW = 128, 0.25  # random ones; a share of them that is left to capsules
_ZERO = np.array([0.0, 0.0, 0.0, 1.0])
NEARLY = 0.003  # m: a pair that is hardly farther apart than its clearance leaves a motion no room


def touching_pairs(robot: Robot, parts: Iterable[Part], clearance: float) -> dict[tuple[str, str], float]:
    """Links two joints apart whose capsules touch, or nearly so, and in how much of all poses, if not in few."""
    capsules: dict[str, list[Capsule]] = {}
    for part in parts:
        capsules.setdefault(part.link, []).append(part.capsule)
    poses = link_poses(robot, np.random.default_rng(0).uniform(*finite_ranges(robot), (_POSES, robot.n)))
    found: dict[tuple[str, str], float] = {}
    for other, link in product(capsules, capsules):
        if len(_joints_between(robot, other, link)) == 2 and (link, other) not in found:
            T = np.linalg.inv(poses[other]) @ poses[link]
            pairs = product(capsules[link], capsules[other])
            distance = np.min([_distances(own, its, T, clearance) for own, its in pairs], axis=0)
            found[other, link] = float(np.mean(distance < clearance + NEARLY))
    return {pair: share for pair, share in found.items() if share > _FEW}


def _distances(own: Capsule, other: Capsule, T: Array, tolerance: float) -> Array:
    """Distances of a capsule in many poses from another one, at most too small by two tolerances, shape (N,) [m]."""
    (centres, radius), (others, wide) = own.covering(tolerance), other.covering(tolerance)
    points = centres @ T[:, :3, :3].transpose(0, 2, 1) + T[:, None, :3, 3]
    return np.asarray(np.linalg.norm(points[:, :, None] - others, axis=3).min(axis=(1, 2)) - radius - wide)


def _joints_between(robot: Robot, first: str, last: str) -> list[int]:
    """Coordinates of the joints between two bodies; empty if two of them move together, or one many turns for one."""
    carrier = {
        name: (parent, np.flatnonzero(row).tolist() if np.abs(row).max() <= _FASTEST else [])
        for name, parent, _, row, _ in placed_bodies(robot)
    }

    def way(body: str) -> Iterator[str]:
        while body != BASE:
            yield body
            body = carrier[body][0]

    up, down = list(way(first)), list(way(last))
    bodies = [body for body in up if body not in down] + [body for body in down[::-1] if body not in up]
    joints = [joint for body in bodies for joint in carrier[body][1]]
    return joints if len(set(joints)) == len(bodies) else []


def ranges_apart(
    robot: Robot,
    touching: Mapping[tuple[str, str], float],
    solids: Mapping[str, Sequence[tuple[Array, float]]],
    clearance: float,
) -> tuple[RangesApart, ...]:
    """Ranges of the two joints between the links of each pair in which they keep the clearance, where there are any.

    One range is the joint's own; the other is narrowed as far as needed, but not below half of it, or half a turn, and
    not at all where their capsules leave them apart in half of all poses.
    """
    low, high = finite_ranges(robot)
    found = []
    for pair in (pair for pair in touching if all(link in solids for link in pair)):
        first, last = _joints_between(robot, *pair)
        hulls = [[Hull(facets, radius) for facets, radius in solids[link]] for link in pair]
        best, most = RangesApart(pair, ()), _LEAST_SHARE if touching[pair] > 0.5 else _WHOLE
        for scan, sweep, still, moved in ((first, last, *pair), (last, first, *pair[::-1])):
            if most < 1.0 and low[scan] < high[scan]:
                own = (hulls[pair.index(moved)], hulls[pair.index(still)])
                lower, upper = _longest(robot, (scan, sweep), (moved, still), own, clearance)
                turn = np.inf if robot.joints[scan].kind == "prismatic" else 2 * np.pi
                share = (upper - lower) / min(float(high[scan] - low[scan]), turn)
                if share > most:
                    ranges = {scan: (lower, upper), sweep: (float(low[sweep]), float(high[sweep]))}
                    within = tuple((robot.joint_names[joint], *ranges[joint]) for joint in sorted(ranges))
                    best, most = RangesApart(pair, within), share
        found += [best] if best.within else []
    return tuple(found)


def _longest(
    robot: Robot,
    joints: tuple[int, int],
    links: tuple[str, str],
    hulls: tuple[Sequence[Hull], Sequence[Hull]],
    clearance: float,
) -> tuple[float, float]:
    """The longest range of a joint in which a link that is swept over that of another keeps apart from a still one."""
    low, high = finite_ranges(robot)
    turns = [1.0 if robot.joints[k].kind == "prismatic" else (high[k] - low[k]) / (2 * np.pi) for k in joints]
    (scan, sweep), counts = joints, np.ceil(_STEPS * np.array(turns) / (1.0, _SWEPT)).astype(int) + 1
    edges, places = (np.linspace(low[k], high[k], count) for k, count in zip(joints, counts, strict=True))
    q = np.zeros((edges.size + places.size, robot.n))
    q[:, scan], q[edges.size :, sweep] = [*edges, *np.full(places.size, edges[0])], places
    poses, (moved, still) = link_poses(robot, q), links
    T = np.linalg.inv(poses[still]) @ poses[moved]
    swept = [replace(hull, places=T[edges.size :]) for hull in hulls[0]]
    apart = _search(T[: edges.size] @ np.linalg.inv(T[0]), clearance)
    free = np.zeros(edges.size + 1, dtype=bool)  # each step, between two that are not

    def keep_apart(first: int, end: int) -> bool:
        return all(apart(a, b, first, end) for a, b in product(swept, hulls[1]))

    def mark_free(first: int, end: int) -> None:
        if keep_apart(first, end):
            free[first + 1 : end + 1] = True
        elif end - first > 1:
            mark_free(first, (first + end) // 2)
            mark_free((first + end) // 2, end)

    knots = [*range(0, edges.size - 1, _COARSE), edges.size - 1]
    for ends, kept in zip(pairwise(knots), pairwise([keep_apart(knot, knot) for knot in knots]), strict=True):
        if any(kept):
            mark_free(*ends)
    runs = np.flatnonzero(np.diff(free)).reshape(-1, 2).tolist()
    start, stop = max(runs, key=lambda run: run[1] - run[0], default=(0, 0))
    return float(edges[start]), float(edges[stop])


@dataclass(frozen=True, eq=False)
class Hull:
    """Convex hull of a part of a link, in all places that a joint brings it to."""

    facets: Array  # (F, k, 3) corners, in the link's frame [m]
    radius: float  # of what surrounds them [m]
    # (K, 4, 4) poses of the link, evenly along the joint's range
    places: Array = field(default_factory=lambda: np.eye(4)[None])
    halvings: int = _HALVINGS

    @cached_property
    def points(self) -> Array:
        """Corners, shape (N, 3) [m]."""
        points = self._corners @ self.places[:, :3, :3].transpose(0, 2, 1) + self.places[:, None, :3, 3]
        return points.reshape(-1, 3)

    @cached_property
    def _corners(self) -> Array:
        return _corners(self.facets)

    @cached_property
    def size(self) -> float:
        """Largest extent along an axis [m]."""
        return float(np.ptp(self.points, axis=0).max())

    @cached_property
    def beyond(self) -> float:
        """By how much the body can lie outside: its radius, and the height of the arcs between its places [m]."""
        if len(self.places) == 1:
            return self.radius
        a, b = self.places[:2]
        chord = np.linalg.norm(self._corners @ (b - a)[:3, :3].T + (b - a)[:3, 3], axis=1).max()
        cosine = 0.5 * (np.trace(a[:3, :3].T @ b[:3, :3]) - 1.0)
        return self.radius + float(0.5 * chord * np.tan(np.arccos(np.clip(cosine, -1.0, 1.0)) / 4))

    @cached_property
    def halves(self) -> tuple[Hull, ...]:
        """Its facets on either side of their middle along its longest side; empty where that parts nothing."""
        centres = self.facets.mean(axis=1)
        along = centres[:, np.argmax(np.ptp(self.facets.reshape(-1, 3), axis=0))]
        first = along <= np.median(along)
        if first.all() or not self.halvings:
            return ()
        return tuple(replace(self, facets=self.facets[half], halvings=self.halvings - 1) for half in (first, ~first))


def _corners(points: Array) -> Array:
    """Corners of the convex hull; all points where they lie in a plane."""
    points = points.reshape(-1, 3)
    try:
        return np.asarray(points[scipy.spatial.ConvexHull(points).vertices])
    except (scipy.spatial.QhullError, ValueError):
        return points


def _search(poses: Array, clearance: float) -> Callable[[Hull, Hull, int, int], bool]:
    """Whether a hull keeps the clearance from one that stands still, on the way from one pose to another."""
    last: dict[tuple[Hull, Hull], Array] = {}  # directions in which they were apart
    near: dict[tuple[Hull, Hull], tuple[Hull, Hull]] = {}  # of hulls that were not apart, the parts that were not

    @cache
    def way(hull: Hull, steps: int) -> float:
        D = poses[steps] - poses[0]
        return float(np.linalg.norm(hull.points @ D[:3, :3].T + D[:3, 3], axis=1).max())

    def beside(moved: Hull, still: Hull, first: int, end: int) -> bool:
        least = clearance + moved.beyond + still.beyond + way(moved, end - first)
        n = last.get((moved, still), np.array([0.0, 0.0, 1.0]))
        is_apart, last[moved, still] = _direction(moved.points, still.points, poses[first], least, n)
        return is_apart

    def apart(moved: Hull, still: Hull, first: int, end: int) -> bool:
        if (parts := near.get((moved, still))) is not None and not beside(*parts, first, end):
            return False
        if beside(moved, still, first, end):
            return True
        if not (moved.halves or still.halves):
            return False
        whole = max((hull for hull in (moved, still) if hull.halves), key=lambda hull: hull.size)
        pairs = product(whole.halves, [still]) if whole is moved else product([moved], whole.halves)
        close = next((pair for pair in pairs if not apart(*pair, first, end)), None)
        if close is not None:
            near[moved, still] = near.get(close, close)
        return close is None

    return apart


def _direction(moved: Array, still: Array, pose: Array, least: float, n: Array) -> tuple[bool, Array]:
    """Whether a direction was found in which two sets of points are that far apart, and the last one that was tried."""
    R, p = pose[:3, :3], pose[:3, 3]
    corners = np.zeros((0, 4))  # of the set of differences, whose point nearest to zero is searched for, and 1
    for _ in range(_TRIES):
        corner = still[(still @ n).argmin()] - R @ moved[(moved @ (R.T @ n)).argmax()] - p
        if n @ corner >= least:
            return True, n
        corners = np.vstack([corners, [*corner, 1.0]])
        weights, _ = scipy.optimize.nnls(corners.T, _ZERO)
        *nearest, total = weights @ corners
        distance = np.linalg.norm(nearest) / total
        if distance < least:
            return False, n
        corners, n = corners[weights > 0.0], np.divide(nearest, total * distance)
    return False, n
