"""Simulated experiments that are repeated with new noise: the motion and its exact torques, computed once."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "builders"))

import numpy as np
from pinocchio_chains import held_wrench, joint_torques

from excite.design.optimisation import design_trajectory
from excite.identification.equations import measured_regressor
from excite.information.target import IdentificationTarget, target_of
from excite.logs.log import Log
from excite.payload.payload_motion import design_payload_motion
from excite.simulation.simulate import simulate
from excite.tasks.task import Task
from regressors.models.nominal import parameter_values, standard_values
from regressors.readers.library import built_in
from regressors.robot.columns import BODY_KINDS, COULOMB as COULOMB_KIND, VISCOUS as VISCOUS_KIND
from regressors.robot.friction.curve import Side, Stribeck
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_along
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

FINE = 10  # instants per instant of the log along which presliding friction is followed
LOAD = np.array(
    [1.75, 0.0573, -0.021, 0.1394, 0.0159, 0.0009, -0.0049, 0.018, 0.0021, 0.0051]
)  # at the sensor, a possible body
CURVED = 0.15  # velocity of the smooth curve of Stribeck friction [rad/s]
STRIBECK = 0.02  # velocity over which break-away friction decays [rad/s]
COULOMB, VISCOUS = 6.0, 8.0  # of robots whose friction is not published, such as the ur10e [Nm, Nm s/rad]
POSES = {"panda": (0.0, -0.4, 0.0, -2.0, 0.0, 1.8, 0.785), "ur10e": (0.0, -1.2, 1.6, -1.2, -1.57, 0.0)}
OWN = {"panda": (1.0, 1.0)}


@dataclass(frozen=True)
class Experiment:
    """One motion of one robot, its model, and what its friction does.

    Parameters
    ----------
    robot : str
        Built-in robot.
    model : mapping
        Options of the model that is identified.
    duration, rate : float
        Of the motion [s], and of the log [Hz].
    breakaway : float
        Distance over which Coulomb friction changes its direction [rad]; 0 for its sign.
    sign_width : float
        Velocity over which it changes its sign instead [rad/s].
    stiction : float
        Break-away friction over Coulomb friction, in the full simulation of the controlled robot; 0 for none.
    harmonics : int
        Of the motion.
    plant : {"own", "pinocchio"}
        What computes the torques, or the wrench of a load at the last link.
    stribeck : float
        By how much friction at rest exceeds Coulomb friction, over it, with the plant of Pinocchio: a smooth curve
        over `CURVED` rad/s, without sticking.
    swing : float
        How far the joints turn from a pose, in a motion made for a load [rad]; 0 for a design of the model.
    wrong : float
        By how much, as a factor ``1 +- wrong`` of each body, the true parameters differ from the described ones.
    """

    robot: str = "irp6"
    model: dict[str, Any] = field(default_factory=dict)
    duration: float = 6.0
    rate: float = 200.0
    breakaway: float = 0.0
    sign_width: float = 0.0
    stiction: float = 0.0
    harmonics: int = 5
    plant: str = "own"
    stribeck: float = 0.0
    swing: float = 0.0
    wrong: float = 0.0

    @cached_property
    def description(self) -> Robot:
        """The robot itself."""
        return built_in(self.robot)

    @cached_property
    def task(self) -> Task:
        """Model to identify."""
        return Task(self.robot, **self.model).changed(robot=self.description)

    @cached_property
    def known(self) -> dict[str, float]:
        """True standard parameters."""
        target = self.target
        coulomb, viscous = OWN.get(self.robot, (COULOMB, VISCOUS))
        friction = {
            c.name: coulomb if c.kind == COULOMB_KIND else viscous
            for c in target.model.standard_columns
            if c.kind in (COULOMB_KIND, VISCOUS_KIND)
        }
        load = dict(zip(target.model.definition()[1], LOAD, strict=False)) if target.model.channel == "wrench" else {}
        described = {**friction, **standard_values(target.robot), **load}
        rng = np.random.default_rng(0)
        factors = {owner: 1 + self.wrong * (2 * rng.uniform() - 1) for owner in range(-1, 20)}
        bodies = {c.name: c.owner for c in target.model.standard_columns if c.kind in BODY_KINDS}
        return {k: v * factors[bodies[k]] if isinstance(bodies.get(k), int) else v for k, v in described.items()}

    @cached_property
    def target(self) -> IdentificationTarget:
        """Model and base parameters that are identified."""
        return target_of(self.description, self.task)

    @cached_property
    def truth(self) -> Array:
        """True base parameters, shape (p,)."""
        return self.truth_of(self.target)

    def truth_of(self, target: IdentificationTarget) -> Array:
        """True base parameters of another model of the robot, zero for terms that the truth has not, shape (p,)."""
        names = target.model.definition()[1]
        return parameter_values(target.model, target.base, {**dict.fromkeys(names, 0.0), **self.known})

    @cached_property
    def log(self) -> Log:
        """Log without noise, velocities left out."""
        own = {k: v for k, v in self.model.items() if k not in ("window",)}
        task = Task(self.robot, period=self.duration, harmonics=self.harmonics, starts=2, seed=0, rate=self.rate, **own)
        design = self._still if self.swing else design_trajectory(task.changed(robot=self.description))
        if self.stiction:
            return self._controlled(design)
        samples = design.trajectory.samples(np.arange(round(self.duration * self.rate * FINE) + 1) / self.rate / FINE)
        target = self._instantaneous
        if self.plant == "pinocchio":
            measured = self._by_pinocchio(samples.rows(slice(None, None, FINE)))
        else:
            beta = parameter_values(target.model, target.base, self.known)
            W = measured_regressor(target, samples, self.breakaway)
            measured = (W @ beta).reshape(samples.time.size, -1)[::FINE]
        names = self.target.robot.joint_names
        wrench = target.model.channel == "wrench"
        return Log(
            f"{self.robot}.csv",
            f"{self.robot} {self.breakaway}",
            names,
            samples.time[::FINE],
            samples.q[::FINE],
            None,
            None if wrench else measured,
            measured if wrench else None,
        )

    @cached_property
    def _still(self) -> Any:
        """Design of a motion that hardly turns the load."""
        settings = {
            "sensor": "wrench",
            "pose": POSES[self.robot],
            "swing": self.swing,
            "period": self.duration,
            "starts": 2,
        }
        return design_payload_motion(self.description, **settings).design

    @cached_property
    def _instantaneous(self) -> IdentificationTarget:
        """Model of single instants with the same parameters."""
        name = _INSTANT[type(self.target.model).__name__]
        return target_of(self.description, self.task.changed(model=name), self.sign_width)

    def regressor(self, log: Log) -> Array:
        """Regressor at every instant of the log without noise, shape (N r, p)."""
        step, target = 1 / self.rate, self._instantaneous
        velocity = np.gradient(log.q, step, axis=0, edge_order=2)
        acceleration = np.gradient(velocity, step, axis=0, edge_order=2)
        samples = Samples(log.time, log.q, velocity, acceleration, np.zeros_like(log.q))
        return measured_regressor(target, samples, self.breakaway)

    def _by_pinocchio(self, samples: Samples) -> Array:
        """Torques of a robot without drives, or the wrench of the load, by Pinocchio's recursion, shape (N, n)."""
        if self.target.model.channel == "wrench":
            return held_wrench(self.description, LOAD, samples)
        coulomb, viscous = OWN.get(self.robot, (COULOMB, VISCOUS))
        curve = coulomb * (1 + self.stribeck * np.exp(-((samples.dq / CURVED) ** 2)))
        return np.asarray(joint_torques(self.description, samples) + curve * np.sign(samples.dq) + viscous * samples.dq)

    def _controlled(self, design: Any) -> Log:
        """Log of the controlled robot, whose drives stick."""
        curves = {
            name: Stribeck(Side(coulomb, viscous, self.stiction * coulomb, STRIBECK))
            for name, (coulomb, viscous) in self._friction().items()
        }
        simulation = simulate(design, friction=FrictionCurves(curves), rate=self.rate, breakaway=self.breakaway)
        log = simulation.log
        return Log(log.source, log.sha256, log.joints, log.time, log.q, None, log.effort)

    def _friction(self) -> dict[str, tuple[float, float]]:
        """Coulomb and viscous friction of each drive, with what turns along, or of each joint without drives."""
        if self.description.transmission is None:
            return dict.fromkeys(self.description.joint_names, OWN.get(self.robot, (COULOMB, VISCOUS)))
        friction = {d.name: (d.coulomb, d.viscous) for d in self.description.transmission.drives}
        for name, leading, a in drives_along(self.target.robot):
            coulomb, viscous = friction[leading]
            friction[leading] = coulomb + abs(a) * friction[name][0], viscous + a**2 * friction[name][1]
        return friction


_INSTANT = {
    "DifferentialModel": "differential",
    "EnergyModel": "differential",
    "LoadModel": "load",
    "LoadIntegralModel": "load",
}
