"""Doubt where no bodies and drives have the base parameters, or the mass matrix is not positive definite."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.identification.equations import friction_drives
from excite.identification.estimator import CONFIDENCE, Estimate
from excite.identification.large_residual import Doubt
from excite.information.target import IdentificationTarget
from regressors.models.base import Base
from regressors.models.nominal import parameter_values, standard_values
from regressors.robot.columns import BODY_KINDS, COULOMB, DIRECTED_KINDS, ROTOR, VISCOUS
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.robot.inertia import pseudo_inertia
from regressors.robot.plausibility import implausible_inertias
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_NAMED = 4
_NEGLIGIBLE = 0.01  # of the torques
_ROUNDING = 1e-9
_PARTS = 10


def signs_of_bodies(base: Base) -> Array:
    """Sign that each base parameter has for every possible set of bodies and drives, shape (b,): 1, -1 or 0.

    A base parameter is ``sum_b tr(A_b J_b)`` over the pseudo-inertias J_b of the bodies, which are positive
    semi-definite [Wensing et al. 2018], plus rotor inertias and friction, which are not negative. It has one sign if
    all A_b are semi-definite of that sign; 0 where it may have either.
    """
    owners: dict[object, list[int]] = {}
    for j, column in enumerate(base.columns):
        if column.kind in BODY_KINDS:
            owners.setdefault(column.owner, []).append(j)
    bodies = [columns for columns in owners.values() if len(columns) == _PARTS]
    drives = [j for j, column in enumerate(base.columns) if column.kind in (ROTOR, COULOMB, VISCOUS)]
    placed = {*drives, *(j for columns in bodies for j in columns)}
    free = [j for j in range(len(base.columns)) if j not in placed]
    D = np.where(np.abs(base.D) > _ROUNDING * np.abs(base.D).max(axis=1, keepdims=True), base.D, 0.0)
    eigenvalues = [np.linalg.eigvalsh(_dual(D[:, columns])) for columns in bodies]
    values = np.concatenate([D[:, drives], *eigenvalues], axis=1)
    tolerance = _ROUNDING * np.abs(values).max(axis=1, initial=0.0)
    either = np.any(D[:, free] != 0.0, axis=1) | ~np.any(values != 0.0, axis=1)
    least, most = values.min(axis=1, initial=0.0), values.max(axis=1, initial=0.0)
    sign = np.where(least >= -tolerance, 1.0, np.where(most <= tolerance, -1.0, 0.0))
    return np.where(either, 0.0, sign)


def _dual(c: Array) -> Array:
    """``A`` with ``tr(A J) = c . theta`` for the pseudo-inertia J of every theta, shape (b, 4, 4)."""
    units = np.array([pseudo_inertia(one) for one in np.eye(_PARTS)])  # a basis of the symmetric matrices
    return np.tensordot(np.linalg.solve(np.einsum("kij,lij->kl", units, units), c.T).T, units, axes=1)


def impossible_parameters(
    estimate: Estimate, base: Base, shares: Array, noisy: tuple[str, str] | None, tried: str = ""
) -> Doubt | None:
    """Doubt where the sign of base parameters is beyond their intervals that of no body and no drive.

    The intervals hold for all tested parameters at once with 99 % (Bonferroni). Parameters that make less than 1 % of
    the torques are not tested.
    """  # shares (b,)
    sign = np.where(shares > _NEGLIGIBLE, signs_of_bodies(base), 0.0)
    tested = max(int(np.count_nonzero(sign)), 1)
    half = scipy.special.stdtrit(max(estimate.degrees_of_freedom, 1), 1 - (1 - CONFIDENCE) / (2 * tested))
    half = half * estimate.deviation
    with np.errstate(invalid="ignore"):
        beyond = np.flatnonzero(sign * estimate.values + half < 0)
    if not beyond.size:
        return None
    order = beyond[np.argsort((sign * estimate.values / np.where(half > 0, half, 1.0))[beyond])]
    shown = [
        f"{estimate.names[j]} = {estimate.values[j]:.3g} +- {half[j]:.2g} {estimate.units[j]}" for j in order[:_NAMED]
    ]
    more = f" and {len(order) - _NAMED} more" if len(order) > _NAMED else ""
    kinds = {base.columns[base.index[j]].kind for j in order}
    what = f"no body and no drive has {', '.join(shown)}{more}, whose sign is wrong beyond the 99 % interval"
    cure = "check the signs and units in the mapping"
    if tried != "physical":
        cure += ", or admit only possible parameters with `estimator='physical'`"
    return Doubt(what, *(noisy or (_cause(kinds), cure)))


def _cause(kinds: set[str]) -> str:
    if kinds <= {COULOMB, VISCOUS}:
        return "friction that drives a joint means a torque of the wrong sign, or friction that the model lacks"
    if kinds <= {ROTOR}:
        return "the inertia of the drives takes up what the model lacks, or the accelerations are wrong"
    return "the model lacks something that the torques have, or signs or units are wrong"


def described_coefficients(target: IdentificationTarget) -> Array | None:
    """Base parameters of the described bodies, unknown friction and rotors as zero.

    None where a body is unknown or hardly right, or the equations are no joint torques.
    """
    if target.model.torque_equations() is None or implausible_inertias(target.robot):
        return None
    known, (definition, names) = standard_values(target.robot), target.model.definition()
    if any(column.name not in known for column in target.model.standard_columns if column.kind in BODY_KINDS):
        return None
    return np.asarray(target.base.D @ definition @ np.array([known.get(name, 0.0) for name in names]))


_BEYOND = 100.0  # times the plausible size
_SHARE = 0.01  # of the torque of an equation, which a parameter of plausible size makes at least
_INSTANTS = 2000
_STILL = 1e-3  # of the way of the drive that goes farthest


def beyond_plausible(
    target: IdentificationTarget, estimate: Estimate, motion: Samples, torque: Array
) -> NDArray[np.bool_]:
    """Parameters whose 99 % interval reaches zero and is over 100 times as wide as they can plausibly be, shape (b,).

    A parameter may be as large as it is described, or make 1 % of the torques of all equations with every joint as
    fast as the fastest one of its unit. Nor has the friction of a drive that holds still a value, since noise alone
    gives that a direction.
    """  # torque (r,): root mean square of each equation
    some = motion.rows(np.unique(np.linspace(0, motion.time.size - 1, _INSTANTS).astype(int)))
    units = np.array([joint.unit for joint in target.robot.joints])
    faster = [_as_fast_as_the_fastest(x, units) if target.motion.straight else 1.0 for x in (some.dq, some.ddq)]
    fast = replace(some, dq=some.dq * faster[0], ddq=some.ddq * faster[1])
    rows = target.model.selected(fast, target.base.index).reshape(-1, torque.size, target.base.rank)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.sqrt(np.mean(rows**2, axis=0)) / np.where(torque > 0, torque, np.inf)[:, None]
        plausible = _SHARE / np.linalg.norm(shares, axis=0)
    described = parameter_values(target.model, target.base, standard_values(target.robot))
    plausible = np.fmax(plausible, np.abs(described))
    half = estimate.half_width
    hidden = (half > np.abs(estimate.values)) & (half > _BEYOND * plausible)
    if target.model.coulomb_friction() is not None:
        directed, way = friction_drives(target, some), np.ptp(motion.q @ friction_rows(target.robot).T, axis=0)
        columns = [target.base.columns[j] for j in target.base.index]
        still = {columns[k].owner for k in np.array(directed.columns)[way[[*directed.drives]] < _STILL * way.max()]}
        hidden |= [one.kind in (*DIRECTED_KINDS, VISCOUS) and one.owner in still for one in columns]
    return np.asarray(np.isfinite(half) & hidden)


def _as_fast_as_the_fastest(x: Array, units: NDArray[np.str_]) -> Array:
    """Factor of each column, shape (n,), by which it is as large as the largest one of its unit."""
    size = np.sqrt(np.mean(x**2, axis=0))
    largest = np.array([size[units == unit].max() for unit in units])
    return np.asarray(np.divide(largest, size, out=np.zeros_like(size), where=size > 0))


def inertial_columns(base: Base) -> NDArray[np.bool_]:
    """Which base parameters are those of bodies, shape (b,)."""
    return np.array([base.columns[j].group == "inertial" for j in base.index])


POSES = 256
_CORNERS = 128


def allowed_poses(robot: Robot, travelled: Array, seed: int = 0) -> Array:
    """Poses within the limits of the joints, or about those of a log: quasi-random ones, the middle, and corners."""
    # travelled (N, n)
    low, high = robot.limits.lower.copy(), robot.limits.upper.copy()
    bounded = np.isfinite(low) & np.isfinite(high)
    low, high = np.where(bounded, low, travelled.min(axis=0)), np.where(bounded, high, travelled.max(axis=0))
    middle = (low + high) / 2
    turning = np.array([joint.unit == "rad" for joint in robot.joints])
    half = np.where(turning, np.where(bounded, np.minimum((high - low) / 2, np.pi), np.pi), (high - low) / 2)
    rng = np.random.default_rng(seed)
    strata = rng.permuted(np.tile(np.arange(POSES), (robot.n, 1)), axis=1).T  # a Latin hypercube
    spread = 2 * (strata + rng.random(strata.shape)) / POSES - 1
    corners = np.array(list(product((-1.0, 1.0), repeat=min(robot.n, 12))))
    corners = np.pad(corners, ((0, 0), (0, robot.n - corners.shape[1])))[:: max(1, len(corners) // _CORNERS)]
    return np.asarray(middle + half * np.vstack([spread, corners, np.zeros(robot.n)]))


def negative_inertia(
    target: IdentificationTarget, estimate: Estimate, poses: Array, method: str, noisy: tuple[str, str] | None = None
) -> Doubt | None:
    """Doubt where the mass matrix is not positive definite in some poses; one about inertia where that is left open.

    It names the direction v and the pose of the least inertia ``v' M(q) v``. Coordinates are scaled by their own mean
    inertia, so that radians and metres, shoulder and wrist, compare. Since direction and pose are the worst of all, the
    99 % interval is that of all linear functions of the parameters at once, ``sqrt(chi2(b)) s`` [Scheffe 1953].
    """  # poses (N, n)
    K = mass_matrix_regressor(target, poses)
    if K is None:
        return None
    M, covariance = K @ estimate.coefficients, estimate.covariance
    scale = np.sqrt(np.abs(np.diagonal(M, axis1=1, axis2=2)).mean(axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh((M + M.swapaxes(1, 2)) / 2 / np.outer(scale, scale))
    if values[:, 0].min() > _ROUNDING * np.abs(values).max():
        return None
    worst = int(np.argmin(values[:, 0]))
    v = vectors[worst, :, 0]
    joint = int(np.argmax(np.abs(v)))
    direction = v / scale / np.abs(v[joint] / scale[joint])  # of unit size in the coordinate that it is named after
    k = np.einsum("i,ijb,j->b", direction, K[worst], direction)
    least, half = float(k @ estimate.coefficients), np.inf
    if np.all(np.isfinite(np.diag(covariance)[k != 0])):
        variance = float(k @ np.where(np.isfinite(covariance), covariance, 0.0) @ k)
        half = float(np.sqrt(max(variance, 0.0) * scipy.special.chdtri(len(k), 1 - CONFIDENCE)))
    names = target.robot.joint_names if target.motion.complete else target.motion.labels
    what = (
        "the mass matrix is not positive definite, which no robot has: in the pose "
        f"({', '.join(f'{x:.2f}' for x in poses[worst])}) the inertia along {names[joint]} is {least:.3g}"
    )
    cause, cure = cause_of_negative_inertia(least, half, method, noisy)
    return Doubt(what, cause, cure, about="inertia" if least + half > 0 else "bodies")


def cause_of_negative_inertia(least: float, half: float, method: str, noisy: tuple[str, str] | None) -> tuple[str, str]:
    """Cause and cure, by half of the 99 % interval of the least inertia, infinite where it is not known."""
    if least + half > 0:
        more = "add a second log or play a designed motion"
        if method != "physical":
            more = f"admit only parameters of real bodies with `estimator='physical'`, or {more}"
        known = f"the data determine it only to +- {half:.2g}" if np.isfinite(half) else "the data do not determine it"
        return known, more
    return noisy or (
        f"that is beyond its 99 % interval of +- {half:.2g}, so the equations are not those of this robot",
        "check the units, the signs and the order of the joints in the mapping, whether the positions are filtered "
        "enough (`cutoff`), and whether the drives have rotors that the model leaves out (`joint_rotors=True`)",
    )


def mass_matrix_regressor(target: IdentificationTarget, q: Array) -> Array | None:
    """Regressor of ``M(q)``, linear in the base parameters: ``M_ij = sum_b K_ijb beta_b``.

    Column j of M is what a unit acceleration of moving coordinate j adds to the torques at rest,
    ``M e_j = N' (Y(q, 0, N e_j) - Y(q, 0, 0)) beta``, with ``q = N s + q0``.
    """  # q (N, n)
    equations = target.model.torque_equations()
    if equations is None or equations.unused:
        return None
    N = equations.motion.matrix
    k, count = N.shape[1], len(q)
    q = (q - equations.motion.offset) @ (N @ np.linalg.pinv(N)).T + equations.motion.offset
    accelerations = np.vstack([np.zeros(N.shape[0]), N.T])  # (k + 1, n)
    ddq = np.tile(accelerations, (count, 1))
    still = np.zeros_like(ddq)
    states = Samples(np.arange(len(ddq), dtype=float), np.repeat(q, k + 1, axis=0), still, ddq, still)
    rows = target.model.instants(states)[:, target.base.index].reshape(count, k + 1, k, -1)
    return np.asarray((rows[:, 1:] - rows[:, :1]).swapaxes(1, 2))
