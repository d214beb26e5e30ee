"""Whether a simulated run is the motion that was asked for: saturation, tracking, limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.logs.saturation import Saturation
from excite.simulation.limits_passed import LimitExcess, cut_off_torques, exceeded_limits, exceeded_torques
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

# The largest values over designs of irp6, panda and ur10e that were followed as intended (computed torque with model
# errors up to 30 %, PD of 5 Hz and more, friction that sticks, noise, encoders) stand behind each number.
NOTED_TRACKING = 0.01  # of the range of motion
LOST_TRACKING = 0.05  # of the range of motion: 0.019; runs that saturated and lost it 0.1 to 0.7
SATURATED = 1e-3  # of the samples: none; a torque that only touches its limit saturates in fewer
_LEAST_RANGE = 0.1  # rad or m: a joint that rests or hardly moves is judged as if it moved this far


@dataclass(frozen=True)
class Tracking:
    """How far one joint was from its reference."""

    joint: str
    unit: str
    error: float  # largest ``|q - q_d|`` [unit]
    travel: float  # range of motion in the reference [unit]

    @property
    def relative(self) -> float:
        """The error over the range of motion, or over 0.1 rad or m where that is less."""
        return self.error / max(self.travel, _LEAST_RANGE)


@dataclass(frozen=True)
class SimulationOutcome:
    """Whether the simulated robot did what was asked for.

    Parameters
    ----------
    count : int
        Number of samples.
    saturated : tuple of Saturation
        Torques that were cut off at a limit, where that happened.
    tracking : tuple of Tracking
        One per joint; none of a run in which a drive is pushed by ramps of torque and not held in position.
    exceeded : tuple of LimitExcess
    """

    count: int
    saturated: tuple[Saturation, ...]
    tracking: tuple[Tracking, ...]
    exceeded: tuple[LimitExcess, ...]

    @property
    def holds(self) -> bool:
        """True if no torque saturated, no joint lost its reference, and no limit was passed, within the tolerances."""
        return not self.failures

    @property
    def failures(self) -> tuple[str, ...]:
        """What does not hold, in words."""
        return (
            *(self._saturation_text(one) for one in self.saturated if one.rows > SATURATED * self.count),
            *(_tracking_text(one, LOST_TRACKING) for one in self.tracking if one.relative > LOST_TRACKING),
            *(f"{one}" for one in self.exceeded if one.fails),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What is worth knowing although it holds."""
        astray = [one for one in self.tracking if NOTED_TRACKING < one.relative <= LOST_TRACKING]
        return (
            *(self._saturation_text(one) for one in self.saturated if one.rows <= SATURATED * self.count),
            *(_tracking_text(one, NOTED_TRACKING) for one in astray),
            *(f"{one}" for one in self.exceeded if not one.fails),
        )

    def _saturation_text(self, one: Saturation) -> str:
        return (
            f"the torque of {one.label} was at its limit of {one.limit:.4g} {one.unit} in "
            f"{100 * one.rows / self.count:.2g} % of the samples ({one.rows} of {self.count}); design the motion with "
            "`torque_margin`"
        )


def _tracking_text(one: Tracking, allowed: float) -> str:
    return (
        f"joint {one.joint} deviates from the reference by {one.error:.3g} {one.unit}, {100 * one.relative:.2g} % of "
        f"its range of motion, more than {100 * allowed:g} %"
    )


def simulation_outcome(
    robot: Robot, reference: Samples, samples: Samples, command: Array, *, limited: bool = True, pushed: bool = False
) -> SimulationOutcome:
    """What is to be said of a simulated run."""  # command (N, n)
    return SimulationOutcome(
        count=samples.time.size,
        saturated=cut_off_torques(robot, samples.time, command) if limited else (),
        tracking=() if pushed else trackings(robot, reference, samples),
        exceeded=(*exceeded_limits(robot, samples), *(() if limited else exceeded_torques(robot, command))),
    )


def trackings(robot: Robot, reference: Samples, samples: Samples) -> tuple[Tracking, ...]:
    """How far each joint was from its reference at the same instants."""
    errors, travels = np.abs(samples.q - reference.q).max(axis=0), np.ptp(reference.q, axis=0)
    return tuple(
        Tracking(joint.name, joint.unit, float(error), float(travel))
        for joint, error, travel in zip(robot.joints, errors, travels, strict=True)
    )
