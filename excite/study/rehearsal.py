"""One experiment in simulation, identified as its log will be: the equations by which errors reach the parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from excite.identification.covariance import METHODS
from excite.identification.identification import Identification
from excite.identification.known_friction import without_friction
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.standstill_bias import without_standstill
from excite.logs.log import Log
from excite.simulation.integration import SimulatedRun
from excite.simulation.sensors import joint_log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulation import Simulation
from excite.study.parameter_errors import LinearEquations, linear_equations
from regressors.errors import InputError
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """A simulated experiment and its identification, whose settings and weights repeats are taken to share."""

    simulation: Simulation
    result: Identification  # of its log
    # settings that every repeat finds again from its own log, see `excite.identification.stated_uncertainty`
    found: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        method, model = self.result.estimate.method, self.result.target.model
        if method not in METHODS:
            raise InputError(f"accuracy is predicted for the estimators {', '.join(METHODS)}, not for {method}")
        if self.result.recipe.average:
            raise InputError("accuracy is predicted for every instant of the log; leave out `average`")
        if model.channel != "effort":
            raise InputError("accuracy is predicted for models of joint torques, not for those of a wrench")

    @property
    def settings(self) -> SimulationSettings:
        """Stated noise of torques and of the motion, and what else happens in every repeat."""
        return self.simulation.settings

    @property
    def moves(self) -> bool:
        """Whether the measured motion is not exact."""
        return motion_settings(self.settings) != exact_settings(self.settings)

    @cached_property
    def exact(self) -> LinearEquations:
        """Equations of the exact motion and the exact torques, with whatever the model does not describe."""
        return self.equations(self.log(exact_settings(self.settings), np.zeros(self.simulation.robot.n)))

    def equations(self, log: Log) -> LinearEquations:
        """Equations of a log by the settings of the identification."""
        return linear_equations(self.result, self.prepared(log), self.found)

    def prepared(self, log: Log) -> PreparedLog:
        """Motion and measurements of a log by the settings of the identification."""
        result = self.result
        part = prepare(log, result.robot, result.target, result.recipe)
        part = without_standstill(part, result.target, result.recipe.standstill)
        if result.friction is None:
            return part
        return without_friction(part, result.target, result.friction, result.recipe)

    def log(self, settings: SimulationSettings, shift: Array) -> Log:
        """The run as sensors measure it whose zeros are elsewhere, so that steps fall on other instants."""
        # shift (n,)
        run, rng = self.simulation.run, np.random.default_rng(settings.seed)
        log = joint_log(self.simulation.robot, _shifted(run, shift), settings, rng)
        return replace(log, q=log.q - shift)


def _shifted(run: SimulatedRun, shift: Array) -> SimulatedRun:
    s = run.samples
    return replace(run, samples=Samples(s.time, s.q + shift, s.dq, s.ddq, s.dddq))


def motion_settings(settings: SimulationSettings) -> SimulationSettings:
    """The settings without noise of torques."""
    return replace(settings, torque_noise=(0.0,), coloured_noise=(0.0,))


def exact_settings(settings: SimulationSettings) -> SimulationSettings:
    """The settings of exact sensors; gains and drifts stay."""
    none = (0.0,)
    quiet = motion_settings(settings)
    return replace(quiet, encoder=None, position_noise=none, velocity_noise=none, position_step=none)
