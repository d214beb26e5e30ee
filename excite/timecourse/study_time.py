"""Time that a study takes, predicted before its first simulation."""

from __future__ import annotations

_SIMULATED = 2e-5  # seconds of each sample and joint of a simulation
_FIRST = 3e-3  # seconds of the choices of the first measurement, for each joint to the third power
_ROW, _POINT = 5e-7, 7e-6  # seconds of each row, and of each instant, of one measurement, for each pair of joints


def study_seconds(durations: list[float], joints: int, rate: float, points: int, repeats: int) -> float:
    """Time of the simulated motions of a study on one core [s]; right within a factor of three.

    The units that it grows with are the numbers of the regressor, rows times joints times joints, and those of a
    triangular factor at each instant. Logs add the time of their identification.
    """
    samples = rate * sum(durations)
    measurement = (_ROW * samples + _POINT * points * len(durations)) * joints**2
    first = _SIMULATED * samples * joints + _FIRST * len(durations) * joints**3
    return float(first + (1 + repeats) * measurement)
