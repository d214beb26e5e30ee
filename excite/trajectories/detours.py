"""Detours around obstacles on a straight line in joint space: intermediate poses joined by collision-free lines.

Two trees of free poses grow from both ends towards random poses and towards each other until they meet (RRT-Connect)
[Kuffner, LaValle 2000]; then unnecessary poses are removed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from regressors.samples import Array, Samples

_SPACING = 0.02  # of the range of a joint: distance between poses that are checked
_REACH = 0.15  # of the ranges: length of an extension of a tree
_TRIALS = 2000
_RESERVE = 0.005  # of a limit's scale, kept in reserve between the poses that are checked
_SHORTCUTS = 60

Free = Callable[[Array, Array], bool]


def detour(
    start: Array,
    end: Array,
    linear: Sequence[LinearConstraint],
    nonlinear: Sequence[NonlinearConstraint],
    lower: Array,
    upper: Array,
    seed: int,
) -> list[Array] | None:
    """Intermediate poses between two poses, so that the lines through them are free at rest."""
    # start, end (n,); lower, upper (n,)
    free = _free(nonlinear, upper - lower)
    if not (free(start, start) and free(end, end)):
        return None
    if free(start, end):
        return []
    rng, range_ = np.random.default_rng(seed), upper - lower
    trees = [_Tree(start, range_, free), _Tree(end, range_, free)]
    for trial in range(_TRIALS):
        target = rng.uniform(lower, upper)
        if not _inside(target, linear):
            continue
        growing, other = trees if trial % 2 == 0 else trees[::-1]
        grown = growing.grown_towards(target)
        if grown is not None and other.connects(growing.poses[grown]):
            path = [*trees[0].path(), *reversed(trees[1].path())]
            return _shortened(path, free, rng)[1:-1]
    return None


def _inside(pose: Array, linear: Sequence[LinearConstraint]) -> bool:
    positions = ((limit, limit.matrix @ pose + limit.offset) for limit in linear if limit.derivative == 0)
    return all(np.all((limit.lower <= value) & (value <= limit.upper)) for limit, value in positions)


def _free(nonlinear: Sequence[NonlinearConstraint], range_: Array) -> Free:
    """Build the check whether all sampled poses on the line between two poses keep the limits at rest."""

    def free(a: Array, b: Array) -> bool:
        count = 2 + int(np.ceil(np.abs((b - a) / range_).max() / _SPACING))
        q = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
        samples = Samples.at_rest(q)
        for limit in nonlinear:
            values, reserve = limit.values(samples), _RESERVE * limit.scale
            if np.any(values > limit.upper - reserve) or np.any(values < limit.lower + reserve):
                return False
        return True

    return free


class _Tree:
    """Free poses, each joined to an earlier one by a free line."""

    def __init__(self, root: Array, range_: Array, free: Free) -> None:
        self.poses, self._parents = [root], [-1]
        self._range, self._free = range_, free
        self._tip = 0

    def grown_towards(self, target: Array) -> int | None:
        """Add a pose nearer to the target and return its index; None if an obstacle blocks it."""
        near = int(np.argmin([np.linalg.norm((pose - target) / self._range) for pose in self.poses]))
        way = target - self.poses[near]
        far = float(np.linalg.norm(way / self._range))
        pose = target if far <= _REACH else self.poses[near] + way * (_REACH / far)
        if not self._free(self.poses[near], pose):
            return None
        self.poses.append(pose)
        self._parents.append(near)
        self._tip = len(self.poses) - 1
        return self._tip

    def connects(self, target: Array) -> bool:
        """Grow until the target is reached (True) or an obstacle blocks it (False)."""
        while True:
            grown = self.grown_towards(target)
            if grown is None:
                return False
            if np.array_equal(self.poses[grown], target):
                return True

    def path(self) -> list[Array]:
        """Path from the root to the pose that was added last."""
        path, k = [], self._tip
        while k >= 0:
            path.append(self.poses[k])
            k = self._parents[k]
        return path[::-1]


def _shortened(path: list[Array], free: Free, rng: np.random.Generator) -> list[Array]:
    """The path without poses that can be skipped."""
    kept = [path[0], *(pose for before, pose in pairwise(path) if not np.array_equal(pose, before))]
    for _ in range(_SHORTCUTS):
        if len(kept) < 3:
            break
        i, j = np.sort(rng.choice(len(kept), 2, replace=False))
        if j - i > 1 and free(kept[i], kept[j]):
            kept = [*kept[: i + 1], *kept[j:]]
    return kept
