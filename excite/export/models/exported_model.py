"""From an identification result to the model that files can hold, in numbers that read back to the same bits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np
from numpy.typing import ArrayLike

from excite.export.models.identified_model import IdentifiedModel, IdentifiedParameter
from excite.export.models.model_drives import ModelDrive, with_curve, with_parameters
from excite.export.models.model_feature import features_of
from excite.export.models.nearest_bodies import (
    NearestBodies,
    flat_note,
    held_note,
    nearest_bodies,
    own_part,
    undescribed,
)
from excite.files.result_json import RESULT
from excite.identification.identification import Identification
from excite.identification.torque_target import stated_covariance, torque_target
from excite.information.target import IdentificationTarget
from excite.storage.manifest import sha256_of
from regressors.friction.curves import FrictionCurves
from regressors.models.columns import BODY_KINDS, FRICTION_KINDS, ROTOR
from regressors.models.drives import drive_rows
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import inertia_tensor, parameter_names, skew
from regressors.robot.joint_rotors import with_joint_rotors
from regressors.robot.locked_joints import carriers
from regressors.robot.robot import Drive, Link, Robot, Structure
from regressors.samples import Array

PACKAGE = "excite-trajectories"
_ZERO = 1e-12  # of a body's largest parameter


def model_of_result(result: Identification) -> IdentifiedModel:
    """Bodies and drives that stand for a result, with what has to be known of them."""
    target = torque_target(result)
    bodies = nearest_bodies(target, result.coefficients, stated_covariance(result), result.estimate.standard)
    whole = _whole_robot(result, target, bodies.values)
    kinds = (*BODY_KINDS, ROTOR, *FRICTION_KINDS)
    further = tuple(c.name for c in target.model.standard_columns if c.kind not in kinds)
    return IdentifiedModel(
        robot=whole.robot,
        described=result.robot,
        target=target,
        coefficients=result.coefficients,
        standard=bodies.values,
        composites=whole.composites,
        carriers=whole.rides,
        drives=whole.drives,
        parameters=_parameters(result, target),
        features=features_of(whole.described, whole.drives, bodies.shares, further),
        change=bodies.change,
        sha256=None if result.folder is None else sha256_of(result.folder / RESULT),
        program=f"{PACKAGE} {version(PACKAGE)}",
        training_error=result.training_error,
        notes=(*_on_bodies(bodies, target), *flat_note(whole.composites), *whole.notes, *_on_task(result)),
    )


def model_of_sample(
    model: IdentifiedModel, result: Identification, standard: Mapping[str, float], note: str
) -> IdentifiedModel:
    """Another robot in the place of the identified one, such as one that the posterior allows."""
    target = model.target
    whole = _whole_robot(result, target, standard)
    definition, names = target.model.definition()
    beta = target.base.D @ definition @ np.array([standard[name] for name in names])
    rows = zip(model.parameters, beta.tolist(), strict=True)
    return replace(
        model,
        robot=whole.robot,
        coefficients=beta,
        standard=standard,
        composites=whole.composites,
        drives=whole.drives,
        parameters=tuple(replace(row, value=value, deviation=None, interval=None) for row, value in rows),
        change=0.0,
        training_error=None,
        notes=(note, *whole.notes, *_on_task(result)),
    )


@dataclass(frozen=True, eq=False)
class _WholeRobot:
    """The whole robot with standard parameters of its moving bodies and drives."""

    described: Robot
    robot: Robot
    composites: Mapping[str, Array]
    rides: tuple[tuple[int | None, Array], ...]
    drives: tuple[ModelDrive, ...]
    notes: tuple[str, ...]


def _whole_robot(result: Identification, target: IdentificationTarget, standard: Mapping[str, float]) -> _WholeRobot:
    described = with_joint_rotors(result.robot) if result.task.model.joint_rotors else result.robot
    composites = {
        body.name: np.array([standard[name] for name in parameter_names(number)])
        for number, body in zip(target.robot.body_numbers, target.robot.bodies, strict=True)
    }
    moving = [described.joint_index(name) for name in target.robot.joint_names]
    rides = carriers(result.task.limits.applied(described), moving)
    shared = _shared(described, rides, composites)
    drives, on_drives = _drives(described, target, standard, result.friction or _task_curves(result))
    robot, on_structure = _robot(described, shared.bodies, drives)
    return _WholeRobot(described, robot, composites, rides, drives, (*shared.notes, *on_drives, *on_structure))


def _task_curves(result: Identification) -> FrictionCurves | None:
    known = result.task.known_friction
    return known if isinstance(known, FrictionCurves) else None


def _parameters(result: Identification, target: IdentificationTarget) -> tuple[IdentifiedParameter, ...]:
    estimate = result.estimate
    spread = zip(estimate.deviation.tolist(), estimate.interval.tolist(), strict=True)
    known = [(s, (low, high)) if np.isfinite([s, low, high]).all() else (None, None) for s, (low, high) in spread]
    rows = zip(result.names, target.base.expressions, result.units, result.coefficients.tolist(), known, strict=True)
    return tuple(
        IdentifiedParameter(name, expression, unit, value, *each) for name, expression, unit, value, each in rows
    )


@dataclass(frozen=True, eq=False)
class _Shared:
    bodies: tuple[Array | None, ...]
    notes: tuple[str, ...]


def _shared(robot: Robot, rides: tuple[tuple[int | None, Array], ...], composites: Mapping[str, Array]) -> _Shared:
    """Parameters of every body of the whole robot: those that were held keep theirs, where they can."""
    bodies, notes = [body.theta for body in robot.bodies], []
    for name, theta in composites.items():
        own = next(k for k, body in enumerate(robot.bodies) if body.name == name)
        held = [k for k, (carrier, _) in enumerate(rides) if carrier == own and k != own]
        known = [(k, part) for k in held if (part := bodies[k]) is not None]
        bodies[own], factor = own_part(theta, [(part, rides[k][1]) for k, part in known])
        for k, part in known:
            bodies[k] = factor * part
        if held:
            notes.append(held_note(name, [robot.bodies[k].name for k in held], factor))
    return _Shared(tuple(bodies), tuple(notes))


def _drives(
    described: Robot, target: IdentificationTarget, values: Mapping[str, float], curves: FrictionCurves | None
) -> tuple[tuple[ModelDrive, ...], tuple[str, ...]]:
    """Every drive of the whole robot with its identified, known or described parameters, and notes."""
    moving = target.robot.transmission
    resting = {k for k, drive in enumerate(moving.drives, 1) if drive.rests} if moving is not None else set()
    drives, along, without = [], [], []
    for number, row in drive_rows(described).items():
        drive = _described_drive(described, number, row, target)
        if drive.moved and number not in resting:
            identified = with_parameters(drive, values)
            curve = None if curves is None else curves.curve(drive.name)
            if curve is not None:
                identified = with_curve(identified, curve, _fastest(described, number))
            if _lost(identified, drive):
                without.append(drive.name)
            drive = identified
        elif drive.moved:
            along.append(drive.name)
            drive = replace(drive, rotor_inertia=None if drive.rotor_inertia is None else 0.0, coulomb=0.0, viscous=0.0)
        drives.append(drive)
    return tuple(drives), (*_along_note(along), *_without_note(without))


def _lost(identified: ModelDrive, described: ModelDrive) -> bool:
    """Whether the description states a rotor inertia or friction that the result has not."""
    names = ("rotor_inertia", "coulomb", "viscous")
    return any(getattr(identified, name) is None and getattr(described, name) for name in names)


def _along_note(names: list[str]) -> tuple[str, ...]:
    if not names:
        return ()
    return (f"{', '.join(names)} turned along with other drives, whose rotor inertia and friction contain theirs",)


def _without_note(names: list[str]) -> tuple[str, ...]:
    if not names:
        return ()
    return (
        f"the result does not have all of the rotor inertia and friction that the description states of "
        f"{', '.join(names)}: what it does not have is not written",
    )


def _described_drive(robot: Robot, number: int, row: Array, target: IdentificationTarget) -> ModelDrive:
    moves = [robot.joint_names[k] in target.robot.joint_names for k in range(robot.n)]
    moved = bool(np.any(row[moves]))
    if robot.transmission is None:
        return ModelDrive(number, robot.joint_names[number - 1], row, ConstantRatio(), moved, None, None, None)
    drive = robot.transmission.drives[number - 1]
    rotor = drive.rotor_inertia
    known = rotor if rotor is not None and np.isfinite(rotor) else None
    return ModelDrive(number, drive.name, row, drive.ratio, moved, known, drive.coulomb, drive.viscous)


def _fastest(robot: Robot, number: int) -> float:
    limits = robot.limits if robot.transmission is None else robot.transmission.limits
    return float(limits.velocity[number - 1])


def _robot(
    described: Robot, bodies: tuple[Array | None, ...], drives: tuple[ModelDrive, ...]
) -> tuple[Robot, tuple[str, ...]]:
    links = [Link(body.name, theta, body.number) for body, theta in zip(described.bodies, bodies, strict=True)]
    branches = [replace(b, link=link) for b, link in zip(described.branches, links[described.n :], strict=True)]
    changes: dict[str, object] = {"links": tuple(links[: described.n]), "branches": tuple(branches)}
    if described.transmission is not None:
        own = zip(described.transmission.drives, drives, strict=True)
        identified = tuple(_drive(drive, found) for drive, found in own)
        changes["transmission"] = replace(described.transmission, drives=identified)
    robot = described.replace(**changes)
    structure = _kept_structure(robot)
    notes: tuple[str, ...] = ()
    if structure != robot.structure:
        notes = ("the written bodies do not have all zeros and equalities of the description, which leave them out",)
    return robot.replace(structure=structure), notes


def _drive(drive: Drive, found: ModelDrive) -> Drive:
    return replace(drive, rotor_inertia=found.rotor_inertia, coulomb=found.coulomb, viscous=found.viscous)


def _kept_structure(robot: Robot) -> Structure:
    """Zeros and equalities of the description that the bodies have; the aggregates only where these are all."""
    values: dict[str, float] = {}
    for number, body in zip(robot.body_numbers, robot.bodies, strict=True):
        if body.theta is not None:
            small = _ZERO * float(np.abs(body.theta).max())
            values |= zip(parameter_names(number), np.where(np.abs(body.theta) > small, body.theta, 0.0), strict=True)
    old = robot.structure
    zero = frozenset(name for name in old.zero if values.get(name, 0.0) == 0.0)
    equal = tuple(group for group in old.equal if np.ptp([values.get(name, 0.0) for name in group]) < _ZERO)
    same = zero == old.zero and equal == old.equal
    return Structure(zero, equal, old.aggregates if same else ())


def _on_bodies(bodies: NearestBodies, target: IdentificationTarget) -> tuple[str, ...]:
    prior = undescribed(target.robot)
    notes = []
    if bodies.exact:
        near = "those of the estimate" if bodies.estimated else "those nearest the description"
        notes.append(f"the bodies reproduce the identified base parameters, and are {near}")
    else:
        notes.append(
            "no physically possible bodies have the identified base parameters: the nearest ones are written, which "
            f"change the predicted torques by {100 * bodies.change:.2g} % on random states"
        )
    if prior:
        notes.append(
            f"the description has no inertial parameters of {', '.join(prior)}: what the data does not determine stays "
            "near a body of 1 kg with 0.02 kg m^2 about each axis, centred at the origin of the link's frame"
        )
    return tuple(notes)


def _on_task(result: Identification) -> tuple[str, ...]:
    width = result.recipe.sign_width or result.recipe.breakaway
    if not width:
        return ()
    what = "velocity" if result.recipe.sign_width else "distance"
    return (f"the friction of the result changes its direction over a {what}; what is written does so at standstill",)


def number(value: float) -> str:
    """Shortest text that reads back to the same number; zero without a sign."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: ArrayLike) -> str:
    """Several numbers, separated by spaces."""
    return " ".join(number(value) for value in np.ravel(np.asarray(values, dtype=float)))


def rpy_of(R: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw with ``R = Rz(yaw) Ry(pitch) Rx(roll)``, to rounding accuracy also where pitch is 90 degrees."""
    # R (3, 3)
    yaw = math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll, pitch, yaw


def quaternion_of(R: Array) -> Array:
    """Unit quaternion of a rotation, its real part first, shape (4,)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return np.array([w, x, y, z])


def about_centre(theta: Array) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m], shape (3,), and inertia about it [kg m^2], shape (3, 3), in the axes of the frame.

    ``I_C = I_O + m skew(c)^2``; a body without mass has its centre in the origin.
    """  # theta (10,)
    mass = float(theta[0])
    c = np.asarray(theta[1:4]) / mass if mass else np.zeros(3)
    return mass, c, np.asarray(inertia_tensor(theta) + mass * skew(c) @ skew(c))


def upper(I: Array) -> dict[str, float]:
    """Six elements of a symmetric tensor by the names that URDF gives them."""
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    return {name: float(I[place]) for name, place in places.items()}
