"""Positions, velocities and torques of motors, through the robot's own gears and coupling, at its joints.

With the motor angle phi of each drive, its gear ``phi = F(z)`` and the coupling ``z = C q + z0``::

    q = C^-1 (F^-1(phi) - z0),   dq = C^-1 (dphi / F'(z)),   tau_q = C' (F'(z) tau_motor)

Motor angles are zero where the drive coordinates are; another zero is the `offset` of the mapping.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from excite.logs.log import Log
from excite.logs.mapping import LogMapping
from excite.logs.mapping_sections import GearedSection
from regressors.errors import InputError
from regressors.robot.gears import ConstantRatio
from regressors.robot.robot import Drive, Robot
from regressors.samples import Array


def at_the_joints(log: Log, mapping: LogMapping, robot: Robot | None) -> Log:
    """The log with the channels that a mapping describes on the motors' side converted to the joints."""
    sections = mapping.sections
    motor = {name: s for name, s in sections.items() if isinstance(s, GearedSection) and s.side == "motor"}
    if not motor:
        return log
    if robot is None:
        raise InputError("the log mapping has side: motor, but no robot is given whose gears these are")
    index = [robot.joint_index(name) for name in log.joints]
    C, zero = _coupling(robot, index)
    drives = _drives(robot, index)
    for section in motor.values():
        _check_gears(section, drives, robot)
    q, dq, effort = log.q, log.dq, log.effort
    if "q" in motor:
        z = _coordinates(q, drives) if motor["q"].own_gears else q
        q = _at_joints(C, z - zero)
    ratios = _ratios(q @ C.T + zero, drives)
    if "dq" in motor and dq is not None:
        dq = _at_joints(C, dq / ratios if motor["dq"].own_gears else dq)
    if "effort" in motor and effort is not None:
        effort = (effort * ratios if motor["effort"].own_gears else effort) @ C
    return replace(log, q=q, dq=dq, effort=effort)


def _at_joints(C: Array, z: Array) -> Array:
    return np.asarray(np.linalg.solve(C, z.T).T, dtype=float)


def _drives(robot: Robot, index: list[int]) -> list[Drive]:
    """Drives of some joints, of ratio one where the robot has none."""
    if robot.transmission is None:
        return [Drive(robot.joint_names[k]) for k in index]
    return [robot.transmission.drives[k] for k in index]


def _coupling(robot: Robot, index: list[int]) -> tuple[Array, Array]:
    """``C`` and ``z0`` of the drives of some joints."""
    if robot.transmission is None:
        return np.eye(len(index)), np.zeros(len(index))
    C, names = robot.transmission.coupling, robot.joint_names
    if C.shape[0] != robot.n:
        raise InputError(f"{robot.name} has {C.shape[0]} drives for {robot.n} joints; give the log at the joints")
    others = [k for k in range(robot.n) if k not in index]
    for k in index:
        if coupled := [names[j] for j in others if C[k, j] != 0]:
            raise InputError(
                f"drive {robot.transmission.drives[k].name} of {robot.name} also moves with {', '.join(coupled)}; name "
                "it among the joints of the log mapping"
            )
    return C[np.ix_(index, index)], robot.transmission.offset[index]


def _check_gears(section: GearedSection, drives: list[Drive], robot: Robot) -> None:
    without = [drive.name for drive in drives if drive.ratio == ConstantRatio(1.0)]
    if section.own_gears and without:
        raise InputError(
            f"{robot.name} states no gear ratio of {', '.join(without)}; give ratio with side: motor in the log mapping"
        )


def _coordinates(phi: Array, drives: list[Drive]) -> Array:
    return np.column_stack([drive.ratio.coordinate(column) for drive, column in zip(drives, phi.T, strict=True)])


def _ratios(z: Array, drives: list[Drive]) -> Array:
    """``F'(z)`` of each drive, shape (N, n)."""
    symbol = ca.SX.sym("z")
    ratios = [ca.Function("ratio", [symbol], [drive.ratio.ratio(symbol)]) for drive in drives]
    return np.column_stack([np.asarray(f(column[None, :])).ravel() for f, column in zip(ratios, z.T, strict=True)])
