"""Settings of a simulation: every option of ``excite simulate``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Literal

import numpy as np

from excite.tasks.option import essential, option
from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.quantities import check, check_options
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


Impacts = Callable[[Array], Array]  # joint torques over time


def impacts_on(robot: Robot, pulses: Sequence[ImpactPulse], wait: float = 0.0) -> Impacts:
    """Joint torques of all impacts over time, ``wait`` after their own, shape (N, n) [Nm or N]."""
    check_names("moving joint for an impact", (pulse.joint for pulse in pulses), robot.joint_names)

    def torques(time: Array) -> Array:
        tau = np.zeros((time.size, robot.n))
        for pulse in pulses:
            tau[:, robot.joint_names.index(pulse.joint)] += pulse.at(time - wait)
        return tau

    return torques


CONTROLLERS = ("computed-torque", "pd")
AUTO: Literal["auto"] = "auto"
_NO_NUMBERS = ("controller", "torque_limits", "impact")


@checked
@dataclass(frozen=True)
class SimulationSettings:
    """Settings of control, integration and measurement; the defaults are those of the command line.

    Parameters
    ----------
    rate : float
        Samples per second of the joints' log [Hz]; 0.5 ms as in [KD96] if not given.
    wrench_rate : float
        Samples per second of the force/torque sensor [Hz].
    periods : int
        Number of times that the motion is played in sequence.
    controller : {"computed-torque", "pd"}
        Computed torque with friction compensation, or PD with gravity compensation.
    bandwidth : float
        Natural frequency of the controlled joints [Hz]; critically damped.
    model_error : float
        Relative error of the controller's model: each body, rotor and friction is off by a random factor within
        ``1 +- model_error``.
    torque_limits : bool
        True if torques saturate at the limits of joints and drives.
    sign_width : float, optional
        Drive velocity over which friction changes its sign [rad/s or m/s]; chosen for the motion if not given.
    breakaway : float or "auto", optional
        Presliding: friction changes its direction over this distance of a drive, and keeps it at rest [rad or m];
        chosen for the steps if "auto". The sign changes with the velocity if not given.
    catch : float
        Distance that a drive moves under a ramp of its torque before the controller takes over again [rad or m].
    encoder : float or tuple of float, optional
        Counts per revolution of the motor, one for all drives or one each; positions are exact if not given.
    position_noise, velocity_noise, torque_noise : float or tuple of float
        Standard deviation of white noise, one for all joints or one each [rad, rad/s, Nm, or with m and N].
    wrench_noise : tuple of float
        Standard deviation of force and torque, two numbers, or six [N, Nm].
    temperature : float or tuple of float, optional
        Temperature of the joints, one for all or one each, at which friction is evaluated and which is logged [deg C].
    impact : tuple of ImpactPulse
        Short torques from outside, which move the robot and which its own torques do not show.
    friction_drift : float
        Relative change of friction from the first instant to the last, as the joints warm up: -0.3 is 30 % less.
    torque_gain : float or tuple of float
        Measured over true torque, one for all joints or one each.
    coloured_noise : float or tuple of float
        Standard deviation of torque noise that is correlated in time, one for all joints or one each [Nm or N].
    noise_corner : float
        Corner frequency of the first-order low-pass that colours it [Hz].
    position_step : float or tuple of float
        Positions are rounded to whole multiples of it, one for all joints or one each [rad or m]; 0 for none.
    seed : int
        Seed of noise and model error.

    Raises
    ------
    InputError
        An invalid number.
    """

    rate: float = essential(2000.0, "number", "Samples per second of joints.", metavar="HZ")
    wrench_rate: float = option(250.0, "number", "Samples per second of the wrench.", metavar="HZ")
    periods: int = essential(1, "integer", "Number of times that the motion is played.", metavar="N")
    controller: str = essential(
        "computed-torque",
        "name",
        "computed-torque compensates friction too; pd compensates gravity only.",
        choices=CONTROLLERS,
    )
    bandwidth: float = option(5.0, "number", "Natural frequency of the controlled joints.", metavar="HZ")
    model_error: float = essential(0.0, "number", "Relative error of the controller's model, 0.1 = 10 %.", metavar="E")
    torque_limits: bool = option(
        True, "flag", "Torques saturate at the robot's limits.", flag="torque-limits/no-torque-limits"
    )
    sign_width: float | None = option(
        None, "number", "Drive velocity over which friction changes sign.", metavar="V", unset="chosen automatically"
    )
    breakaway: float | Literal["auto"] | None = essential(
        None,
        "distance",
        "Presliding: distance of a drive over which friction changes direction and holds at rest; auto: "
        "1e-5, or what the steps allow.",
        metavar="D|auto",
        unset="auto for files of a friction plan",
    )
    catch: float = option(2e-3, "number", "Distance of a drive that ends a ramp of its torque.", metavar="R")
    encoder: tuple[float, ...] | None = essential(
        None, "numbers", "Counts per motor revolution, one for all, or one each.", metavar="COUNTS"
    )
    position_noise: tuple[float, ...] = option(
        (0.0,), "numbers", "Standard deviation of position noise.", metavar="S,..."
    )
    velocity_noise: tuple[float, ...] = option(
        (0.0,), "numbers", "Standard deviation of velocity noise.", metavar="S,..."
    )
    torque_noise: tuple[float, ...] = essential(
        (0.0,), "numbers", "Standard deviation of joint torque noise.", metavar="S,..."
    )
    wrench_noise: tuple[float, ...] = option(
        (0.0, 0.0), "numbers", "Standard deviation of force and torque noise.", metavar="F,N"
    )
    temperature: tuple[float, ...] | None = option(
        None,
        "numbers",
        "Temperature of the joints, one for all, or one each; friction depends on it, and the log states it.",
        metavar="T,...",
    )
    impact: tuple[ImpactPulse, ...] = option(
        (),
        "impacts",
        "Half a sine of TAU [Nm] from outside on joint J at T [s], for D [s], 0.01 if not given; repeatable.",
        metavar="J:T:TAU[:D]",
    )
    friction_drift: float = option(
        0.0, "number", "Change of friction over the log as joints warm up, -0.3 = 30 % less.", metavar="X"
    )
    torque_gain: tuple[float, ...] = option(
        (1.0,), "numbers", "Measured over true torque, 1.1 = 10 % too much; one for all, or one each.", metavar="G,..."
    )
    coloured_noise: tuple[float, ...] = essential(
        (0.0,), "numbers", "Standard deviation of slow torque noise; below the noise corner.", metavar="S,..."
    )
    noise_corner: float = option(
        5.0, "number", "Corner frequency of the slow torque noise, which is of first order.", metavar="HZ"
    )
    position_step: tuple[float, ...] = option(
        (0.0,), "numbers", "Positions are rounded to multiples of Q, such as 1e-4.", metavar="Q,..."
    )
    seed: int = essential(0, "integer", "Seed of noise and model error.", metavar="N")

    def __post_init__(self) -> None:
        check_names("controller", [self.controller], CONTROLLERS)
        check_options(self, (field.name for field in fields(self) if field.name not in _NO_NUMBERS))
        if 0.0 in self.torque_gain:
            raise InputError("`torque_gain` must not be zero: measured torques would all be zero")
        if self.sign_width == 0:
            raise InputError("`sign_width` must be a velocity greater than zero, given 0")
        if self.breakaway is not None and self.sign_width is not None:
            raise InputError(
                "friction changes sign over a velocity or over a distance; give `sign_width` or `breakaway`, not both"
            )
        if isinstance(self.breakaway, str):
            if self.breakaway != AUTO:
                raise InputError(f"breakaway must be a distance, or 'auto', given {self.breakaway!r}")
        elif self.breakaway == 0:
            raise InputError("`breakaway` must be a distance greater than zero, given 0")
        if len(self.wrench_noise) not in (2, 6):
            raise InputError(
                f"wrench_noise needs two numbers, of force and torque, or six; given {len(self.wrench_noise)}"
            )

    def to_dict(self) -> dict[str, object]:
        """Options as plain values."""
        return asdict(self)


def one_each(values: tuple[float, ...], count: int, what: str, of: str = "joint") -> tuple[float, ...]:
    """One value for each of ``count`` items, from one for all or one each."""
    if len(values) == 1:
        return values * count
    if len(values) != count:
        raise InputError(f"{what} needs one value, or {count}, one per {of}; given {len(values)}")
    return values
