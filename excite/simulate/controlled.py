"""A robot, its controller and its torque limits as one system of differential equations."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from excite.simulate.control import Controller, TorqueLimits, Wanted
from excite.simulate.plant import Plant


@dataclass(frozen=True, eq=False)
class ControlledRobot:
    """A robot, its controller and its torque limits.

    Parameters
    ----------
    plant : Plant
    controller : Controller
    limits : TorqueLimits or None
        None for drives of any strength.
    """

    plant: Plant
    controller: Controller
    limits: TorqueLimits | None

    def instant(self, width: ca.SX | float, *, saturating: bool = True) -> tuple[list[ca.SX], list[ca.SX]]:
        """Symbols (state, reference) and expressions (rate of the state, effort, command, ddq, least pivot).

        The state is (q, dq, work, loss), the reference (q, dq, ddq).
        """
        n = self.plant.robot.n
        q, dq, energies = ca.SX.sym("q", n), ca.SX.sym("dq", n), ca.SX.sym("energies", 2)
        wanted = Wanted(*(ca.SX.sym(name, n) for name in ("q_d", "dq_d", "ddq_d")))
        command = self.controller.torque(q, dq, wanted, width)
        limited = saturating and self.limits is not None
        effort = self.limits.saturated(command) if limited and self.limits else command
        ddq, least = self.plant.acceleration(q, dq, effort, width)
        power, lost = ca.dot(effort, dq), ca.dot(self.plant.friction_torque(dq, width), dq)
        rate = ca.vertcat(dq, ddq, power, lost)
        symbols = [ca.vertcat(q, dq, energies), ca.vertcat(wanted.q, wanted.dq, wanted.ddq)]
        return symbols, ca.cse([rate, effort, command, ddq, least])

    def fastest_rate(self) -> ca.Function:
        """Jacobian of the motion's rate with respect to (q, dq) as a function of (state, reference, width)."""
        width, n = ca.SX.sym("width"), self.plant.robot.n
        (state, reference), (rate, *_) = self.instant(width, saturating=False)
        jacobian = ca.jacobian(rate[: 2 * n], state)[:, : 2 * n]
        return ca.Function("jacobian", [state, reference, width], [ca.densify(jacobian)])
