"""Parameters that a motion shows in theory only: their torques drown in the noise a hundred times over.

In units of its size s_j (see `base_sizes`) and of the noise, column j of W is ``w_j s_j``. The columns of such a
parameter make the singular values behind a second gap, after the one at the rank; what they cost is its predicted
deviation over its size, ``sqrt(C_jj)`` with ``C = (W' W)^-1``. The worst case for it are changes of the other
parameters by ``C_kj / C_jj``, which take back what a change of its own does to the torques: where they take back
most of it, the parameters move together; where they do not, its own torque is small.

A joint is hardly excited where the known masses and rotors cause less than 2 % of what hides their torque there: of its
friction or of the stated noise, whichever is larger, all as root mean squares over the motion; where neither is known,
of a tenth of its torque limit, which is about what friction takes of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from excite.information.matrix import noise_per_row, noise_text
from excite.information.prior import base_sizes
from excite.information.target import FACTOR, IdentificationTarget, inverse_half
from excite.tasks.objective import Objective
from regressors.errors import percent
from regressors.models.base import Base
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.robot.columns import ROTOR, Column
from regressors.robot.robot import Robot, Structure
from regressors.samples import Array, Samples

_ALONE = 3.0  # a column of which projection leaves this part, or more, is small by itself
_PARTNER = 0.3  # part of a column's length that another one takes back
_NAMED = 4
_HARDLY = 0.02  # of a joint's friction or noise: torque of masses that does not excite it
_OF_SPEED = (("velocity", 1.0), ("acceleration", 1 / 2), ("jerk", 1 / 3), ("torque", 1 / 2))  # powers of their use
_SLOW = 2.0  # times as fast, with half the deviations, is worth a note
_LIKELY_FRICTION = 0.1  # of a joint's torque limit


@dataclass(frozen=True)
class NearlyUnidentifiable:
    """A base parameter whose predicted deviation is beyond `FACTOR` times its size.

    Parameters
    ----------
    name, unit : str
    what : str
        In words, such as ``mass of link arm``.
    deviation : float
        Predicted standard deviation.
    size : float
        As described, or plausible.
    effect : float
        Largest torque (force, work) at that size, over its noise.
    together : tuple of str
        Parameters with which it moves; none where its own effect is small.
    """

    name: str
    unit: str
    what: str
    deviation: float
    size: float
    effect: float
    together: tuple[str, ...]

    @property
    def factor(self) -> float:
        """Predicted deviation over size."""
        return self.deviation / self.size

    @property
    def text(self) -> str:
        """The parameter, by how much it is missed, and why."""
        cause = (
            f"moves together with {', '.join(self.together)}"
            if self.together
            else f"at that size it changes no equation by more than {self.effect:.2g} of the noise"
        )
        times = f"{float(f'{self.factor:.2g}'):,.0f}"
        return f"{self.name} ({self.what}: {times} times its size of {self.size:.2g} {self.unit}; {cause})"


def nearly_unidentifiable(
    target: IdentificationTarget, samples: Samples, noise: Array
) -> tuple[NearlyUnidentifiable, ...]:
    """Base parameters that a motion leaves more uncertain than `FACTOR` times their size, worst first."""  # noise (r,)
    base, size = target.base, base_sizes(target.model, target.base)
    W = target.model.assemble(samples)[:, base.index]
    W = W / np.tile(noise, W.shape[0] // noise.size)[:, None]
    length = np.linalg.norm(W, axis=0)
    half = inverse_half(W)
    deviation = np.linalg.norm(half, axis=1)
    worst = [int(j) for j in np.argsort(-deviation / size) if deviation[j] > FACTOR * size[j]]
    largest = np.abs(W).max(axis=0)
    return tuple(
        NearlyUnidentifiable(
            base.names[j],
            base.units[j],
            _words(base.columns[base.index[j]], target.robot),
            float(deviation[j]),
            float(size[j]),
            float(largest[j] * size[j]),
            _together(base.names, length, half, j),
        )
        for j in worst
    )


def _together(names: tuple[str, ...], length: Array, half: Array, j: int) -> tuple[str, ...]:
    """Parameters whose change takes back what a change of parameter j does."""
    row = half @ half[j]
    moved = np.abs(row / row[j]) * length
    if moved[j] ** 2 * row[j] < _ALONE**2:
        return ()
    moved[j] = 0.0
    return tuple(names[k] for k in np.flatnonzero(moved > _PARTNER * length[j]))


def _words(column: Column, robot: Robot) -> str:
    """What a column describes, with the name of its body or drive."""
    bodies = dict(zip(robot.body_numbers, (f"link {body.name}" for body in robot.bodies), strict=True))
    drives = robot.transmission.drives if robot.transmission is not None else ()
    turning = {number: f"drive {drive.name}" for number, drive in enumerate(drives, 1)} or bodies
    kind = "rotor inertia" if column.kind == "rotor" else column.kind
    if column.group == "inertial":
        owner = bodies.get(column.owner or 0)
    else:
        owner = turning.get(column.owner or 0)
        kind += " friction" if column.group == "friction" else ""
    return f"{kind} of {owner}" if owner else kind


def nearly_unidentifiable_note(
    found: tuple[NearlyUnidentifiable, ...], target: IdentificationTarget, objective: Objective
) -> str | None:
    """What the user must know first: which parameters are hardly seen, why, and what to do; None if there are none."""
    if not found:
        return None
    noise, dropped = noise_text(objective.noise, target.model), objective.nearly_unidentifiable == "drop"
    listed = "; ".join(parameter.text for parameter in found[:_NAMED])
    more = f"; and {', '.join(p.name for p in found[_NAMED:])}" if len(found) > _NAMED else ""
    cause = rounded_angles(target.robot)
    angles = f" Cause: {'; '.join(cause)}, as if an angle had been rounded." if cause else ""
    remedies = ["state angles exactly (pi/2, not 1.5708)"] if cause else []
    remedies.append("move longer or faster" if dropped else "leave them out with `nearly_unidentifiable='drop'`")
    return (
        f"{len(found)} of {target.base.rank} parameters are nearly unidentifiable: for {noise} their predicted "
        f"deviation is more than {FACTOR:g} times their size, and they alone can make the condition number large: "
        f"{listed}{more}.{angles} Remedy: {', or '.join(remedies)}."
    )


def hardly_excited_note(target: IdentificationTarget, samples: Samples, noise: tuple[float, ...] | None) -> str | None:
    """Name the joints at which the known masses hardly cause a torque, with what helps; None if there are none."""
    if not target.model.rows_are_joint_torques:
        return None
    model = DifferentialModel(target.robot.replace(structure=Structure())).restricted(target.motion)
    definition, names = model.definition()
    known = standard_values(target.robot)
    rigid = np.array([column.group == "inertial" or column.kind == ROTOR for column in model.standard_columns])
    value = np.array([known.get(name, 0.0) for name in names])
    stated = np.array([name in known for name in names])
    W = (model.instants(samples) @ definition).reshape(samples.time.size, len(model.row_labels), -1)
    masses, friction = (np.sqrt(np.mean((W[..., part] @ value[part]) ** 2, axis=0)) for part in (rigid, ~rigid))
    unknown = np.any(W[..., rigid & ~stated] != 0.0, axis=(0, 2))
    friction = np.where(np.any(W[..., ~rigid & stated] != 0.0, axis=(0, 2)), friction, np.nan)
    limits = dict(zip(target.robot.joint_names, target.robot.limits.torque, strict=True))
    of_noise = np.full(friction.size, np.nan) if noise is None else noise_per_row(noise, target.model)
    listed = []
    for k, (joint, unit) in enumerate(model.row_labels):
        hides = {
            "its friction": friction[k],
            "the stated noise": of_noise[k],
            "a tenth of its torque limit": _LIKELY_FRICTION * limits.get(joint, np.inf),
        }
        of_what, size = _largest(hides)
        if not unknown[k] and masses[k] < _HARDLY * size:
            listed.append(f"{joint} (they cause {masses[k]:.2g} {unit}, {of_what} is {size:.2g} {unit})")
    if not listed:
        return None
    return (
        f"friction and noise hide the masses behind {'; '.join(listed)}. Remedy: carry a known load off the joint's "
        "axis (`payload`), tilt the robot (`mount`) where gravity does not act on the joint, or move faster or longer."
    )


def slow_motion_note(
    target: IdentificationTarget, samples: Samples, used: Mapping[str, float], period: float
) -> str | None:
    """Note that the same path in less time would tell far more in the same robot time; None where speed is limited.

    Of s times the speed: ``(det W_s' W_s / det W' W)^(-1 / 2b)`` is the mean ratio of the deviations.
    """
    if not used.get("velocity"):  # largest share of each kind of limits
        return None
    faster = min(used[name] ** -power for name, power in _OF_SPEED if used.get(name))
    if faster < _SLOW:
        return None
    sped = replace(samples, time=samples.time / faster, dq=samples.dq * faster, ddq=samples.ddq * faster**2)
    W, W_s = (target.model.assemble(each)[:, target.base.index] for each in (samples, sped))
    own, other = (np.log(np.abs(np.diag(np.linalg.qr(X, mode="r")))) for X in (W, W_s))
    ratio = float(np.exp(np.mean(own - other)))
    if not ratio < 1 / _SLOW:
        return None
    return (
        f"the motion uses at most {percent(used['velocity'])} of the velocity limits: its path in "
        f"{period / faster:.2g} s instead of {period:g} s would make the predicted deviations {ratio:.2g} times as "
        f"large (mean) in the same robot time. Design the motion with `period` {period / faster:.2g} and `criterion` "
        "trace; the condition number does not count this."
    )


def _largest(hides: dict[str, float]) -> tuple[str, float]:
    """What hides a joint's torque most: of friction and noise where either is known, else of its torque limit."""
    *measured, limit = hides.items()
    finite = [(name, size) for name, size in measured if np.isfinite(size)]
    if finite:
        return max(finite, key=lambda each: each[1])
    return limit if np.isfinite(limit[1]) else (limit[0], 0.0)


