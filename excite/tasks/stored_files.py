"""Files that results name: a result holds their content, so none of them is opened.

A file of results comes from anywhere; a path in it would let it read whatever its reader may read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from regressors.arguments import checked
from regressors.errors import InputError, listed_names

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from constraints.geometry import World
    from regressors.robot.robot import Robot
    from regressors.samples import Array


class Named:
    """What is shown as its name."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class UnopenedFile(Named):
    """A file that a result names without its content."""

    option: str  # such as ``world``
    name: str

    def missing(self) -> InputError:
        """What to say where its content is needed."""
        name = ascii(self.name if len(self.name) <= 60 else f"{self.name[:57]}...")
        return InputError(
            f"{self.option} is only named in this file of results ({name}), and files that results name "
            f"are not opened: where the result is loaded, give `{self.option}`"
        )


@dataclass(frozen=True, eq=False)
class StoredRobot:
    """A robot whose file a result names, with the description and the shape that the result holds."""

    name: str  # of its file
    robot: Robot  # the whole robot, as mounted and as equipped
    shape: World | None = None  # for the check of self-collision


@dataclass(frozen=True, eq=False)
class InitialDesign(Named):
    """The design that a search began with, as its result holds it."""

    name: str  # of its folder
    trajectory: Mapping[str, Any]  # entry ``trajectory`` of its ``design.json``
    motion: Any = None  # the motion itself, where the entry alone does not give it: that of a family of the user's own


STATES = ("q", "dq", "ddq")


@checked
@dataclass(frozen=True, eq=False)
class TaskMotion(Named):
    """Instants of a motion.

    Parameters
    ----------
    name : str
        Of its file or folder.
    joints : tuple of str
        Names of the joints that it has.
    q, dq, ddq : ndarray, shape (N, n)
        Position, velocity and acceleration of these joints [rad, rad/s, rad/s^2, or with m].

    Raises
    ------
    InputError
        No instants, shapes that do not match, or values that are not finite.
    """

    name: str
    joints: tuple[str, ...]
    q: Array
    dq: Array
    ddq: Array

    def __post_init__(self) -> None:
        import numpy as np

        for state in STATES:
            values = np.array(getattr(self, state), dtype=float)
            if values.ndim != 2 or values.shape != (len(self.q), len(self.joints)) or not values.size:
                raise InputError(
                    f"task_motion {self.name}: {state} has shape {values.shape}, expected one row per instant with "
                    f"{len(self.joints)} values"
                )
            if not np.all(np.isfinite(values)):
                raise InputError(f"task_motion {self.name}: {state} has values that are not finite")
            object.__setattr__(self, state, values)

    def __repr__(self) -> str:
        """One line."""
        return f"<TaskMotion {self.name}: {len(self.q)} instants of {listed_names(self.joints)}>"

    def __eq__(self, other: object) -> bool:
        """Whether both have the same instants, and come from the same place."""
        return isinstance(other, TaskMotion) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        """Of its name and joints."""
        return hash((self.name, self.joints))

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        states = {state: getattr(self, state).tolist() for state in STATES}
        return {"name": self.name, "joints": list(self.joints), **states}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> TaskMotion:
        """From what `to_dict` returned.

        Raises
        ------
        InputError
            Entries that are missing or of another type.
        """
        try:
            rows = {state: [[float(x) for x in row] for row in content[state]] for state in STATES}
            return cls(str(content["name"]), tuple(map(str, content["joints"])), **rows)  # type: ignore[arg-type]
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                "task_motion: expected a mapping with name, joints, q, dq and ddq, the latter with a list of numbers "
                f"per instant; {error} is missing or wrong"
            ) from error


@checked
@dataclass(frozen=True)
class TaskServos(Named):
    """Identified servos of an arm.

    Parameters
    ----------
    name : str
        Of their folder.
    joints : tuple of str
    values : tuple of tuple of float
        Of each joint, the quantities of `regressors.models.servo_response.QUANTITIES` [SI].
    error : tuple of float
        Root mean square of what they leave of the motion that they were identified from, of each joint [rad or m].

    Raises
    ------
    InputError
        Another number of values than of joints.
    """

    name: str
    joints: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]
    error: tuple[float, ...]

    def __post_init__(self) -> None:
        if not len(self.joints) == len(self.values) == len(self.error):
            raise InputError(f"servos {self.name}: expected values and an error for each of {len(self.joints)} joints")

    def to_dict(self) -> dict[str, Any]:
        """For JSON; servos are made of these entries again."""
        values = [list(each) for each in self.values]
        return {"name": self.name, "joints": list(self.joints), "values": values, "error": list(self.error)}


RESULT, DESIGN = "result", "design"


@dataclass(frozen=True, eq=False, repr=False)
class EarlierInformation(Named):
    """Information of one earlier result, or of one run of a design that is going to be played.

    It is about the combinations ``A u`` of standard parameters u. That of a result is the inverse of the covariance
    that it states; that of a design is ``sum_j F_j' F_j / n_j^2`` over its equations j, with the density n_j of their
    noise: the standard deviation of a row times the root of the time between rows, which does not depend on the rate.

    Parameters
    ----------
    name : str
        Folder, or name of the object.
    kind : {"result", "design"}
    sha256 : str
        Hash of its file, or of the information itself.
    robot, robot_sha256 : str
        Name and hash of the description.
    geometry : str
        Hash of what defines the parameters, see `excite.information.earlier_precision.geometry`.
    payload : str or None
        What the robot carried.
    logs : tuple of str
        Hashes of the logs of a result.
    parameters : tuple of str, length s
        Names of u.
    A : ndarray, shape (b, s)
    factors : tuple of ndarray, shape (k, b)
        Of a result one, R with the information ``R'R``; of a design F_j for each equation.
    equations : tuple of (str, str)
        Name and unit of each equation.
    density : tuple of float, optional
        Density of the noise of each equation, measured by a result or stated by a design [unit times root of s].
    seconds : float
        Duration of the motion, or of the logs [s].
    degrees_of_freedom : int
        Of the noise that a result has estimated, or that one run of a design lets estimate.
    values : ndarray, shape (b,), optional
        Estimate of ``A u`` by a result; NaN where it is not identifiable.
    """

    name: str
    kind: str
    sha256: str
    robot: str
    robot_sha256: str
    geometry: str
    payload: str | None
    logs: tuple[str, ...]
    parameters: tuple[str, ...]
    A: NDArray[np.float64]
    factors: tuple[NDArray[np.float64], ...]
    equations: tuple[tuple[str, str], ...]
    density: tuple[float, ...] | None
    seconds: float
    degrees_of_freedom: int
    values: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        """One line."""
        return f"<EarlierInformation of the {self.kind} {self.name}: {len(self.A)} parameters of {self.robot}>"

    def rows(self, densities: Mapping[str, float]) -> list[NDArray[np.float64]]:
        """Rows R, in parts, with the information ``R'R`` about ``A u``.

        Parameters
        ----------
        densities : mapping of str to float
            Density of the noise of the equations of the model that is designed for, by their names.

        Raises
        ------
        InputError
            The noise of an equation of a design is not known.
        """
        if self.kind == RESULT:
            return list(self.factors)
        names = [name for name, _ in self.equations]
        known = dict(zip(names, self.density or (), strict=False))
        given = densities if all(name in densities for name in names) else known
        if not given:
            raise InputError(
                f"`after`: {self.name} has the equations {', '.join(names)}, whose noise is not known here; "
                "design it with `noise`, or with the model of this task"
            )
        return [F / given[name] for F, name in zip(self.factors, names, strict=True)]
