"""A robot, its controller and its torque limits as one system of differential equations."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from excite.simulation.control import Controller, TorqueLimits, Wanted
from excite.simulation.direction import Sticking, followed, friction_rows, steepest_direction, sticking_direction
from excite.simulation.plant import Plant
from excite.simulation.ramps import RampedDrive
from regressors.friction.curves import smooth_direction
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class ControlledRobot:
    """A robot, its controller and its torque limits."""

    plant: Plant
    controller: Controller
    limits: TorqueLimits | None  # None for unlimited drives
    ramped: RampedDrive | None = None  # drive with prescribed torque ramps while the others are controlled
    # True if torques from outside act on the joints besides; they follow the reference in the inputs
    struck: bool = False

    def instant(self, width: float, sticking: Sticking | None = None) -> tuple[list[ca.SX], list[ca.SX]]:
        """Symbols (state, reference, memory) and expressions (rate of the state, effort, command, ddq, least pivot).

        The state is (q, dq, work, loss), the reference (q, dq, ddq), torques from outside where there are any, and the
        torque of a ramp. The memory is a position
        of the joints, the directions of friction at that position, and 1 if the loop of the ramped drive is open.
        """
        robot = self.plant.robot
        n = robot.n
        q, dq, energies = ca.SX.sym("q", n), ca.SX.sym("dq", n), ca.SX.sym("energies", 2)
        wanted = Wanted(*(ca.SX.sym(name, n) for name in ("q_d", "dq_d", "ddq_d")))
        torque, is_open, before = ca.SX.sym("torque"), ca.SX.sym("open"), ca.SX.sym("before", n)
        s = ca.SX.sym("s", friction_rows(robot).shape[0])
        if sticking is None:
            direction = smooth_direction(robot, dq, width)
        else:
            direction = sticking_direction(robot, q - before, dq, s, sticking)
        command = self.controller.torque(q, dq, wanted, width)
        if self.ramped is not None:
            command = self.ramped.command(q, command, torque, is_open)
        effort = command if self.limits is None else self.limits.saturated(command)
        outside = ca.SX.sym("outside", n if self.struck else 0)
        acting = effort + outside if self.struck else effort
        ddq, least = self.plant.acceleration(q, dq, acting, direction)
        power = ca.dot(acting, dq)
        lost = ca.dot(acting - self.plant.carried_torque(dq, acting, direction), dq)
        rate = ca.vertcat(dq, ddq, power, lost)
        symbols = [
            ca.vertcat(q, dq, energies),
            ca.vertcat(wanted.q, wanted.dq, wanted.ddq, outside, torque),
            ca.vertcat(before, s, is_open),
        ]
        return symbols, ca.cse([rate, effort, command, ddq, least])

    def turned(self, sticking: Sticking | None) -> ca.Function:
        """Directions of friction after a displacement of the joints; unchanged without presliding."""
        robot = self.plant.robot
        way, s = ca.SX.sym("way", robot.n), ca.SX.sym("s", friction_rows(robot).shape[0])
        after = s if sticking is None else followed(robot, way, s, sticking.distance)
        return ca.Function("turned", [way, s], [after])

    def fastest_rate(self, leads: Array | None = None) -> ca.Function:
        """Jacobian of the motion's rate with respect to (q, dq) as a function of (q, dq, reference, size).

        The size is the velocity over which friction changes sign, or the presliding distance if its lead times per
        square root of distance are given. Torques do not saturate.
        """
        robot = self.plant.robot
        n, size = robot.n, ca.SX.sym("size")
        q, dq = ca.SX.sym("q", n), ca.SX.sym("dq", n)
        before = ca.SX.sym("q_before", n), ca.SX.sym("dq_before", n)
        wanted = Wanted(*(ca.SX.sym(name, n) for name in ("q_d", "dq_d", "ddq_d")))
        if leads is None:
            direction = smooth_direction(robot, dq, size)
        else:
            lead = ca.DM(leads) * ca.sqrt(size)
            direction = steepest_direction(robot, q - before[0], dq - before[1], dq, size, lead)
        tau = self.controller.torque(q, dq, wanted, size)
        rate = ca.vertcat(dq, self.plant.acceleration(q, dq, tau, direction)[0])
        state = ca.vertcat(q, dq)
        jacobian = ca.substitute(ca.jacobian(rate, state), ca.vertcat(*before), state)
        reference = ca.vertcat(wanted.q, wanted.dq, wanted.ddq)
        return ca.Function("jacobian", [state, reference, size], [ca.densify(jacobian)])
