"""Doubt where the mass matrix of an estimate is not positive definite in every allowed pose."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.stats

from excite.identification.mass_matrix import mass_matrix_regressor
from excite.identification.plausibility.doubt import Doubt
from excite.identification.plausibility.residual_causes import NoisyDerivatives
from excite.information.target import IdentificationTarget
from regressors.robot.robot import Robot
from regressors.samples import Array

POSES = 256  # a power of two, for Sobol's sequence
_CORNERS = 128
_CONFIDENCE = 0.99
_ROUNDING = 1e-9  # of the largest eigenvalue


@dataclass(frozen=True, eq=False)
class LeastInertia:
    """The direction and pose in which an estimated robot has the least inertia."""

    value: float  # ``v' M(q) v`` [kg m^2, or with kg m and kg]
    # half of its 99 % interval [the same unit]; infinite where it is not known. Since direction and pose are the
    # worst of all, it is that of all linear functions of the parameters at once, ``sqrt(chi2(b)) s`` [Scheffe 1953]
    half_width: float
    joint: str  # the coordinate that takes the largest part in v
    pose: Array  # (n,) [rad or m]
    positive: bool  # M is positive definite in every pose that was tried


def allowed_poses(robot: Robot, travelled: Array, seed: int = 0) -> Array:
    """Poses within the limits of the joints: quasi-random ones, the middle, and corners.

    A revolute joint is tried over at most one turn about the middle of its range. One without a limit is tried over a
    whole turn about the poses of the log, a prismatic one as far as it travelled.
    """  # travelled (N, n)
    low, high = robot.limits.lower.copy(), robot.limits.upper.copy()
    bounded = np.isfinite(low) & np.isfinite(high)
    low, high = np.where(bounded, low, travelled.min(axis=0)), np.where(bounded, high, travelled.max(axis=0))
    middle = (low + high) / 2
    turning = np.array([joint.unit == "rad" for joint in robot.joints])
    half = np.where(turning, np.where(bounded, np.minimum((high - low) / 2, np.pi), np.pi), (high - low) / 2)
    spread = 2 * scipy.stats.qmc.Sobol(robot.n, rng=np.random.default_rng(seed)).random(POSES) - 1
    corners = np.array(list(product((-1.0, 1.0), repeat=min(robot.n, 12))))
    corners = np.pad(corners, ((0, 0), (0, robot.n - corners.shape[1])))[:: max(1, len(corners) // _CORNERS)]
    return np.asarray(middle + half * np.vstack([spread, corners, np.zeros(robot.n)]))


def least_inertia(
    target: IdentificationTarget, coefficients: Array, covariance: Array, poses: Array
) -> LeastInertia | None:
    """The least inertia of an estimated robot over some poses.

    Coordinates are scaled by their own mean inertia, so that radians and metres, shoulder and wrist, compare.
    """  # coefficients (b,); covariance (b, b); poses (N, n)
    K = mass_matrix_regressor(target, poses)
    if K is None:
        return None
    M = K @ coefficients
    scale = np.sqrt(np.abs(M[:, np.arange(M.shape[1]), np.arange(M.shape[1])]).mean(axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh((M + M.swapaxes(1, 2)) / 2 / np.outer(scale, scale))
    worst = int(np.argmin(values[:, 0]))
    v = vectors[worst, :, 0]
    joint = int(np.argmax(np.abs(v)))
    direction = v / scale / np.abs(v[joint] / scale[joint])  # of unit size in the coordinate that it is named after
    k = np.einsum("i,ijb,j->b", direction, K[worst], direction)
    variance = float(k @ np.where(np.isfinite(covariance), covariance, 0.0) @ k)
    known = np.all(np.isfinite(np.diag(covariance)[k != 0]))
    return LeastInertia(
        float(k @ coefficients),
        float(np.sqrt(max(variance, 0.0) * scipy.stats.chi2.ppf(_CONFIDENCE, len(k)))) if known else np.inf,
        target.motion.labels[joint] if not target.motion.complete else target.robot.joint_names[joint],
        poses[worst],
        bool(values[:, 0].min() > _ROUNDING * np.abs(values).max()),
    )


def mass_matrix_check(least: LeastInertia | None, method: str, noise: NoisyDerivatives) -> Doubt | None:
    """Doubt where the mass matrix is not positive definite, which no real robot has."""
    if least is None or least.positive:
        return None
    what = (
        "the mass matrix is not positive definite, which no robot has: in the pose "
        f"({', '.join(f'{x:.2f}' for x in least.pose)}) the inertia along {least.joint} is {least.value:.3g}"
    )
    half = least.half_width
    if not np.isfinite(half):
        return Doubt(what, "the data do not determine it", _more_data(method))
    if least.value + half > 0:
        return Doubt(what, f"the data determine it only to +- {half:.2g}", _more_data(method))
    if noise.cause is not None:
        return Doubt(what, *noise.cause)
    return Doubt(
        what,
        f"that is beyond its 99 % interval of +- {half:.2g}, so the equations are not those of this robot",
        "check the units, the signs and the order of the joints in the mapping, whether the positions are filtered "
        "enough (`cutoff`), and whether the drives have rotors that the model leaves out (`joint_rotors=True`)",
    )


def _more_data(method: str) -> str:
    more = "add a second log or play a designed motion"
    if method == "physical":
        return more
    return f"admit only parameters of real bodies with `estimator='physical'`, or {more}"
