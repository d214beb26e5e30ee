"""The wrench that carries a whole robot: inertial parameters of all bodies, without torques of joints.

A force plate or a six-axis sensor below the base measures the force and moment that the ground exerts on the robot.
With the wrench ``[F_i; N_i] = K_i theta_i`` that moves body i [KD96] eq. (8), (9), and the pose ``R_i, p_i`` of its
frame in that of the base,

    F = sum_i R_i F_i,   N = sum_i R_i N_i + p_i x R_i F_i.

Forces between bodies are internal: friction, transmissions and torques of motors have no part in it. The spin of
rotors, whose reaction on the base is small where gears are high, is left out. The base, and what is fixed to it, adds a
constant, as does the bias of the sensor: take both out before the motion begins, or identify them (`bias`).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.load import Sensor, SensorModel
from regressors.models.reduction import Reduction, reduction_by
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot, Structure
from regressors.robot.symbolic.kinematics import bodies, body_regressor, sparse
from regressors.samples import Array, Samples


@checked
class BaseWrenchModel(SensorModel):
    """Wrench of the ground on a robot, linear in the inertial parameters of its moving bodies.

    Parameters
    ----------
    robot : Robot
        A chain or a tree with a fixed base.
    sensor : Sensor, optional
        Its frame in that of the base, and the components that are used; it names no link.

    Raises
    ------
    InputError
        The sensor is at a link.
    """

    keeps_all_links = False
    bears_robot = True

    def __init__(self, robot: Robot, sensor: Sensor | None = None) -> None:
        if sensor is not None and sensor.link is not None:
            raise InputError(
                f"the base-wrench model has its sensor below the base, given link {sensor.link!r}; leave `sensor` out, "
                "and state its frame in that of the base by `sensor_xyz` and `sensor_rpy`"
            )
        self._measure(robot, sensor if sensor is not None else Sensor())
        mirrored = Structure(mirrored=robot.structure.mirrored)
        self.reduction: Reduction = reduction_by(robot.replace(structure=mirrored), Terms.inertial_only())
        self.columns = self.reduction.columns

    @property
    def options(self) -> dict[str, Any]:
        """Sensor."""
        return {"sensor": self.sensor}

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Selected rows of the wrench, shape (r, p) [N and Nm per unit parameter]."""
        R, t = (sparse(part) for part in (self.sensor.rotation, self.sensor.translation))
        blocks = []
        for body in bodies(self.robot, q, dq, ddq):
            force, moment = body_regressor(body.omega, body.domega, body.a)
            F = ca.mtimes(body.rotation, force)
            N = ca.mtimes(body.rotation, moment) + ca.mtimes(ca.skew(body.origin - t), F)
            blocks.append(ca.vertcat(ca.mtimes(R.T, F), ca.mtimes(R.T, N)))
        return self.reduction.apply(ca.horzcat(*blocks)[self._equations, :])

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """The wrench, selected equations; `measured` has shape (N, 6) or (N, r) [N, Nm]."""
        return self._selected(np.asarray(measured, dtype=float)).reshape(-1)
