"""Half-widths of confidence intervals as predicted before the measurement.

The interval of an estimate is ``t(level, f) s_j`` to both sides, with ``s_j = sqrt(C_jj) sigma / sigma_0``: C is the
covariance for the stated noise sigma_0, and sigma is estimated from the residuals, ``f sigma^2 / sigma_0^2 ~ chi2(f)``.
The half-width is therefore random itself; with a probability p that of every parameter at once is at most

    h_j = t((1 + level) / 2, f) sqrt(chi2(p, f) / f) sqrt(C_jj)

since one sigma is common to all. This is for noise that is independent from instant to instant.

Error of the torques that identified parameters predict along a stated task motion.

With the covariance C of the parameters, the root mean square error of the torque of a joint i along N instants is
``sqrt(tr(C G_i))``, with ``G_i = Y_i' Y_i / N`` of the rows Y_i of that joint.

Largest half-width that a precision target allows each base parameter.

A parameter is about zero where its described value is below `ABOUT_ZERO` of its size, the root of the summed squares of
the magnitudes of its terms (`excite.information.prior`): a share of such a value asks for what no torque
depends on. Its size stands for its value then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from excite.information.prior import base_sizes, prior_of
from excite.information.target import IdentificationTarget
from excite.tasks.precision_target import PrecisionTarget, TaskTorques
from excite.tasks.stored_files import TaskMotion
from regressors.errors import InputError, check_names
from regressors.robot.columns import COMBINATION, FIRST_MOMENT, FRICTION_KINDS, INERTIA, MASS, ROTOR, Column
from regressors.samples import Array, Samples

LEVEL, PROBABILITY = 0.99, 0.95
OFFSET_SHARE = 0.005  # of the root mean square torque: deviation of the offset that a sensor may have
BIAS_SHARE = 0.02  # of the root mean square force or moment of a wrench
ROWS_PER_DEGREE = 4  # effective rows of an equation, whose spectrum is estimated at the motion's frequencies alone
FEWEST_DEGREES = 3


def residual_degrees_of_freedom(rows: float, parameters: int, equations: int) -> int:
    """Degrees of freedom f of the noise that identification estimates from residuals.

    A quarter of the rows of each equation, less the parameters, at least 3: what `excite.identify` counts for its
    robust covariance, where the spectrum of the noise is estimated too.
    """
    return max(FEWEST_DEGREES, int((rows - parameters) / (ROWS_PER_DEGREE * equations)))


def half_width_factor(degrees_of_freedom: int, *, level: float = LEVEL, probability: float = PROBABILITY) -> float:
    """Half-width over standard deviation that is not exceeded with a probability, ``t sqrt(chi2 / f)``."""
    f = degrees_of_freedom
    t, chi2 = scipy.special.stdtrit(f, 0.5 + 0.5 * level), scipy.special.chdtri(f, 1.0 - probability)
    return float(t * np.sqrt(chi2 / f))


def group_of(kind: str, unit: str) -> str | None:
    """Group in `excite.tasks.precision_target.GROUPS` of a column; None for what belongs to none."""
    if kind in FRICTION_KINDS:
        return "friction"
    if kind in (MASS, FIRST_MOMENT) or (kind == COMBINATION and unit in ("kg", "kg m")):
        return "gravity"
    return "inertia" if kind in (INERTIA, ROTOR, COMBINATION) else None


ABOUT_ZERO = 0.2


def precision_scales(precision: PrecisionTarget, target: IdentificationTarget) -> Array:
    """Value of each base parameter that a share is taken of, shape (b,); NaN where nothing is known of it.

    Its given scale; or the magnitude of its described value; or, where that is about zero, its size.
    """
    base = target.base
    value = np.abs(prior_of(target.model, base, None).base_values(np.eye(base.rank)))
    size = base_sizes(target.model, base)
    scale = np.where(value >= ABOUT_ZERO * size, value, np.where(np.isfinite(size) & (value >= 0), size, np.nan))
    for name, given in precision.scales.items():
        scale[_place(base.names, name)] = given
    return scale


def allowed_half_widths(precision: PrecisionTarget, target: IdentificationTarget) -> Array:
    """Largest half-width of each base parameter, in its unit, shape (b,); infinite where nothing is asked of it."""
    base = target.base
    scale = precision_scales(precision, target)
    share = np.array([_share(precision, base.columns[k]) for k in base.index])
    for name, own in precision.parameters.items():
        share[_place(base.names, name)] = own
    unknown = [name for name in precision.parameters if np.isnan(scale[_place(base.names, name)])]
    if unknown:
        raise InputError(
            f"precision: the description of {target.robot.name!r} states no value of {', '.join(unknown)}; "
            "give one in `scales:`"
        )
    known = np.isfinite(scale)
    allowed = np.where(known, share * np.where(known, scale, 1.0), np.inf)
    if not np.any(np.isfinite(allowed)) and precision.torques is None:
        raise InputError(
            f"precision: it asks nothing of the {base.rank} base parameters, since the description of "
            f"{target.robot.name!r} states no value of those that it names; give values in `scales:`"
        )
    return np.asarray(allowed)


def _share(precision: PrecisionTarget, column: Column) -> float:
    """Share of a column's kind, of its group, or of all; infinite where nothing is asked."""
    for name in (column.kind, group_of(column.kind, column.unit)):
        if name is not None and name in precision.groups:
            return precision.groups[name]
    return np.inf if precision.share is None else precision.share


