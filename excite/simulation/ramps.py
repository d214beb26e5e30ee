"""Slow torque ramps on one drive at rest, whose position is not controlled until it breaks loose."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from excite.simulation.plant import Plant
from regressors.errors import InputError, UnknownName
from regressors.friction.curves import drives_with_friction
from regressors.robot.robot import Robot
from regressors.samples import Array, Index
from regressors.symbolic.kinematics import sparse

_ROUNDING = 1e-9  # s, by which an instant may precede its sample


@dataclass(frozen=True, eq=False)
class GivenTorque:
    """Prescribed torque of one drive over time; outside the ramps its position is controlled."""

    drive: str  # name of the drive, or of the joint where the robot has no transmission
    time: Array  # (N,) increasing [s]
    torque: Array  # (N,) torque in addition to the compensation of gravity [Nm or N]; linear in between
    number: Index  # (N,) 1, 2, ... in the ramps, 0 between them

    @property
    def count(self) -> int:
        """Number of ramps."""
        return int(self.number.max(initial=0))

    def delayed(self, wait: float) -> GivenTorque:
        """The same ramps after some time of rest [s]."""
        return replace(self, time=self.time - self.time[0] + wait)

    def at(self, time: Array) -> Array:
        """Torques and numbers of ramps at given instants [s], shape (N, 2); zero before and after."""
        k = np.searchsorted(self.time, time + _ROUNDING, side="right") - 1
        here = (k >= 0) & (time <= self.time[-1] + _ROUNDING)
        torques = np.column_stack([np.interp(time, self.time, self.torque), self.number[k]])
        return np.asarray(np.where(here[:, None], torques, 0.0))


@dataclass(frozen=True, eq=False)
class RampedDrive:
    """A drive with prescribed torque until it has moved; then the position controller takes over."""

    model: Plant  # the controller's model, whose gravity is compensated
    drive: str
    catch: float  # distance from the ramp's start at which the controller takes over until the next ramp [rad or m]

    def __post_init__(self) -> None:
        C = self._coupling(self.model.robot)
        if C.shape[0] != C.shape[1] or np.linalg.matrix_rank(C) < C.shape[1]:
            raise InputError(
                f"robot {self.model.robot.name!r}: its joints are not determined by its drives, so torque ramps of "
                f"{self.drive} cannot be separated from the torques of other drives"
            )

    @property
    def row(self) -> Array:
        """Row of C, shape (n,)."""
        return np.asarray(dict(drives_with_friction(self.model.robot))[self.drive])

    def _coupling(self, robot: Robot) -> Array:
        """Rows of C of the moving drives, this one first."""
        rows = dict(drives_with_friction(robot))
        if self.drive not in rows:
            raise UnknownName("drive" if robot.transmission else "joint", self.drive, rows)
        return np.array([rows[self.drive], *(row for name, row in rows.items() if name != self.drive)])

    def command(self, q: ca.SX, command: ca.SX, torque: ca.SX, is_open: ca.SX) -> ca.SX:
        """Joint torques, with gravity plus the ramp at this drive if its loop is open, else the controller's."""
        # q, command (n, 1)
        robot = self.model.robot
        still = ca.SX.zeros(robot.n, 1)
        to_drive = sparse(np.linalg.inv(self._coupling(robot))[:, :1].T)  # tau_z = C^-T tau
        wanted = ca.mtimes(to_drive, self.model.torque(q, still, still)) + torque
        return command + sparse(self.row[:, None]) * (is_open * (wanted - ca.mtimes(to_drive, command)))

    def latch(self) -> ca.Function:
        """Update of the ramp's memory, from (q, previous memory, number of the ramp).

        Three numbers: number of the ramp, the drive's coordinate at its start, and 1 once the controller has taken
        over.
        """
        q, memory, number = ca.SX.sym("q", self.model.robot.n), ca.SX.sym("memory", 3), ca.SX.sym("number")
        z = ca.mtimes(sparse(self.row[None]), q)
        begins = ca.ne(number, memory[0])
        start = ca.if_else(begins, z, memory[1])
        caught = ca.fmax(ca.if_else(begins, 0, memory[2]), ca.fabs(z - start) > self.catch)
        return ca.Function("latch", [q, memory, number], [ca.densify(ca.vertcat(number, start, caught))])


def broken_loose(ramps: GivenTorque, time: Array, z: Array, catch: float) -> list[bool]:
    """Whether each ramp moved its drive by the distance ``catch``."""  # time, z (N,)
    number = ramps.at(time)[:, 1]
    loose = []
    for k in range(1, ramps.count + 1):
        way = z[number == k]
        loose.append(bool(way.size and np.abs(way - way[0]).max() > catch))
    return loose
