"""Point-to-point motions: one polynomial of fifth order after the other, each from rest to rest on a straight way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from regressors.samples import Array, Samples

#: Largest derivative of ``10 u^3 - 15 u^4 + 6 u^5`` on [0, 1]: velocity, acceleration, jerk.
PEAKS = {1: 15 / 8, 2: 10 / np.sqrt(3), 3: 60.0}


@dataclass(frozen=True, eq=False)
class Moves:
    """Moves between poses, all joints at once.

    Parameters
    ----------
    poses : ndarray, shape (k + 1, n)
        [rad]
    lengths : ndarray, shape (k,)
        Durations of the moves [s].
    duration : float
        The motion is cut there [s].
    """

    poses: Array
    lengths: Array
    duration: float

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]."""
        ends = np.concatenate([[0.0], np.cumsum(self.lengths)])
        k = np.clip(np.searchsorted(ends, time, side="right") - 1, 0, self.lengths.size - 1)
        T = self.lengths[k]
        u = np.clip((time - ends[k]) / T, 0.0, 1.0)
        shapes = (
            u**3 * (10 - 15 * u + 6 * u**2),
            30 * u**2 * (1 - u) ** 2 / T,
            60 * u * (1 - u) * (1 - 2 * u) / T**2,
            60 * (1 - 6 * u + 6 * u**2) / T**3,
        )
        q, *rates = (shape[:, None] * (self.poses[k + 1] - self.poses[k]) for shape in shapes)
        return Samples(np.asarray(time, dtype=float), self.poses[k] + q, *rates)


def shortest(poses: Array, limits: Sequence[LinearConstraint]) -> Array:
    """Shortest durations of the moves between poses, shape (k,) [s]; exact, since each way is straight."""
    ways = np.diff(poses, axis=0)
    lengths = np.zeros(len(ways))
    for limit in limits:
        if limit.derivative:
            size = np.abs(ways @ limit.matrix.T) / np.minimum(limit.upper, -limit.lower)
            each = (PEAKS[limit.derivative] * size) ** (1 / limit.derivative)
            lengths = np.maximum(lengths, each.max(axis=1))
    return lengths


def inside(pose: Array, limits: Sequence[LinearConstraint]) -> bool:
    """True if a pose keeps the position limits; the straight ways between such poses keep them too."""
    values = [(limit.matrix @ pose + limit.offset, limit) for limit in limits if limit.derivative == 0]
    return all(bool(np.all((limit.lower <= x) & (x <= limit.upper))) for x, limit in values)


def random_moves(limits: Sequence[LinearConstraint], duration: float, rng: np.random.Generator) -> Moves:
    """As many moves between random poses as the limits allow in some time; then as slow as to last just that long.

    Parameters
    ----------
    limits : sequence of LinearConstraint
    duration : float
        [s]
    rng : numpy.random.Generator
    """
    box = next(limit for limit in limits if limit.derivative == 0)
    poses: list[Array] = []
    lengths = np.zeros(0)
    while True:
        pose = rng.uniform(box.lower, box.upper)
        if not inside(pose, limits):
            continue
        poses.append(pose)
        longer = shortest(np.array(poses), limits)
        if longer.sum() > duration:
            return Moves(np.array(poses[:-1]), lengths * duration / lengths.sum(), duration)
        lengths = longer
