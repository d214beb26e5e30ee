"""The model that an identification result stands for, as bodies, drives and parameters that files can hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from excite.export.models.model_drives import ModelDrive
from excite.export.models.model_feature import Feature
from excite.information.target import IdentificationTarget
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True)
class IdentifiedParameter:
    """One base parameter of a result."""

    name: str
    expression: str
    unit: str
    value: float  # as used for predictions
    deviation: float | None  # standard deviation; None where it is not known
    interval: tuple[float, float] | None  # 99 % confidence interval


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """An identified robot.

    Parameters
    ----------
    robot : Robot
        The whole robot, with the identified bodies and drives in the place of the described ones.
    described : Robot
        As its description says.
    target : IdentificationTarget
        The moving robot, with the model at single instants.
    coefficients : ndarray, shape (b,)
        Base parameters.
    standard : mapping of str to float
        Standard parameters of the moving robot that stand for them, see
        `excite.export.models.nearest_bodies.nearest_bodies`.
    composites : mapping of str to ndarray of shape (10,)
        Parameters of each moving body with all that moves with it, by the name of the link.
    carriers : tuple of (int or None, ndarray of shape (4, 4))
        Of every body of the robot: the one that it moved with, and its pose in that one's frame
        (`regressors.robot.locked_joints.carriers`).
    drives : tuple of ModelDrive
    parameters : tuple of IdentifiedParameter
    features : tuple of Feature
    change : float
        Relative change of the predicted torques by the bodies' physical consistency, over random states.
    sha256 : str or None
        Hash of ``result.json``; None for a result that was not saved.
    program : str
        Name and version of this program.
    training_error : float or None
    notes : tuple of str
    """

    robot: Robot
    described: Robot
    target: IdentificationTarget
    coefficients: Array
    standard: Mapping[str, float]
    composites: Mapping[str, Array]
    carriers: tuple[tuple[int | None, Array], ...]
    drives: tuple[ModelDrive, ...]
    parameters: tuple[IdentifiedParameter, ...]
    features: tuple[Feature, ...]
    change: float
    sha256: str | None
    program: str
    training_error: float | None
    notes: tuple[str, ...]

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the joints that moved, from base to tip."""
        return self.target.robot.joint_names

    def joint_drives(self, joint: int) -> tuple[ModelDrive, ...]:
        """Drives that move one joint of the robot and no other.

        Parameters
        ----------
        joint : int
            Index in the robot.
        """
        return tuple(drive for drive in self.drives if drive.joint == joint)

    def armature(self, joint: int) -> float | None:
        """Rotor inertia at a joint, ``(ratio factor)^2 Ia`` [kg m^2 or kg]; None where none is known."""
        known = [d.factor**2 * d.reflected for d in self.joint_drives(joint) if d.reflected is not None]
        return sum(known) if known else None

    def damping(self, joint: int) -> float | None:
        """Viscous friction at a joint [Nm s/rad or N s/m]; None where none is known."""
        known = [d.factor**2 * d.viscous for d in self.joint_drives(joint) if d.viscous is not None]
        return sum(known) if known else None

    def friction(self, joint: int) -> float | None:
        """Coulomb friction at a joint [Nm or N]; None where none is known."""
        known = [abs(d.factor) * d.coulomb for d in self.joint_drives(joint) if d.coulomb is not None]
        return sum(known) if known else None
