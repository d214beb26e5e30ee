"""Memory that a simulation takes, predicted before it starts."""

from __future__ import annotations

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.simulation.settings import SimulationSettings

_OF_ANY, _OF_JOINT = 8.0, 24.0  # numbers of each sample, and of each of its joints
_OF_WRENCH = 60.0  # of each sample of the force/torque sensor
_SECONDS = 2e-5  # of each sample and joint


def simulation_prediction(settings: SimulationSettings, duration: float, n: int, *, wrench: bool) -> WorkPrediction:
    """Memory of a simulation; the factors are measured."""
    samples, numbers = duration * settings.rate, _OF_ANY + _OF_JOINT * n
    option, value = ("periods", settings.periods) if settings.periods > settings.rate / 2e3 else ("rate", settings.rate)
    parts = [MemoryPart("samples", samples, 1 + 3 * n, FLOAT * samples * numbers, option, value)]
    if wrench:
        more = duration * settings.wrench_rate
        parts.append(
            MemoryPart(
                "samples of the wrench", more, 7 + n, FLOAT * _OF_WRENCH * more, "wrench_rate", settings.wrench_rate
            )
        )
    return WorkPrediction("the simulation", parts, _SECONDS * samples * n)