def _place(names: tuple[str, ...], name: str) -> int:
    check_names("base parameter", [name], names)
    return names.index(name)


@dataclass(frozen=True, eq=False)
class TorquePrecision:
    """Torques along a task motion, and how well they are to be predicted."""

    names: tuple[str, ...]  # of the joints' torques
    units: tuple[str, ...]
    rows: Array  # (r, N, b) Y of every equation, over the root of N
    allowed: Array  # (r,) largest half-width of each root mean square error [Nm or N]

    def deviations(self, half: Array) -> Array:
        """Root mean square error of each torque, for a factor ``C = half half'``, shape (r,)."""
        return np.asarray(np.linalg.norm(self.rows @ half, axis=(1, 2)))

    @property
    def information(self) -> Array:
        """Sum of ``G_i`` over the squared allowed error, shape (b, b)."""
        scaled = (self.rows / self.allowed[:, None, None]).reshape(-1, self.rows.shape[2])
        return np.asarray(scaled.T @ scaled)


def torque_precision(torques: TaskTorques, target: IdentificationTarget) -> TorquePrecision:
    """The torques of a task motion in the base columns of a target.

    Described parameters state the torque that shares are taken of; friction that is not described counts as none.
    """
    motion, names = torques.motion, target.robot.joint_names
    if missing := [name for name in names if name not in motion.joints]:
        raise InputError(f"precision: the task motion does not state {', '.join(missing)}, which move")
    if target.model.window is not None:
        raise InputError(
            "precision: torques along a task motion need a model of single instants, `model='differential'`"
        )
    base, N = target.base, len(motion.q)
    labels, units = zip(*target.model.row_labels, strict=True)
    W = target.model.instants(samples_of(motion, names))[:, base.index]
    Y = W.reshape(N, len(labels), -1).transpose(1, 0, 2) / np.sqrt(N)
    values = np.nan_to_num(prior_of(target.model, base, None).base_values(np.eye(base.rank)))
    size = np.linalg.norm(Y @ values, axis=1)
    if not np.all(size > 0.0):
        still = ", ".join(label for label, each in zip(labels, size, strict=True) if not each > 0.0)
        raise InputError(f"precision: the described torque of {still} is zero along the task motion")
    return TorquePrecision(tuple(f"torque {label}" for label in labels), units, Y, torques.share * size)


def samples_of(motion: TaskMotion, names: Sequence[str]) -> Samples:
    """Some joints of a task motion, in their order."""
    order = [motion.joints.index(name) for name in names]
    q, dq, ddq = (part[:, order] for part in (motion.q, motion.dq, motion.ddq))
    return Samples(np.arange(float(len(q))), q, dq, ddq, np.zeros_like(q))
