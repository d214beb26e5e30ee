"""Motion simulated with the identified model from the measured torques, over a horizon that can tell models apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from excite.simulation.replay import Outcome, Replay
from excite.verification.tolerances import Tolerances
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


WHOLE = 60.0  # logs of up to this are simulated as a whole [s]
SAMPLE = 30.0  # of longer ones at most so much, in windows [s]
_MOST, _FEWEST = 60, 10  # windows, however short or long they are
_ROUNDING = 1e-9


def most_windows(duration: float, horizon: float) -> int | None:
    """Windows of a motion that are simulated at most; None for all of them.

    The error of a joint's simulated motion is a root mean square over windows. Of 60 of them, chance changes it by
    about a tenth, while it is judged against a tolerance of about a quarter of the travel.
    """
    if duration <= WHOLE * (1 + _ROUNDING):
        return None
    return min(_MOST, max(_FEWEST, round(SAMPLE / horizon)))


def sampling_remark(replay: Replay, horizon: float) -> str | None:
    """Which windows were simulated, in words; None where all of them were."""
    if not replay.left_out:
        return None
    count = len(replay.starts)
    total = count + replay.left_out
    return (
        f"simulated motion: {count} of {total} windows of {horizon:.3g} s, spread evenly over the log; "
        "torques are predicted in all of its rows"
    )


_SHORTEST = 4  # samples
_MOST_SHORTER = 8.0
_NAMED = 3
_FAR = 0.25  # of a joint's travel: beyond it, what allowed errors of the torques do says nothing about the model

Simulate = Callable[[Array, float], Replay]


@dataclass(frozen=True, eq=False)
class JudgedMotion:
    """The simulated motion that a verdict is based on."""

    replay: Replay
    motions: tuple[MotionError, ...] | None  # None where it ended early
    horizon: float  # time after which it restarts [s]
    asked: float  # the longest time that it could [s]
    # joints that allowed errors of the torques move farther than the tolerance over the asked horizon: those of
    # little inertia
    undecided: tuple[str, ...] = ()
    decided: bool = True  # False where even the shortest horizon says nothing

    @property
    def remark(self) -> str | None:
        """What shortened the horizon, in words; None where nothing did."""
        if not self.undecided:
            return None
        names = ", ".join(self.undecided[:_NAMED]) + (" and others" if len(self.undecided) > _NAMED else "")
        moved = f"errors of the torques that are allowed move {names} too far in {self.asked:g} s"
        little = "where the inertia is small"
        if self.decided:
            return f"the simulated motion is judged over {self.horizon:.3g} s at a time: {moved}, {little}"
        return f"the simulated motion does not count: {moved}, {little}, and over shorter times too"


def judged_motion(
    simulate: Simulate,
    torque: Array,
    noise: Array,
    measured: Samples,
    units: dict[str, str],
    horizon: float,
    tolerances: Tolerances,
) -> JudgedMotion:
    """Simulate the motion; over a shorter horizon where allowed errors of the torques would reject any model.

    An error d of a torque moves a joint by about ``M^-1 d t^2 / 2``: where M is nearly singular, as along a light
    wrist, far beyond the motion itself. If the motion exceeds its tolerance, it is therefore simulated again with
    torques that are wrong by what is allowed: by a constant in each window, of random sign and as large as the
    tolerance of the torques, and by noise like the measurement's. If that alone moves a joint by more than the
    tolerance of the motion, and a quarter of its travel, the horizon says nothing about the model, and is shortened to
    a half or less.
    """  # torque (N, n); noise (n,)
    shortest = _SHORTEST * float(measured.time[-1] - measured.time[0]) / (measured.time.size - 1)
    asked, undecided = horizon, tuple[str, ...]()
    while True:
        replay = simulate(torque, horizon)
        motions = motion_errors(replay, measured, units) if replay.ok else None
        sensitive: dict[str, float] = {}
        if replay.outcome is not Outcome.NOT_POSITIVE and _exceeds(motions, tolerances):
            wrong = _wrong(torque, noise, replay.starts, tolerances.torque)
            sensitive = _sensitive(simulate(wrong, horizon), replay, motions, units, tolerances)
        undecided = undecided or tuple(sorted(sensitive, key=lambda name: -sensitive[name]))
        if not sensitive or horizon / 2 < shortest:
            return JudgedMotion(replay, motions, horizon, asked, undecided, decided=not sensitive)
        needed = horizon * max(tolerances.motion, _FAR) / max(sensitive.values())  # deviation over travel grows with it
        horizon = min(horizon / 2, max(needed, shortest, horizon / _MOST_SHORTER))


def _exceeds(motions: tuple[MotionError, ...] | None, tolerances: Tolerances) -> bool:
    return motions is None or any(np.isfinite(m.relative) and m.relative > tolerances.motion for m in motions)


def _wrong(torque: Array, noise: Array, starts: tuple[int, ...], share: float) -> Array:
    rng = np.random.default_rng(0)
    size = share * np.sqrt(np.mean(torque**2, axis=0))
    window = np.searchsorted(np.array(starts), np.arange(len(torque)), side="right") - 1
    sign = rng.choice([-1.0, 1.0], (len(starts), torque.shape[1]))
    return np.asarray(torque + size * sign[window] + noise * rng.normal(size=torque.shape))


def _sensitive(
    moved: Replay,
    replay: Replay,
    motions: tuple[MotionError, ...] | None,
    units: dict[str, str],
    tolerances: Tolerances,
) -> dict[str, float]:
    """How far wrong torques move joints, of their travel, where it is too far; infinite if either motion diverges."""
    rows = replay.rows
    if motions is None or not moved.ok:
        lost = [np.isnan(both).any() for both in np.concatenate([replay.q[rows], moved.q[rows]]).T]
        return {name: np.inf for name, gone in zip(units, lost, strict=True) if gone}
    deviation = np.sqrt(np.mean((moved.q - replay.q)[rows] ** 2, axis=0))
    return {
        m.name: float(d) / m.travel
        for m, d in zip(motions, deviation, strict=True)
        if np.isfinite(m.relative) and d > max(tolerances.motion, _FAR) * m.travel
    }
