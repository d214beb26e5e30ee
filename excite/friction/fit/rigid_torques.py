"""Friction-free torques of a robot, from described or identified parameters: gravity and inertia."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from excite.identification.identification import Identification
from excite.information.target import target_of
from excite.registry import name_of
from regressors.errors import InputError
from regressors.models.columns import ROTOR, Terms
from regressors.models.differential import DifferentialModel
from regressors.models.drives import drive_column
from regressors.models.nominal import standard_values
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class RigidModel:
    """Joint torques of a motion without friction, ``D(q, dq, ddq) X`` of [KD96] eq. (21)."""

    joints: tuple[str, ...]  # joints of the model; the others rest
    source: str  # where its parameters are from
    torque: Callable[[Samples], Array]  # (N, n) from `Samples` of these joints to torques, shape (N, n) [Nm or N]


def described_model(robot: Robot) -> RigidModel:
    """Model with the parameters of the robot's description."""
    known = standard_values(robot)
    drives = () if robot.transmission is None else robot.transmission.drives
    rotor = bool(drives) and all(
        drive_column(k, ROTOR).name in known or drive.rests for k, drive in enumerate(drives, 1)
    )
    model = DifferentialModel(robot, replace(Terms.inertial_only(), rotor=rotor))
    definition, names = model.definition()
    needed = np.any(definition != 0.0, axis=0)
    missing = [name for name, wanted in zip(names, needed, strict=True) if wanted and name not in known]
    if missing:
        raise InputError(
            f"gravity is to be subtracted, but the description of {robot.name} does not state "
            f"{', '.join(missing[:6])}{' ...' if len(missing) > 6 else ''}: give `parameters`, the result of "
            "`identify`; or record runs over the same path in both directions and give `gravity='symmetric'`; or give "
            "the `plan` of `plan_friction` about a pose in which gravity cancels"
        )
    values = definition @ np.array([known.get(name, 0.0) for name in names])
    source = f"described parameters of {robot.name}" + ("" if rotor else ", without rotors")
    return RigidModel(robot.joint_names, source, lambda s: (model.instants(s) @ values).reshape(-1, robot.n))


def identified_model(result: Identification, robot: Robot) -> RigidModel:
    """Model with the parameters of a result, its friction left out."""
    if result.robot.sha256() != robot.sha256():
        raise InputError(f"{result.name} is a result for {result.robot.name}, not for {robot.name} as given here")
    target = target_of(result.robot, result.task, 0.0, instantaneous=True)
    model, base = target.model, target.base
    if not model.rows_are_joint_torques:
        name = name_of(result.task.model.model)
        raise InputError(f"{result.name}: a result of the {name} model does not give the torques of every joint")
    columns = np.array([column.group == "friction" for column in model.columns])
    of_friction = columns[base.index]
    if np.any(base.D[np.ix_(~of_friction, columns)]):
        raise InputError(f"{result.name}: friction cannot be separated from its other parameters")
    values = np.where(of_friction, 0.0, result.coefficients)

    def torque(samples: Samples) -> Array:
        return np.asarray((model.instants(samples)[:, base.index] @ values).reshape(-1, target.robot.n))

    return RigidModel(target.robot.joint_names, f"parameters identified in {result.name}", torque)
