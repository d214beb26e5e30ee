"""Torsion springs in the joints: ``tau = Y(q, dq, ddq) theta + diag(q - q_rest) k`` [Siciliano et al. 2009, chapter 9].

Examples are balancing springs at the joints, and cables and hoses that the joints twist. Where the rest pose is not
known, a friction offset (`Terms.offset`) takes up the torque ``-k q_rest`` at q = 0, and ``q_rest`` follows from both.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from regressors.errors import check_names
from regressors.models.differential import DifferentialModel
from regressors.robot.columns import Column, Terms
from regressors.robot.robot import Robot

STIFFNESS = "stiffness"


class SpringModel(DifferentialModel):
    """Joint torques with the stiffness of a linear spring in every joint; it has no JAX form.

    Parameters
    ----------
    robot : Robot
    terms, sign_width, carried
        See `DifferentialModel`.
    rest : mapping of str to float, optional
        Positions, by joint name, at which the springs exert no torque [rad or m]; zero if not given.

    Raises
    ------
    UnknownName
        The rest position of a joint that the robot does not have.
    """

    def __init__(
        self,
        robot: Robot,
        terms: Terms | None = None,
        *,
        sign_width: float = 0.0,
        rest: Mapping[str, float] | None = None,
        carried: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(robot, terms, sign_width=sign_width, carried=carried)
        self.rest = dict(rest or {})
        check_names("joint", self.rest, robot.joint_names)
        units = ("Nm/rad" if joint.kind == "revolute" else "N/m" for joint in robot.joints)
        springs = (Column(f"k{j}", unit, STIFFNESS) for j, unit in zip(robot.link_numbers, units, strict=True))
        self.columns = (*self.columns, *springs)

    @property
    def options(self) -> dict[str, Any]:
        """Terms, sign width and rest positions."""
        return {**super().options, "rest": self.rest}

    def on(self, robot: Robot) -> SpringModel:
        """The same model for another form of the robot, with the springs of the joints that it has."""
        rest = {name: value for name, value in self.rest.items() if name in robot.joint_names}
        return type(self)(robot, **{**self._options_on(robot), "rest": rest})

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Joint torques per parameter, shape (n, p) [Nm per unit parameter]."""
        rest = ca.DM([self.rest.get(name, 0.0) for name in self.robot.joint_names])
        return ca.horzcat(super().rows(q, dq, ddq), ca.diag(q - rest))
