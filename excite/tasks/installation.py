"""How the robot is mounted and what it carries, where that is not what its description says.

The command line's help is made from the class, so what takes long to import is imported where it is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from excite.tasks.option import option, strict
from excite.tasks.stored_files import UnopenedFile
from regressors.errors import InputError

if TYPE_CHECKING:  # what describes options must be imported in no time
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
    locked_drives : tuple of str, optional
        Names or numbers of drives that hold still, such as by a brake, while joints behind a coupling move: their own
        joints then follow, as the hand of a parallelogram keeps its direction. Where joints of a model are locked
        instead, see `ModelChoice`, the links behind them are one body, as [KD96] takes forearm and wrist, and the
        drives behind the coupling turn along.
    moving_base : bool
        The base moves as a log says: six joints carry it, see `regressors.robot.moving_base`. A mapping with `base`
        implies it. Gravity is then along -z of the frame that poses are stated in.

    Raises
    ------
    InputError
        Both gravity and a mount, or a payload that no body has.
    """

    gravity: Triple | None = option(None, "triple", "Gravity in the axes of the base, such as 0,0,-9.81.")
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
    locked_drives: tuple[str, ...] | None = option(
        None, "names", "Drives that hold still; behind a coupling their joints follow the others.", metavar="4,5"
    )

    moving_base: bool = option(False, "flag", "The base moves, as a log says.", hidden=True, late=True)

    def __post_init__(self) -> None:
        strict(self)
        if self.moving_base and self.mount is not None:
            raise InputError("`mount` is for a base that stands still; leave it out where the log has a moving base")
        if self.gravity is not None and self.mount is not None:
            raise InputError("`gravity` and `mount` both set the direction of gravity; give one of them")
        if isinstance(self.payload, str | tuple):
            from excite.tasks.payload import checked_payload

            object.__setattr__(self, "payload", checked_payload(self.payload))

    @property
    def described(self) -> bool:
        """True if the robot is as its description says."""
        return self == Installation()

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
        if self.described:
            return robot
        from excite.tasks.payload import installed

        if isinstance(self.payload, UnopenedFile):
            raise self.payload.missing()
        return installed(robot, self)
