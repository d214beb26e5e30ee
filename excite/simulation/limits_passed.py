"""Limits that a simulated motion passes, and torques that were cut off at theirs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from excite.logs.saturation import Saturation, saturation_of
from excite.simulation.control import TorqueLimits
from regressors.robot.robot import Limits, Robot
from regressors.samples import Array, Samples

# Motions of irp6, panda and ur10e that were followed as intended passed their limits by less: PD of 5 Hz, and models of
# the controller that are 30 % off.
BEYOND_POSITION = 0.01  # of the range that the limits allow: 0.007
BEYOND_VELOCITY = 0.05  # of the limit: 0.021
_ROUNDING = 1e-6  # of a limit that a motion may touch


@dataclass(frozen=True)
class LimitExcess:
    """A limit that the simulated motion passed."""

    quantity: str
    label: str  # such as ``joint q2`` or ``drive z2``
    unit: str
    limit: float  # [unit]
    excess: float  # by how much it was passed at most [unit]
    relative: float  # the excess over the range that the limits allow a position, else over the limit

    @property
    def fails(self) -> bool:
        """True beyond 1 % of a position's range, and 5 % of a velocity; torques count where they are limited."""
        tolerance = {"position": BEYOND_POSITION, "velocity": BEYOND_VELOCITY}.get(self.quantity, np.inf)
        return self.relative > tolerance

    def __str__(self) -> str:
        """One clause."""
        return (
            f"the {self.quantity} of {self.label} passes its limit of {self.limit:.4g} {self.unit} by "
            f"{self.excess:.3g} {self.unit} ({100 * self.relative:.2g} %)"
        )


def exceeded_limits(robot: Robot, samples: Samples) -> tuple[LimitExcess, ...]:
    """Limits of positions and velocities, of joints and of drives, that a motion passes."""
    units = [joint.unit for joint in robot.joints]
    joints = [f"joint {name}" for name in robot.joint_names]
    found = [*_passed(robot.limits, joints, units, samples.q, samples.dq)]
    transmission = robot.transmission
    if transmission is not None:
        C = transmission.coupling
        drives = [f"drive {drive.name}" for drive in transmission.drives]
        of_drives = ["m" if prismatic else "rad" for prismatic in _moves_straight(robot)]
        found += _passed(
            transmission.limits, drives, of_drives, samples.q @ C.T + transmission.offset, samples.dq @ C.T
        )
    return tuple(found)


def _moves_straight(robot: Robot) -> list[bool]:
    """Whether each drive moves a prismatic joint."""
    prismatic = np.array([joint.kind == "prismatic" for joint in robot.joints])
    return [] if robot.transmission is None else [bool(np.any(row[prismatic])) for row in robot.transmission.coupling]


def _torque_units(robot: Robot) -> dict[str, str]:
    """Unit of the torque of every joint and drive, by their labels."""
    straight = {f"joint {joint.name}": joint.kind == "prismatic" for joint in robot.joints}
    if robot.transmission is not None:
        names = (f"drive {drive.name}" for drive in robot.transmission.drives)
        straight |= dict(zip(names, _moves_straight(robot), strict=True))
    return {label: "N" if prismatic else "Nm" for label, prismatic in straight.items()}


def cut_off_torques(robot: Robot, time: Array, command: Array) -> tuple[Saturation, ...]:
    """Torques of joints and drives of which more was asked for than is allowed, and when."""
    # time (N,); command (N, n)
    units = _torque_units(robot)
    return tuple(
        saturation_of(label, bound, units[label], time, size > bound)
        for label, size, bound in _limited(robot, command)
        if np.any(size > bound)
    )


def exceeded_torques(robot: Robot, command: Array) -> tuple[LimitExcess, ...]:
    """Limits that torques pass, where nothing cuts them off."""  # command (N, n)
    units = _torque_units(robot)
    return tuple(
        LimitExcess("torque", label, units[label], bound, float(size.max()) - bound, float(size.max()) / bound - 1)
        for label, size, bound in _limited(robot, command)
        if np.any(size > bound)
    )


def _limited(robot: Robot, command: Array) -> Iterator[tuple[str, Array, float]]:
    """Label, magnitude and limit of every limited torque."""
    labels, torques, bounds = TorqueLimits(robot).of(command)
    yield from zip(labels, np.abs(torques).T, bounds.tolist(), strict=True)


def _passed(limits: Limits, labels: list[str], units: list[str], q: Array, dq: Array) -> Iterator[LimitExcess]:
    """Limits of positions and velocities that columns of a motion pass."""
    for k, (label, unit) in enumerate(zip(labels, units, strict=True)):
        lower, upper = float(limits.lower[k]), float(limits.upper[k])
        span = upper - lower if np.isfinite(upper - lower) else float(np.ptp(q[:, k]))
        for limit, excess in ((upper, q[:, k].max() - upper), (lower, lower - q[:, k].min())):
            if excess > _ROUNDING * span:
                yield LimitExcess("position", label, unit, limit, float(excess), float(excess / span))
        fastest, limit = float(np.abs(dq[:, k]).max()), float(limits.velocity[k])
        if fastest > (1 + _ROUNDING) * limit:
            yield LimitExcess("velocity", label, f"{unit}/s", limit, fastest - limit, fastest / limit - 1)
