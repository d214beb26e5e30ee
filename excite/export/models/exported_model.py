"""From an identification result to the model that files can hold, in numbers that read back to the same bits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from excite.export.models.identified_model import (
    IdentifiedModel,
    IdentifiedParameter,
    ModelDrive,
    features_of,
    with_curve,
    with_parameters,
)
from excite.export.models.nearest_bodies import NearestBodies, flat_note, held_note, nearest_bodies, own_part
from excite.identification.identification import Identification, stated_covariance, torque_target
from excite.identification.result_json import RESULT
from excite.information.target import IdentificationTarget
from excite.storage.manifest import sha256_of
from regressors.models.drives import drive_rows
from regressors.readers.description import known_values
from regressors.robot.columns import BODY_KINDS, FRICTION_KINDS, ROTOR
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.inertia import inertia_tensor, parameter_names, skew
from regressors.robot.locked_joints import carriers, with_joint_rotors
from regressors.robot.robot import Link, Robot, Structure, transmission_of
from regressors.samples import Array

PACKAGE = "excite-trajectories"
_ZERO = 1e-12  # difference of parameters that are equal


def model_of_result(result: Identification) -> IdentifiedModel:
    """Bodies and drives that stand for a result, with what has to be known of them."""
    target = torque_target(result)
    bodies = nearest_bodies(target, result.coefficients, stated_covariance(result), result.estimate.standard)
    described, parts, notes = _whole_robot(result, target, bodies.values)
    kinds = (*BODY_KINDS, ROTOR, *FRICTION_KINDS)
    further = tuple(c.name for c in target.model.standard_columns if c.kind not in kinds)
    return IdentifiedModel(
        **parts,
        described=result.robot,
        target=target,
        coefficients=result.coefficients,
        parameters=_parameters(result, target),
        features=features_of(described, parts["drives"], bodies.shares, further),
        change=bodies.change,
        sha256=None if result.folder is None else sha256_of(result.folder / RESULT),
        program=f"{PACKAGE} {version(PACKAGE)}",
        training_error=result.training_error,
        notes=(*_on_bodies(bodies, target), *flat_note(parts["composites"]), *notes),
    )


def model_of_sample(
    model: IdentifiedModel, result: Identification, standard: Mapping[str, float], note: str
) -> IdentifiedModel:
    """Another robot in the place of the identified one, such as one that the posterior allows."""
    target = model.target
    _, parts, notes = _whole_robot(result, target, standard)
    definition, names = target.model.definition()
    beta = target.base.D @ definition @ np.array([standard[name] for name in names])
    rows = zip(model.parameters, beta.tolist(), strict=True)
    parameters = tuple(replace(row, value=value, deviation=None, interval=None) for row, value in rows)
    own = {"coefficients": beta, "parameters": parameters, "change": 0.0, "training_error": None}
    return replace(model, **parts, **own, notes=(note, *notes))


def _whole_robot(
    result: Identification, target: IdentificationTarget, standard: Mapping[str, float]
) -> tuple[Robot, dict[str, Any], tuple[str, ...]]:
    """The whole robot as described; with standard parameters of its moving bodies and drives, by field; and notes."""
    described = with_joint_rotors(result.robot) if result.task.model.joint_rotors else result.robot
    composites = {
        body.name: np.array([standard[name] for name in parameter_names(number)])
        for number, body in zip(target.robot.body_numbers, target.robot.bodies, strict=True)
    }
    rides = carriers(
        result.task.limits.applied(described), [described.joint_index(name) for name in target.robot.joint_names]
    )
    bodies, on_bodies = _shared(described, rides, composites)
    known = result.task.known_friction
    curves = result.friction or (known if isinstance(known, FrictionCurves) else None)
    drives, on_drives = _drives(described, target, standard, curves)
    robot, on_structure = _robot(described, bodies, drives)
    parts = {"robot": robot, "standard": standard, "composites": composites, "carriers": rides, "drives": drives}
    width = result.recipe.sign_width or result.recipe.breakaway
    what = "velocity" if result.recipe.sign_width else "distance"
    task = f"the friction of the result changes its direction over a {what}; what is written does so at standstill"
    return described, parts, (*on_bodies, *on_drives, *on_structure, *([task] if width else []))


def _parameters(result: Identification, target: IdentificationTarget) -> tuple[IdentifiedParameter, ...]:
    estimate = result.estimate
    spread = zip(estimate.deviation.tolist(), estimate.interval.tolist(), strict=True)
    known = [(s, (low, high)) if np.isfinite([s, low, high]).all() else (None, None) for s, (low, high) in spread]
    rows = zip(result.names, target.base.expressions, result.units, result.coefficients.tolist(), known, strict=True)
    return tuple(
        IdentifiedParameter(name, expression, unit, value, *each) for name, expression, unit, value, each in rows
    )


def _shared(
    robot: Robot, rides: tuple[tuple[int | None, Array], ...], composites: Mapping[str, Array]
) -> tuple[list[Array | None], list[str]]:
    """Parameters of every body of the whole robot, and notes: those that were held keep theirs, where they can."""
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
    return bodies, notes


def _drives(
    described: Robot, target: IdentificationTarget, values: Mapping[str, float], curves: FrictionCurves | None
) -> tuple[tuple[ModelDrive, ...], list[str]]:
    """Every drive of the whole robot with its identified, known or described parameters, and notes."""
    resting = {k for k, drive in enumerate(transmission_of(target.robot).drives, 1) if drive.rests}
    limits = described.limits if described.transmission is None else described.transmission.limits
    drives, along, without = [], [], []
    moves = [name in target.robot.joint_names for name in described.joint_names]
    for number, row in drive_rows(described).items():
        own, moved = transmission_of(described).drives[number - 1], bool(np.any(row[moves]))
        rotor = own.rotor_inertia if own.rotor_inertia is not None and np.isfinite(own.rotor_inertia) else None
        drive = ModelDrive(number, own.name, row, own.ratio, moved, rotor, own.coulomb, own.viscous)
        if drive.moved and number not in resting:
            identified = with_parameters(drive, values)
            if curves is not None and (curve := curves.curve(drive.name)) is not None:
                identified = with_curve(identified, curve, float(limits.velocity[number - 1]))
            names = ("rotor_inertia", "coulomb", "viscous")
            if any(getattr(identified, name) is None and getattr(drive, name) for name in names):
                without.append(drive.name)
            drive = identified
        elif drive.moved and drive.name not in described.base_joints:
            along.append(drive.name)
            drive = replace(drive, rotor_inertia=None if drive.rotor_inertia is None else 0.0, coulomb=0.0, viscous=0.0)
        drives.append(drive)
    notes = []
    if along:
        notes.append(
            f"{', '.join(along)} turned along with other drives, whose rotor inertia and friction contain theirs"
        )
    if without:
        notes.append(
            "the result does not have all of the rotor inertia and friction that the description states of "
            f"{', '.join(without)}: what it does not have is not written"
        )
    return tuple(drives), notes


def _robot(
    described: Robot, bodies: list[Array | None], drives: tuple[ModelDrive, ...]
) -> tuple[Robot, tuple[str, ...]]:
    links = [Link(body.name, theta, body.number) for body, theta in zip(described.bodies, bodies, strict=True)]
    branches = [replace(b, link=link) for b, link in zip(described.branches, links[described.n :], strict=True)]
    changes: dict[str, object] = {"links": tuple(links[: described.n]), "branches": tuple(branches)}
    if described.transmission is not None:
        identified = tuple(
            replace(drive, rotor_inertia=found.rotor_inertia, coulomb=found.coulomb, viscous=found.viscous)
            for drive, found in zip(described.transmission.drives, drives, strict=True)
        )
        changes["transmission"] = replace(described.transmission, drives=identified)
    robot = described.replace(**changes)
    structure = _kept_structure(robot)
    note = "the written bodies do not have all zeros and equalities of the description, which leave them out"
    return robot.replace(structure=structure), () if structure == robot.structure else (note,)


def _kept_structure(robot: Robot) -> Structure:
    """Zeros and equalities of the description that the bodies have; the aggregates only where these are all."""
    values = known_values(zip(robot.body_numbers, robot.bodies, strict=True))
    old = robot.structure
    zero = frozenset(name for name in old.zero if values.get(name, 0.0) == 0.0)
    equal = tuple(group for group in old.equal if np.ptp([values.get(name, 0.0) for name in group]) < _ZERO)
    same = zero == old.zero and equal == old.equal
    return Structure(zero, equal, old.aggregates if same else ())


def _on_bodies(bodies: NearestBodies, target: IdentificationTarget) -> list[str]:
    if bodies.exact:
        near = "those of the estimate" if bodies.estimated else "those nearest the description"
        notes = [f"the bodies reproduce the identified base parameters, and are {near}"]
    else:
        notes = [
            "no physically possible bodies have the identified base parameters: the nearest ones are written, which "
            f"change the predicted torques by {100 * bodies.change:.2g} % on random states"
        ]
    if undescribed := [body.name for body in target.robot.bodies if body.theta is None]:
        notes.append(
            f"the description has no inertial parameters of {', '.join(undescribed)}: what the data does not determine "
            "stays near a body of 1 kg with 0.02 kg m^2 about each axis, centred at the origin of the link's frame"
        )
    return notes


def number(value: float) -> str:
    """Shortest text that reads back to the same number; zero without a sign."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: ArrayLike) -> str:
    """Several numbers, separated by spaces."""
    return " ".join(number(value) for value in np.ravel(np.asarray(values, dtype=float)))


def stated(**values: float | None) -> dict[str, str]:
    """Attributes with the numbers that are known."""
    return {name: number(value) for name, value in values.items() if value is not None}


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
    return np.asarray(scipy.spatial.transform.Rotation.from_matrix(R).as_quat(scalar_first=True))


def about_centre(theta: Array) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m], shape (3,), and ``I_C = I_O + m skew(c)^2`` [kg m^2], in the axes of the frame."""
    mass = float(theta[0])
    c = np.asarray(theta[1:4]) / mass if mass else np.zeros(3)  # theta (10,)
    return mass, c, np.asarray(inertia_tensor(theta) + mass * skew(c) @ skew(c))
