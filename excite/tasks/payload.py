"""A rigid body that the robot holds, and its file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, create_model

from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.load import LOAD_PARAMETERS, LoadModel, Sensor
from regressors.quantities import check
from regressors.readers.documents import read_document, validate
from regressors.readers.sized_numbers import Load
from regressors.robot.inertia import PARAMETERS_PER_LINK, pseudo_inertia, transport
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
    try:
        return Payload([values[name] for name in LOAD_PARAMETERS])
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
