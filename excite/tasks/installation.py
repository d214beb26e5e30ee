"""How the robot is mounted and what it carries, where that is not what its description says, and the body it holds.

The command line's help is made from the class, so what takes long to import is imported where it is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydantic import BaseModel, ConfigDict, create_model

from excite.tasks.option import MOUNTS, option, strict
from excite.tasks.stored_files import UnopenedFile
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.load import LOAD_PARAMETERS, LoadModel, Sensor
from regressors.quantities import check
from regressors.readers.documents import Load, read_document, validate
from regressors.robot.inertia import PARAMETERS_PER_LINK, pseudo_inertia, transport
from regressors.robot.robot import Link, Robot
from regressors.samples import Array, Samples

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from regressors.robot.robot import Robot


Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Installation:
    """The robot as mounted and as equipped.

    Parameters
    ----------
    gravity : tuple of float, optional
        Gravity in the axes of the base [m/s^2]; that of the description if not given.
    mount : {"floor", "wall", "ceiling"} or tuple of float, optional
        Roll, pitch and yaw of the base [rad]: with ``R = Rz(yaw) Ry(pitch) Rx(roll)``, gravity becomes ``R' g``, where
        g is that of the description. A wall is a pitch of 90 degrees, a ceiling a roll of 180 degrees.
    payload : tuple of float or path, optional
        What the last link carries, in that link's frame: mass [kg], centre of mass x, y, z [m], and, where it is no
        point, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass [kg m^2]; or a file with the keys of a load, m,
        mcx ... Izz about the frame's origin. It becomes a part of that link.

    Raises
    ------
    InputError
        Both gravity and a mount, or a payload that no body has.
    """

    gravity: Triple | None = option(
        None, "triple", "Gravity in the axes of the base, such as 0,0,-9.81.", metavar="X,Y,Z"
    )
    mount: str | Triple | None = option(
        None,
        "mount",
        "How the base is mounted: floor, wall (pitch of 90 degrees), ceiling (roll of 180), or its roll, pitch, yaw "
        "[rad].",
        metavar="wall|ceiling|R,P,Y",
    )
    payload: tuple[float, ...] | str | UnopenedFile | None = option(
        None,
        "payload",
        "Payload of the last link, in its frame: mass [kg], centre of mass [m], then, if it is not a point mass, the "
        "inertia about its centre [kg m^2]; or the YAML file of a load.",
        metavar="M,X,Y,Z[,IXX,IXY,IXZ,IYY,IYZ,IZZ]|FILE",
    )

    def __post_init__(self) -> None:
        strict(self)
        if self.gravity is not None and self.mount is not None:
            raise InputError("`gravity` and `mount` both set the direction of gravity; give one of them")
        if self.gravity is not None and (len(self.gravity) != 3):
            raise InputError(f"gravity needs three finite numbers, given {_shown(self.gravity)}")
        if isinstance(self.payload, str):
            object.__setattr__(self, "payload", _payload_of(self.payload))
        if isinstance(self.payload, tuple):
            _check_payload(self.payload)

    @property
    def described(self) -> bool:
        """True if the robot is as its description says."""
        return self.gravity is None and self.mount is None and self.payload is None

    @property
    def notes(self) -> tuple[str, ...]:
        """What it changes, in words."""
        if not isinstance(self.payload, tuple):
            return ()
        return (f"the payload of {self.payload[0]:g} kg is a part of the last link, in its parameters too",)

    def applied(self, robot: Robot) -> Robot:
        """The robot as installed; of a last link without inertial parameters nothing becomes known.

        Parameters
        ----------
        robot : Robot
            As its description says.
        """
        import numpy as np

        from regressors.robot.inertia import rotation_from_rpy
        from regressors.robot.robot import Link

        if isinstance(self.payload, UnopenedFile):
            raise self.payload.missing()

        if self.gravity is not None:
            robot = robot.replace(gravity=np.array(self.gravity))
        if self.mount is not None:
            angles = MOUNTS[self.mount] if isinstance(self.mount, str) else self.mount
            g = float(np.linalg.norm(robot.gravity))
            turned = rotation_from_rpy(angles).T @ robot.gravity
            robot = robot.replace(gravity=np.where(np.abs(turned) < 1e-15 * g, 0.0, turned))
        if isinstance(self.payload, tuple) and (last := robot.links[-1]).theta is not None:
            theta = last.theta + payload_parameters(self.payload)
            robot = robot.replace(links=(*robot.links[:-1], Link(last.name, theta, last.number)))
        return robot


def _payload_of(file: str) -> tuple[float, ...]:
    """Mass, centre of mass and inertia about it, from a file of a load."""
    from pathlib import Path

    import numpy as np

    from regressors.robot.inertia import inertia_tensor, skew

    theta = read_load(Path(file)).parameters
    centre = theta[1:4] / theta[0]
    tensor = inertia_tensor(theta) + theta[0] * skew(centre) @ skew(centre)
    return (float(theta[0]), *map(float, centre), *map(float, tensor[np.triu_indices(3)]))


def payload_parameters(payload: tuple[float, ...]) -> NDArray[np.float64]:
    """Ten inertial parameters of a payload about the origin of the frame that it is given in."""
    import numpy as np

    from regressors.robot.inertia import from_centre_of_mass

    xx, xy, xz, yy, yz, zz = payload[4:] or (0.0,) * 6
    return from_centre_of_mass(payload[0], payload[1:4], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def _check_payload(payload: tuple[float, ...]) -> None:
    import numpy as np

    from regressors.robot.inertia import pseudo_inertia

    if len(payload) not in (4, 10):
        raise InputError(
            "payload needs a mass and its centre x, y, z, or these and Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre; "
            f"given {_shown(payload)}"
        )
    least = np.linalg.eigvalsh(pseudo_inertia(payload_parameters(payload)))[0]
    if payload[0] <= 0 or least < -1e-9 * max(map(abs, payload)):
        raise InputError(
            f"payload: no body has a mass of {payload[0]:g} kg and an inertia of {_shown(payload[4:]) or 'zero'}; "
            "give a mass greater than zero, and principal moments of which none exceeds the sum of the others"
        )


def _shown(numbers: tuple[float, ...]) -> str:
    return ", ".join(f"{x:g}" for x in numbers)


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
