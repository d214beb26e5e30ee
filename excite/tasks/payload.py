"""A rigid body that the robot holds, its file, and the robot as it is mounted and equipped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, create_model

from excite.tasks.installation import Installation
from excite.tasks.option import MOUNTS
from regressors.arguments import checked
from regressors.errors import InputError, about
from regressors.models.load import LOAD_PARAMETERS, LoadModel, Sensor
from regressors.quantities import check
from regressors.readers.documents import Load, read_document, validate
from regressors.robot.inertia import (
    PARAMETERS_PER_LINK,
    from_centre_of_mass,
    inertia_tensor,
    pseudo_inertia,
    rotation_from_rpy,
    skew,
    transport,
)
from regressors.robot.locked_joints import with_locked_drives
from regressors.robot.moving_base import with_moving_base
from regressors.robot.robot import Link, Robot
from regressors.samples import Array, Samples


@checked
@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body held behind the force/torque sensor.

    Parameters
    ----------
    phi : sequence of float, shape (10,)
        m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the sensor's origin, in its axes [kg, kg m, kg m^2].

    Raises
    ------
    InputError
        Not ten finite numbers, or not those of a real body: the pseudo-inertia has a negative eigenvalue.
    """

    phi: Sequence[float] | Array

    def __post_init__(self) -> None:
        phi = np.array(self.phi, dtype=float)
        if phi.shape != (PARAMETERS_PER_LINK,) or not np.all(np.isfinite(phi)):
            raise InputError(f"load: expected ten finite numbers, {', '.join(LOAD_PARAMETERS)}; given {phi.tolist()}")
        check("load", phi, "load: each of its numbers")
        least = float(np.linalg.eigvalsh(pseudo_inertia(phi))[0])
        if not phi[0] > 0 or least < -1e-9 * float(np.abs(phi).max()):
            raise InputError(
                f"load: no body has these parameters; its pseudo-inertia must be positive, its mass too "
                f"(smallest eigenvalue {least:.3g}, mass {phi[0]:g} kg)"
            )
        phi.setflags(write=False)
        object.__setattr__(self, "phi", phi)

    @property
    def parameters(self) -> Array:
        """The ten parameters as an array."""
        return np.asarray(self.phi, dtype=float)

    def on(self, robot: Robot, sensor: Sensor) -> Robot:
        """The robot with the load as part of the sensor's link; unknown inertias of that link stay unknown."""
        place = sensor.place(robot)
        carrier = robot.links[place]
        if carrier.theta is None:
            return robot
        theta = carrier.theta + transport(sensor.rotation, sensor.translation) @ self.parameters
        links = (*robot.links[:place], Link(carrier.name, theta, carrier.number), *robot.links[place + 1 :])
        return robot.replace(links=links)

    def wrench(self, robot: Robot, sensor: Sensor, samples: Samples) -> Array:
        """``[F; N] = K phi`` [KD96] eq. (9) at the sensor, in its axes, shape (N, 6) [N, Nm]."""
        return np.asarray(LoadModel(robot, sensor).instants(samples) @ self.parameters).reshape(-1, 6)

    def values(self) -> dict[str, float]:
        """Parameters by name."""
        return dict(zip(LOAD_PARAMETERS, self.parameters.tolist(), strict=True))


_LOAD: type[BaseModel] = create_model(
    "Load",
    __config__=ConfigDict(extra="forbid", allow_inf_nan=False),
    **{name: (Load, ... if name == "m" else 0.0) for name in LOAD_PARAMETERS},  # type: ignore[call-overload]
)


def read_load(path: Path) -> Payload:
    """Read a load file with the keys m, mcx ... Izz; missing ones are zero."""
    values = validate(read_document(path, "load file"), _LOAD).model_dump()
    with about(str(path)):
        return Payload([values[name] for name in LOAD_PARAMETERS])


def installed(robot: Robot, by: Installation) -> Robot:
    """The robot as mounted and as equipped."""
    robot = with_moving_base(robot) if by.moving_base else robot
    if by.gravity is not None:
        robot = robot.replace(gravity=np.array(by.gravity))
    if by.mount is not None:
        angles = MOUNTS[by.mount] if isinstance(by.mount, str) else by.mount
        g = float(np.linalg.norm(robot.gravity))
        turned = rotation_from_rpy(angles).T @ robot.gravity
        robot = robot.replace(gravity=np.where(np.abs(turned) < 1e-15 * g, 0.0, turned))
    if isinstance(by.payload, tuple) and (last := robot.links[robot.last_link("a payload")]).theta is not None:
        theta = last.theta + payload_parameters(by.payload)
        robot = robot.replace(links=(*robot.links[:-1], Link(last.name, theta, last.number)))
    return robot if by.locked_drives is None else with_locked_drives(robot, by.locked_drives)


def payload_parameters(payload: tuple[float, ...]) -> Array:
    """Ten inertial parameters of a payload about the origin of the frame that it is given in."""
    xx, xy, xz, yy, yz, zz = payload[4:] or (0.0,) * 6
    return from_centre_of_mass(payload[0], payload[1:4], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def checked_payload(payload: str | tuple[float, ...]) -> tuple[float, ...]:
    """Mass, centre of mass and inertia about it, from numbers or a file of a load, if there is such a body."""
    if isinstance(payload, str):
        theta = read_load(Path(payload)).parameters
        centre = theta[1:4] / theta[0]
        tensor = inertia_tensor(theta) + theta[0] * skew(centre) @ skew(centre)
        payload = (float(theta[0]), *map(float, centre), *map(float, tensor[np.triu_indices(3)]))
    shown = ", ".join(f"{x:g}" for x in payload)
    if len(payload) not in (4, 10):
        raise InputError(
            "payload needs a mass and its centre x, y, z, or these and Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre; "
            f"given {shown}"
        )
    least = np.linalg.eigvalsh(pseudo_inertia(payload_parameters(payload)))[0]
    if payload[0] <= 0 or least < -1e-9 * max(map(abs, payload)):
        inertia = ", ".join(f"{x:g}" for x in payload[4:]) or "zero"
        raise InputError(
            f"payload: no body has a mass of {payload[0]:g} kg and an inertia of {inertia}; "
            "give a mass greater than zero, and principal moments of which none exceeds the sum of the others"
        )
    return payload
