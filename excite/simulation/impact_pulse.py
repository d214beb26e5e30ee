"""Impacts: short torques from outside on a joint, which no drive makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from regressors.arguments import checked
from regressors.errors import UnknownName
from regressors.quantities import check
from regressors.robot.robot import Robot
from regressors.samples import Array


@checked
@dataclass(frozen=True)
class ImpactPulse:
    """Half a sine of torque on one joint, ``torque sin(pi (t - time) / duration)``, from outside the robot.

    Its impulse is ``2 torque duration / pi``; divided by the inertia that the joint sees it is the jump of velocity.

    Parameters
    ----------
    joint : str
    time : float
        Begin [s].
    torque : float
        Peak, with its sign [Nm or N].
    duration : float
        [s]

    Raises
    ------
    InputError
        A number that is not finite, or a duration that is not above zero.
    """

    joint: str
    time: float
    torque: float
    duration: float = 0.01

    def __post_init__(self) -> None:
        for name in ("time", "torque", "duration"):
            check(f"impact_{name}", getattr(self, name), f"`impact` on {self.joint}: the {name}")

    def at(self, time: Array) -> Array:
        """Torque at given instants [s], shape (N,) [Nm or N]."""
        s = (time - self.time) / self.duration
        return np.where((s > 0) & (s < 1), self.torque * np.sin(np.pi * s), 0.0)


@dataclass(frozen=True, eq=False)
class Impacts:
    """All impacts of a run."""

    robot: Robot  # the moving robot
    pulses: Sequence[ImpactPulse]
    wait: float = 0.0  # time before the motion, by which all are later [s]

    def __post_init__(self) -> None:
        for pulse in self.pulses:
            if pulse.joint not in self.robot.joint_names:
                raise UnknownName("moving joint for an impact", pulse.joint, self.robot.joint_names)

    def at(self, time: Array) -> Array:
        """Joint torques at given instants [s], shape (N, n) [Nm or N]."""
        torques = np.zeros((time.size, self.robot.n))
        for pulse in self.pulses:
            torques[:, self.robot.joint_names.index(pulse.joint)] += pulse.at(time - self.wait)
        return torques
