"""Why limits contradict each other, and the smallest relaxation that makes them agree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Samples

_WIDE = 1e9  # [rad or m]; a pose is sought within it of zero, or of the nearer bound


class ContradictionError(InputError):
    """Limits that no motion can keep; the message names them and the smallest relaxation."""


def interior_pose(limits: Sequence[LinearConstraint], n: int) -> Array:
    """Pose as far as possible from all position limits, relative to their ranges; zero where there are none."""
    A, lower, upper = _positions(limits, n)
    if not len(A):
        return np.zeros(n)
    # HiGHS takes 1e20 for infinite
    lower, upper = np.maximum(lower, np.minimum(upper, 0.0) - _WIDE), np.minimum(upper, np.maximum(lower, 0.0) + _WIDE)
    best, room = _most_room(A, lower, upper)
    if room <= 1e-9:
        raise ContradictionError(_explanation(limits, A, lower, upper))
    return np.where(np.any(A != 0.0, axis=0), best, 0.0)


def _most_room(A: Array, lower: Array, upper: Array) -> tuple[Array, float]:
    """Pose with the largest distance t, in half ranges, from every bound; t <= 0 if there is none."""
    middle = _middle(A, lower, upper)
    if middle is not None:
        return middle, 1.0
    best = _least(A, lower, upper, 0.5 * (upper - lower)[:, None], np.array([-1.0]), (None, 1.0))
    return best[:-1], float(best[-1])


def _least(
    A: Array, lower: Array, upper: Array, slack: Array, cost: Array, bounds: tuple[float | None, float | None]
) -> Array:
    """The q and t of least ``cost' t`` with ``lower + slack t <= A q <= upper - slack t`` and t within bounds."""
    n = A.shape[1]
    result = scipy.optimize.linprog(
        np.concatenate([np.zeros(n), cost]),
        A_ub=np.vstack([np.hstack([A, slack]), np.hstack([-A, slack])]),
        b_ub=np.concatenate([upper, -lower]),
        bounds=[(None, None)] * n + [bounds] * len(cost),
        method="highs",
    )
    return np.asarray(result.x)


def _middle(A: Array, lower: Array, upper: Array) -> Array | None:
    """Pose in the middle between the bounds of every row, where there is one, as for bounds on single joints."""
    # without SciPy's optimisers, whose import takes longer than all else here
    wanted = 0.5 * (lower + upper)
    pose: Array = np.linalg.lstsq(A, wanted)[0].astype(float)
    return pose if np.all(np.abs(A @ pose - wanted) <= 1e-12 * (upper - lower)) else None


def _rounded_up(value: float) -> float:
    """Next larger number of four digits, so that the printed value suffices."""
    step = 10.0 ** (np.floor(np.log10(value)) - 3)
    return float((np.floor(value / step + 1e-6) + 1) * step)


def _explanation(limits: Sequence[LinearConstraint], A: Array, lower: Array, upper: Array) -> str:
    """Name an irreducible set of contradicting bounds, found by deletion filtering, and the smallest relaxation."""
    keep = list(range(len(A)))
    for row in tuple(keep):
        fewer = [k for k in keep if k != row]
        if fewer and _most_room(A[fewer], lower[fewer], upper[fewer])[1] <= 1e-9:
            keep = fewer
    shown = [
        bound
        for limit in limits
        if limit.derivative == 0
        for bound in zip(limit.labels, limit.units, limit.lower, limit.upper, strict=True)
    ]
    parts = [f"{label} in [{low:.4g}, {high:.4g}] {unit}" for label, unit, low, high in (shown[k] for k in keep)]
    half = 0.5 * (upper - lower)  # widenings with the least sum, relative to these, that leave a pose
    widening = _least(A, lower, upper, -np.diag(half), np.ones(len(A)), (0.0, None))[A.shape[1] :] * half
    needed = np.flatnonzero(widening > 1e-12)
    cures = [f"{shown[k][0]} by {_rounded_up(widening[k]):.4g} {shown[k][1]}" for k in needed]
    cure = f"; the smallest relaxation widens {' and '.join(cures)}" if cures else "; only a single pose keeps them"
    return f"limits contradict each other: no pose has {' and '.join(parts)}{cure}"


_NOTHING = 1e-4  # of a limit's scale
_REACH, _CLOSE, _LESS = 0.5, 1e-7, 0.999  # of a step at first and at last [rad or m]; what a step leaves at most
_STEPS = 100


