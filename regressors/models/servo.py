"""Position-controlled servos: how far a joint stays behind its command, linear in what the drive is.

A servo holds its joint by a stiffness K, and its torque moves the arm, its own inertia J and friction:

    ``K (u - q) - D dq = tau + J ddq + F sign(dq) + K b``

with the command u, the torque tau that the described arm needs, damping D, and an offset b. Divided by K it is linear
in five unknowns a drive, all but the first of which are known without any mass:

    ``u - q = [tau, dq, ddq, sign(dq), 1] [1/K, D/K, J/K, F/K, b]'``
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.differential import inertial_torque
from regressors.models.drives import sign
from regressors.models.model import RegressorModel
from regressors.robot.columns import Column
from regressors.robot.plausibility import described_bodies
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_COLUMNS = (  # symbol, unit, that of a prismatic joint, and kind
    ("a", "rad/Nm", "m/N", "compliance"),
    ("T", "s", "s", "time constant"),
    ("w", "s^2", "s^2", "inertia over stiffness"),
    ("s", "rad", "m", "friction over stiffness"),
    ("b", "rad", "m", "servo offset"),
)
UNKNOWNS = len(_COLUMNS)
SCALED = "and known masses set the scale of a servo's stiffness"


@checked
class ServoModel(RegressorModel):
    """How far joints stay behind their commands, per compliance, time constant, inertia, friction and offset.

    Parameters
    ----------
    robot : Robot
        One drive for each joint; its bodies are known.
    sign_width : float
        Velocity over which the sign of friction changes [rad/s]; zero for the exact sign.

    Raises
    ------
    InputError
        A body whose inertia is not known, or drives that are coupled.
    """

    channel = "command"
    keeps_all_links = True
    equations_can_be_chosen = False

    def __init__(self, robot: Robot, *, sign_width: float = 0.0) -> None:
        if robot.transmission is not None and not np.array_equal(robot.transmission.coupling, np.eye(robot.n)):
            raise InputError(f"robot {robot.name!r}: its drives are coupled; the model servo has one drive to a joint")
        self.robot, self.sign_width = robot, sign_width
        self._theta = described_bodies(robot, SCALED)
        linear = [joint.kind == "prismatic" for joint in robot.joints]
        self.row_labels = tuple((j.name, "m" if one else "rad") for j, one in zip(robot.joints, linear, strict=True))
        self.columns = tuple(
            Column(f"{symbol}{k}", units[one], kind, k)
            for k, one in enumerate(linear, 1)
            for symbol, *units, kind in _COLUMNS
        )

    @property
    def options(self) -> dict[str, Any]:
        """Sign width."""
        return {"sign_width": self.sign_width}

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """How far the joints stay behind; `measured` are the commanded positions, shape (N, n) [rad or m]."""
        return np.asarray(measured - samples.q, dtype=float).reshape(-1)

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Shape (n, 5 n) [rad or m, per unit parameter]."""
        tau = inertial_torque(self.robot, self._theta, q, dq, ddq)
        direction = sign(dq, self.sign_width)
        each = (ca.horzcat(tau[k], dq[k], ddq[k], direction[k], 1) for k in range(self.robot.n))
        return ca.diagcat(*each)
