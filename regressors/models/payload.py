"""The payload model: joint torques that a body held by the last link adds to those of the robot, in ten parameters."""

from __future__ import annotations

import casadi as ca

from regressors.arguments import checked
from regressors.models.load import load_columns
from regressors.models.model import RegressorModel
from regressors.robot.robot import Robot
from regressors.symbolic.body import body_regressor
from regressors.symbolic.kinematics import chain


@checked
class PayloadModel(RegressorModel):
    """Torques of all joints per parameter of a body fixed to the last link, about that link's frame.

    ``tau_j = l_j' F + s_j' N`` with ``[F; N] = K phi`` of the last link's frame [KD96] eq. (8)-(10): the difference of
    the torques with and without the body, for a robot that is known.

    Parameters
    ----------
    robot : Robot
    """

    keeps_all_links = True

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.columns = load_columns()
        units = ("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
        self.row_labels = tuple(zip(robot.joint_names, units, strict=True))

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Torques of the joints, shape (n, 10) [Nm or N, per unit parameter]."""
        *_, last = chain(self.robot, q, dq, ddq)
        force, moment = body_regressor(last.omega, last.domega, last.a)
        rows = [ca.mtimes(linear.T, force) + ca.mtimes(angular.T, moment) for angular, linear in last.axes]
        return ca.vertcat(*rows)