def smallest_relaxation(
    nonlinear: Sequence[NonlinearConstraint],
    linear: Sequence[LinearConstraint],
    motion: PartialMotion,
    poses: Array,
    room: float,
) -> tuple[Array, tuple[str, ...]]:
    """Least sum of relaxations, each in its limit's scale, for which a pose at rest keeps all limits.

    ``min sum e`` over poses s and ``e >= 0`` with ``lower + (room - e) scale <= g(s) <= upper - (room - e) scale`` and
    the linear position limits as they are; by sequential linear programming with a trust region, from each of the
    given poses [Fletcher 1987, section 14.4].
    """  # poses (m, k); result (k,)
    sides = _Sides(nonlinear, motion)
    A, lower, upper = _positions(linear, poses.shape[1])
    turns = np.full(poses.shape[1], 4 * np.pi)  # two either way for unbounded coordinates
    rows = np.vstack([np.eye(turns.size), A])
    least, most = (np.clip(np.append(*ends), -_WIDE, _WIDE) for ends in ((-turns, lower), (turns, upper)))
    best, where = np.full(sides.bound.size, np.inf), poses[0]
    for pose in poses:
        lacking, slopes, reach = room - sides.room(pose), sides.slopes(pose), _REACH
        for _ in range(_STEPS):
            if np.all(lacking <= 0.0) or reach < _CLOSE:
                break
            tried = pose + _step(lacking, slopes, rows, least, most, pose, reach)
            further = room - sides.room(tried)
            if np.maximum(further, 0.0).sum() < _LESS * np.maximum(lacking, 0.0).sum():
                pose, lacking, slopes = tried, further, sides.slopes(tried)
            else:
                reach /= 4
        if np.maximum(lacking, 0.0).sum() < best.sum():
            best, where = np.maximum(lacking, 0.0), pose
        if not best.any():
            break
    return where, sides.relaxations(best)


def _step(lacking: Array, slopes: Array, rows: Array, least: Array, most: Array, pose: Array, reach: float) -> Array:
    """Step within reach for which the sum of what is lacking is least, to first order."""
    near = lacking + reach * np.abs(slopes).sum(axis=1) > 0  # others keep their room
    k, J, m = pose.size, slopes[near], int(np.count_nonzero(near))
    result = scipy.optimize.linprog(
        np.append(np.zeros(k), np.ones(m)),
        A_ub=np.block([[-J, -np.eye(m)], [rows, np.zeros((len(rows), m))], [-rows, np.zeros((len(rows), m))]]),
        b_ub=np.concatenate([-lacking[near], most - rows @ pose, rows @ pose - least]),
        bounds=[(-reach, reach)] * k + [(0.0, None)] * m,
        method="highs",
    )
    return np.zeros(k) if result.x is None else np.asarray(result.x[:k])


class _Sides:
    """Distances to both sides of every limit, relative to their scales."""

    def __init__(self, nonlinear: Sequence[NonlinearConstraint], motion: PartialMotion) -> None:
        self._nonlinear, self._motion = nonlinear, motion
        bounds = np.concatenate([np.stack([limit.upper, limit.lower], axis=1).ravel() for limit in nonlinear])
        (finite,) = np.nonzero(np.isfinite(bounds))
        self.bound, self._function, self._sign = bounds[finite], finite // 2, 1.0 - 2.0 * (finite % 2)
        self._scale = np.concatenate([limit.scale for limit in nonlinear])[self._function]

    def _still(self, pose: Array) -> Samples:
        return Samples.at_rest(self._motion.poses(pose)[None])

    def room(self, pose: Array) -> Array:
        """Relative distance to every bound, shape (bounds,)."""
        values = np.concatenate([limit.values(self._still(pose))[0] for limit in self._nonlinear])
        return np.asarray(self._sign * (self.bound - values[self._function]) / self._scale)

    def slopes(self, pose: Array) -> Array:
        """Derivative of the distances, shape (bounds, k)."""
        n, N = self._motion.matrix.shape[0], self._motion.matrix
        slopes = np.concatenate([limit.slopes(self._still(pose))[0][:, :n] @ N for limit in self._nonlinear])
        return np.asarray(-self._sign[:, None] * slopes[self._function] / self._scale[:, None])

    def relaxations(self, e: Array) -> tuple[str, ...]:
        """Bounds that must be relaxed, and by how much outwards, the largest relative to its scale first."""
        named = [text for limit in self._nonlinear for text in zip(limit.labels, limit.units, strict=True)]
        needed = [(*named[self._function[k]], k) for k in np.argsort(-e) if e[k] > _NOTHING]
        return tuple(
            f"{label} beyond {self.bound[k]:.4g} {unit} by {e[k] * self._scale[k]:.3g} {unit}"
            for label, unit, k in needed
        )


def _positions(linear: Sequence[LinearConstraint], n: int) -> tuple[Array, Array, Array]:
    """Position limits as rows of A with their bounds."""
    limits = [limit for limit in linear if limit.derivative == 0]
    A = np.concatenate([np.zeros((0, n)), *(limit.matrix for limit in limits)])
    lower = np.concatenate([np.zeros(0), *(limit.lower - limit.offset for limit in limits)])
    return A, lower, np.concatenate([np.zeros(0), *(limit.upper - limit.offset for limit in limits)])
