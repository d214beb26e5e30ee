"""Limits as objects, stated before it is known which joints move."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace

from constraints.nonlinear import NonlinearConstraint
from regressors.models.partial import PartialMotion
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot


class Limit(ABC):
    """One kind of limit, beside those of joints and drives that the robot's description states.

    A limit of your own is a subclass with `imposed`, given in ``constraints=[...]``.

    Attributes
    ----------
    friction : FrictionCurves or None
        Friction curves that the limit takes into account, if any.
    """

    friction: FrictionCurves | None = None

    @abstractmethod
    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """The constraints that a robot's motion must keep.

        Parameters
        ----------
        robot : Robot
            The whole robot.
        motion : PartialMotion
            Map from the coordinates that may move to all joints of the robot, ``q = N s + q0``.

        Returns
        -------
        sequence of NonlinearConstraint
            Functions of the coordinates that may move: those of all joints, `restricted` to the motion.

        Raises
        ------
        InputError
            An invalid limit, or one that needs data missing from the robot's description.
        """

    def knowing(self, friction: FrictionCurves | None) -> Limit:
        """The limit with friction known beforehand, where it has a field for it and none was given."""
        takes = is_dataclass(self) and any(each.name == "friction" for each in fields(self))
        return replace(self, friction=friction) if takes and self.friction is None else self  # type: ignore[type-var]
