"""Experiments of every model to be repeated, an executor of their units, and the comparison of their repetitions."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from functools import cache
from typing import Any

import numpy as np
from motions import random_sines
from slow_dynamics import random_chain

from excite.design.executors.unit_executor import LostUnit, Work
from excite.errors import LostWorkersError
from excite.logs.signals.filters import Butterworth, Differences, SavitzkyGolay
from excite.study.experiment import Experiment, Noise
from excite.study.repetitions import Repetitions
from regressors.models.base import base_parameters
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.load import LoadIntegralModel, LoadModel, Sensor
from regressors.models.model import RegressorModel
from regressors.models.windows import Window
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot

TIME = np.arange(301) / 100.0
NOISE = Noise(effort=0.3, position=[1e-5, 2e-5], count=[3e-5, 0.0])


def experiment(model: RegressorModel, noise: Noise, **choices: Any) -> Experiment:
    """Random sines of a model's robot, and parameters that are far from zero."""
    base = base_parameters(model)
    beta = np.random.default_rng(1).uniform(0.5, 2.0, base.rank)
    return Experiment(model, base, random_sines(model.robot.n, 2).samples(TIME), beta, noise, **choices)


@cache
def arm() -> Robot:
    return random_chain("rr", np.random.default_rng(3))


@cache
def plain() -> Experiment:
    """Noise of the torques only."""
    return experiment(DifferentialModel(arm()), Noise(effort=0.3))


@cache
def chains() -> dict[str, Experiment]:
    """One experiment of every model."""
    four, sensor = random_chain("rrrr", np.random.default_rng(8)), Sensor(equations=("fx", "fy", "nx", "ny", "nz"))
    return {
        "torques": plain(),
        "differential": experiment(
            DifferentialModel(arm(), Terms(offset=True)),
            NOISE,
            method=Butterworth(cutoff=15.0),
            low_pass=12.0,
            every=3,
            estimator="instrumental",
        ),
        "energy": experiment(EnergyModel(arm(), Terms(), Window("long")), NOISE, method=SavitzkyGolay(window=0.15)),
        "load": experiment(LoadModel(four, sensor), Noise(0.1), method=Differences(), every=2),
        "load-integral": experiment(LoadIntegralModel(four, sensor, Window("long")), Noise(0.1), method=Differences()),
    }


def same(one: Repetitions, other: Repetitions) -> None:
    """Check that two are the same to the last digit."""
    for name in ("beta", "estimates", "predicted", "noise"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.seed, one.degrees_of_freedom) == (other.seed, other.degrees_of_freedom)


class OneByOne:
    """Runs units one after the other and counts what they have; loses some, and goes away after some of them."""

    shares_disk = True

    def __init__(self, lost: Sequence[int] = (), ends_after: int | None = None, *, backwards: bool = False) -> None:
        self.lost, self.ends_after, self.step = lost, ends_after, -1 if backwards else 1
        self.numbers, self.closed = list[int](), False

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        try:
            for done, index in enumerate(range(len(units))[:: self.step]):
                if done == self.ends_after:
                    raise LostWorkersError("the scheduler went away", "what is finished is kept")
                self.numbers += units[index] if isinstance(units[index], range) else [units[index]]
                yield index, LostUnit("its process ended") if index in self.lost else work(common, units[index])
        finally:
            self.closed = True
