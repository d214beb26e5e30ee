"""Experiments that are predicted and repeated: robots, conditions of measurement, and settings of identification."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.identification.recipe import Recipe
from excite.tasks.task import Task
from regressors.readers.library import load_robot
from regressors.robot.friction.curve import CoulombViscous, Side, Stribeck
from regressors.robot.friction.curves import FrictionCurves

RATE = 200.0  # of the logs [Hz]
SIGN_WIDTH = {"panda": 0.1, "ur10e": 0.35}  # of their friction, stated to the identification too [rad/s]
BREAK_AWAY, STRIBECK = 1.3, 0.05  # friction at rest over Coulomb friction, and its decay [rad/s or m/s]
COULOMB, VISCOUS = 0.01, 0.005  # of panda and ur10e, not published: assumed, of the torque limits [1, s/rad]
NOISE = {"irp6": 3 * (0.3,), "panda": 4 * (0.3,) + 3 * (0.05,), "ur10e": (1.0, 1.0, 0.5, 0.1, 0.1, 0.1)}  # [Nm]
MOTION: dict[str, dict[str, Any]] = {
    "irp6": {"encoder": 500.0, "position_noise": 1e-4},
    "panda": {"encoder": 8192.0, "position_noise": 4e-4},
    "ur10e": {"encoder": 8192.0, "position_noise": 4e-4},
}
PLAIN = "plain defaults"
IRP6 = ("irp6",)


@dataclass(frozen=True)
class Condition:
    """What is measured how, and how it is identified.

    Parameters
    ----------
    name : str
    white, coloured : float
        Noise of the torques, times `NOISE`; that of 2 Hz and of the lower frequencies.
    moves : bool
        Whether positions have noise and encoder counts, see `MOTION`.
    stribeck : bool
        Whether friction rises towards rest, which the model does not describe.
    model_error : float
        Of the controller: the motion of every repeat is another one.
    recipe : mapping
        Settings of the identification beside a cutoff of 10 Hz.
    plain : bool
        Nothing is stated; `identify` chooses from each log.
    robots : tuple of str
        Which robots are measured so.
    """

    name: str
    white: float = 0.0
    coloured: float = 0.0
    moves: bool = False
    stribeck: bool = False
    model_error: float = 0.0
    recipe: dict[str, Any] = field(default_factory=dict)
    plain: bool = False
    robots: tuple[str, ...] = tuple(NOISE)

    def settings(self, robot: str) -> dict[str, Any]:
        """Options of the simulation."""
        level = NOISE[robot]
        options = {
            "rate": RATE,
            "torque_noise": tuple(self.white * s for s in level),
            "coloured_noise": tuple(self.coloured * s for s in level),
            "noise_corner": 2.0,
            "model_error": self.model_error,
            **(MOTION[robot] if self.moves else {}),
        }
        return options if robot == "irp6" else {**options, "sign_width": SIGN_WIDTH[robot]}

    def friction(self, robot: str) -> FrictionCurves | None:
        """Friction of the simulated robot; None for that of its description."""
        curves = {name: self._curve(*values) for name, values in _friction(robot).items()}
        return None if robot == "irp6" and not self.stribeck else FrictionCurves(curves)

    def _curve(self, coulomb: float, viscous: float) -> Any:
        if self.stribeck:
            return Stribeck(Side(coulomb, viscous, BREAK_AWAY * coulomb, STRIBECK))
        return CoulombViscous(coulomb, viscous)

    def identification(self, robot: str) -> dict[str, Any]:
        """Options of `predict_accuracy` and `identify` alike."""
        if self.plain:
            return {}
        width = {} if robot == "irp6" else {"sign_width": SIGN_WIDTH[robot]}
        return {"recipe": Recipe(**{"cutoff": 10.0, **width, **self.recipe}), "choose": False}


CONDITIONS = (
    Condition("white", white=1.0),
    Condition("coloured", white=0.3, coloured=1.0),
    Condition("coloured, equations low-passed at 5 Hz", white=0.3, coloured=1.0, recipe={"low_pass": 5.0}, robots=IRP6),
    Condition("encoder", white=0.3, moves=True),
    Condition("encoder, Savitzky-Golay", white=0.3, moves=True, recipe={"signals": "savitzky-golay"}, robots=IRP6),
    Condition("encoder, Fourier", white=0.3, moves=True, recipe={"signals": "fourier", "cutoff": None}, robots=IRP6),
    Condition("friction", white=1.0, stribeck=True),
    Condition("all", white=0.3, coloured=1.0, moves=True, stribeck=True, model_error=0.05),
    Condition(f"all, {PLAIN}", white=0.3, coloured=1.0, moves=True, stribeck=True, plain=True),
)


@cache
def design_of(robot: str) -> Design:
    """A cheap design: two starts of the default search."""
    return design_trajectory(Task(robot=robot, starts=2, seed=0, executor="serial", rate=100))


def _friction(robot: str) -> dict[str, tuple[float, float]]:
    """Coulomb and viscous friction of each drive, or joint."""
    described = load_robot(robot)
    if described.transmission is None:
        limits = zip(described.joint_names, described.limits.torque, strict=True)
        return {name: (COULOMB * float(limit), VISCOUS * float(limit)) for name, limit in limits}
    return {drive.name: (drive.coulomb, drive.viscous) for drive in described.transmission.drives}
