"""Motion simulated with the identified model from the measured torques, against the measured motion [KD96] Fig. 17."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.simulation.replay import Outcome, Replay
from regressors.samples import Array, Samples


@dataclass(frozen=True)
class MotionError:
    """How well the motion of one joint is simulated.

    Parameters
    ----------
    name, unit : str
        Joint, and unit of its position.
    travel : float
        Typical travel of the measured motion within one horizon [unit].
    error : float
        Root mean square of the difference [unit].
    relative : float
        The ratio of the two; infinite where the joint does not move.
    worst : float
        Largest difference [unit].
    worst_time : float
        When [s].
    """

    name: str
    unit: str
    travel: float
    error: float
    relative: float
    worst: float
    worst_time: float


def motion_errors(replay: Replay, measured: Samples, units: dict[str, str]) -> tuple[MotionError, ...]:
    """Errors of every joint over the windows of a motion that were all integrated to their ends."""
    rows = replay.rows
    difference, time = (replay.q - measured.q)[rows], measured.time[rows]
    windows = [measured.q[a:b] for a, b in replay.bounds]
    travel = np.sqrt(np.mean([np.ptp(q, axis=0) ** 2 for q in windows], axis=0))
    return tuple(
        _motion_error(name, unit, float(travel[j]), difference[:, j], time)
        for j, (name, unit) in enumerate(units.items())
    )


def _motion_error(name: str, unit: str, travel: float, difference: Array, time: Array) -> MotionError:
    worst = int(np.argmax(np.abs(difference)))
    error = float(np.sqrt(np.mean(difference**2)))
    relative = error / travel if travel > 0 else np.inf
    return MotionError(name, unit, travel, error, relative, float(np.abs(difference[worst])), float(time[worst]))


def failure(replay: Replay) -> str | None:
    """Why a replay ended early, in words; None if it did not."""
    if replay.outcome is Outcome.DONE:
        return None
    return f"{replay.outcome.value} (at {replay.failed_at:.3f} s)"
