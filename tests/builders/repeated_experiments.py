"""Experiments of every model to be repeated, and the comparison of their repetitions."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from motions import random_sines
from slow_dynamics import random_chain

from excite.signals.butterworth import Butterworth
from excite.signals.differences import Differences
from excite.signals.savitzky_golay import SavitzkyGolay
from excite.study.experiment import Experiment, Noise
from excite.study.repetitions import Repetitions
from regressors.models.base import base_parameters
from regressors.models.columns import Terms
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.load import LoadIntegralModel, LoadModel, Sensor
from regressors.models.model import RegressorModel
from regressors.models.windows import Window
from regressors.robot.robot import Robot

TIME = np.arange(301) / 100.0
NOISE = Noise(effort=0.3, position=[1e-5, 2e-5], count=[3e-5, 0.0])


def _experiment(model: RegressorModel, noise: Noise, **choices: Any) -> Experiment:
    base = base_parameters(model)
    beta = np.random.default_rng(1).uniform(0.5, 2.0, base.rank)
    return Experiment(model, base, random_sines(model.robot.n, 2).samples(TIME), beta, noise, **choices)


@cache
def arm() -> Robot:
    return random_chain("rr", np.random.default_rng(3))


@cache
def plain() -> Experiment:
    """Noise of the torques only."""
    return _experiment(DifferentialModel(arm()), Noise(effort=0.3))


@cache
def chains() -> dict[str, Experiment]:
    """One experiment of every model."""
    four, sensor = random_chain("rrrr", np.random.default_rng(8)), Sensor(equations=("fx", "fy", "nx", "ny", "nz"))
    return {
        "torques": plain(),
        "differential": _experiment(
            DifferentialModel(arm(), Terms(offset=True)),
            NOISE,
            method=Butterworth(cutoff=15.0),
            low_pass=12.0,
            every=3,
            estimator="instrumental",
        ),
        "energy": _experiment(EnergyModel(arm(), Terms(), Window("long")), NOISE, method=SavitzkyGolay(window=0.15)),
        "load": _experiment(LoadModel(four, sensor), Noise(0.1), method=Differences(), every=2),
        "load-integral": _experiment(LoadIntegralModel(four, sensor, Window("long")), Noise(0.1), method=Differences()),
    }


def same(one: Repetitions, other: Repetitions) -> None:
    """Check that two are the same to the last digit."""
    for name in ("beta", "estimates", "predicted", "noise"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.seed, one.degrees_of_freedom) == (other.seed, other.degrees_of_freedom)
