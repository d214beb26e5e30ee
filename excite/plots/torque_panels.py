"""Torques of a design over time with their limits, for the figure of its motion."""

from __future__ import annotations

from dataclasses import dataclass

from constraints.bounds.certificate import LimitUse
from constraints.nonlinear import NonlinearConstraint
from excite.design.design import Design
from excite.design.imposed_limits import nonlinear_limits
from excite.design.stated_limits import StatedWorld, stated_limits
from regressors.samples import Array, Samples

_TORQUE = " torque"


@dataclass(frozen=True, eq=False)
class LimitedTorque:
    """Torque of a joint or a drive over the whole motion."""

    name: str  # of the joint, or ``drive NAME``
    unit: str
    values: Array  # (N,) without Coulomb friction [Nm or N]
    allowed: tuple[float, float]  # limits, less the reserve and Coulomb friction [Nm or N]
    use: LimitUse  # use of the limit by the exciting motion


def limited_torques(design: Design, motion: Samples) -> list[LimitedTorque]:
    """Every limited torque of a design; none where its torques are not checked."""
    uses = {use.label: use for use in design.limits if use.label.endswith(_TORQUE)}
    joints = design.robot.joint_names if design.approach_and_return is not None else design.moving.joint_names
    index = [design.robot.joint_names.index(name) for name in joints]
    samples = Samples(motion.time, *(x[:, index] for x in (motion.q, motion.dq, motion.ddq, motion.dddq)))
    torques = []
    for limit in _constraints(design, joints) if uses else ():
        if not any(label in uses for label in limit.labels):
            continue
        values = limit.shown(limit.values(samples))
        for k, label in enumerate(limit.labels):
            if label in uses:
                allowed = float(limit.lower[k]), float(limit.upper[k])
                name = label.removesuffix(_TORQUE).removeprefix("joint ")
                torques.append(LimitedTorque(name, limit.units[k], values[:, k], allowed, uses[label]))
    return torques


def _constraints(design: Design, joints: tuple[str, ...]) -> tuple[NonlinearConstraint, ...]:
    """Nonlinear limits as functions of some joints: of all, where approach and return move them."""
    if design.approach_and_return is None:
        return design.nonlinear
    stated = stated_limits(design.robot, joints, design.task, StatedWorld(design.shape))
    return (*nonlinear_limits(design.robot, joints, design.task), *stated.constraints)