_EXACT, _MEANT = 1e-9, 2e-3  # rad: rounding of a computer, and the largest error of an angle written by hand, 3.14


def rounded_angles(robot: Robot) -> tuple[str, ...]:
    """Axes that nearly follow the one before, or stand nearly at a right angle to it, in words.

    The first joint's axis is compared with gravity.
    """
    before = robot.gravity / (np.linalg.norm(robot.gravity) or 1.0)
    name = "gravity"
    found = []
    for joint in robot.joints:
        axis = joint.rotation @ joint.axis
        if text := _nearly(before, axis):
            found.append(f"the axis of joint {joint.name} is {text} to {name}")
        before, name = joint.axis, f"that of joint {joint.name}"
    return tuple(found)


def left_out_by_rounding(robot: Robot, base: Base) -> tuple[str, ...]:
    """Note on the parameters that a base leaves out because only rounding shows them; none where there are none."""
    if not base.by_rounding:
        return ()
    cause = "; ".join(rounded_angles(robot)) or "their torques are as small as those of rounded angles and lengths"
    return (
        f"left out of the base parameters: {', '.join(base.by_rounding)}, which exist by rounding only ({cause}); "
        "`nearly_unidentifiable='keep'` keeps them",
    )


def _nearly(a: Array, b: Array) -> str:
    parallel, square = float(np.linalg.norm(np.cross(a, b))), abs(float(a @ b))
    if not np.any(a):
        return ""
    if _EXACT < parallel < _MEANT:
        return f"{parallel:.2g} rad from parallel"
    return f"{square:.2g} rad from a right angle" if _EXACT < square < _MEANT else ""
