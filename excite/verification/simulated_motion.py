"""Motion simulated with the identified model from the measured torques, restarted after each horizon."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from excite.simulation.replay import Outcome, Replay
from regressors.samples import Array, Samples


@dataclass(frozen=True)
class MotionError:
    """How well the motion of one joint is simulated."""

    name: str  # of the joint
    unit: str  # of its position
    travel: float  # typical travel of the measured motion within one horizon [unit]
    error: float  # root mean square of the difference [unit]
    relative: float  # the ratio of the two; infinite where the joint does not move
    worst: float  # largest difference [unit]
    worst_time: float  # when [s]


def motion_errors(replay: Replay, measured: Samples, units: dict[str, str]) -> tuple[MotionError, ...]:
    """Errors of every joint over the windows of a motion that were all integrated to their ends."""
    rows = replay.rows
    difference, time = (replay.q - measured.q)[rows], measured.time[rows]
    windows = [measured.q[a:b] for a, b in replay.bounds]
    travel = np.sqrt(np.mean([np.ptp(q, axis=0) ** 2 for q in windows], axis=0))
    errors = []
    for j, (name, unit) in enumerate(units.items()):
        e, size = difference[:, j], float(travel[j])
        worst, error = int(np.argmax(np.abs(e))), float(np.sqrt(np.mean(e**2)))
        relative = error / size if size > 0 else np.inf
        errors.append(MotionError(name, unit, size, error, relative, float(np.abs(e[worst])), float(time[worst])))
    return tuple(errors)


def failure(replay: Replay) -> str | None:
    """Why a replay ended early, in words; None if it did not."""
    if replay.outcome is Outcome.DONE:
        return None
    return f"{replay.outcome.value} (at {replay.failed_at:.3f} s)"


WHOLE = 60.0  # logs of up to this are simulated as a whole [s]
SAMPLE = 30.0  # of longer ones at most so much, in windows [s]
_MOST, _FEWEST = 60, 10  # windows, however short or long: of 60, chance changes the error by about a tenth
_ROUNDING = 1e-9


def most_windows(duration: float, horizon: float) -> int | None:
    """Windows of a motion that are simulated at most; None for all of them."""
    if duration <= WHOLE * (1 + _ROUNDING):
        return None
    return min(_MOST, max(_FEWEST, round(SAMPLE / horizon)))


_SHORTEST = 4  # samples

Simulate = Callable[[float], Replay]


def longest_replay(simulate: Simulate, horizon: float, shortest: float) -> tuple[Replay, float]:
    """The simulated motion over the longest horizon that does not diverge, each a half of the one before; its horizon.

    An error d of a torque moves a joint by about ``M^-1 d t^2 / 2``: where M is nearly singular, as along a light
    wrist, far beyond the motion itself.
    """
    replay = simulate(horizon)
    while replay.outcome is Outcome.RAN_AWAY and horizon / 2 >= shortest:
        horizon /= 2
        replay = simulate(horizon)
    return replay, horizon


def shortest_horizon(time: Array) -> float:
    """Over which a motion is simulated at least [s]."""
    return _SHORTEST * float(time[-1] - time[0]) / (time.size - 1)


def motion_remarks(replay: Replay | None, horizon: float | None, asked: float) -> tuple[str, ...]:
    """What became of the simulated motion over the time that was asked for, and which windows were simulated."""
    if replay is None or horizon is None:
        return ()
    remarks = []
    if not replay.ok:
        remarks.append(
            f"the motion cannot be simulated ({failure(replay)}, over shorter times too): judge by the torques"
        )
    elif horizon < asked:
        remarks.append(
            f"a joint has too little inertia to test by simulation: it diverges within {asked:g} s, so that simulation "
            f"restarts every {horizon:.2g} s; judge that joint by its torque"
        )
    if replay.left_out:
        count = len(replay.starts)
        remarks.append(
            f"simulated motion: {count} of {count + replay.left_out} windows of {horizon:.3g} s, spread evenly over "
            "the log; torques are predicted in all of its rows"
        )
    return tuple(remarks)
