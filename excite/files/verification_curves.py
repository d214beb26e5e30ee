"""``verification-LOG_curves.npz``: what the figures of a verification show of its log, and the measured motion.

| array | shape | |
|---|---|---|
| ``time`` | (N,) | instants of measurements [s] |
| ``measured``, ``predicted`` | (N, r) | [units of the equations] |
| ``every`` | () | 1, or k where only every k-th instant is in the file |
| ``motion_time``, ``motion_log`` | (K,) | instants of the motion [s]; zeros |
| ``motion_q`` | (K, n) | positions of ``joints`` [rad or m] |
| ``joints`` | (n,) | names |
| ``replay_time`` | (M,) | instants of the simulated motion [s], where there is one |
| ``replay_q``, ``replay_measured`` | (M, n) | simulated and measured positions; NaN where it is not simulated |
| ``replay_starts``, ``replay_stops`` | (w,) | index of each window's first instant, and of the one after its last |
| ``replay_end`` | (3,) | number of the outcome, instant at which it failed or NaN [s], windows that were left out |
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from excite.files.curves_file import NUMBERS, Arrays, every, read_curves, short
from excite.files.result_curves import check_motion, check_shapes, motion_arrays
from excite.simulation.replay import Outcome, Replay
from excite.verification.verification import Verification
from regressors.errors import InputError
from regressors.samples import Array

CURVES = "_curves.npz"  # after the name of the verification
_REPLAYED = 60_000  # simulated and measured positions in a file; the figure shows their differences, not their rms


def verification_curves(verification: Verification) -> Arrays:
    """Arrays of the file.

    Parameters
    ----------
    verification : Verification
    """
    v = verification
    step = every(2 * v.measured.size)
    return {
        "time": v.time[::step],
        "measured": short(v.measured[::step]),
        "predicted": short(v.predicted[::step]),
        "every": np.array(step),
        **motion_arrays((v.prepared,)),
        **({} if v.replay is None else _replay(v.replay, v.prepared.samples.q)),
    }


def _replay(replay: Replay, measured: Array) -> Arrays:
    """The simulated motion at some instants, among them the first and last of every window."""
    bounds = np.array(replay.bounds)
    step = every(2 * replay.q.size, _REPLAYED)
    edges = np.concatenate([bounds[:, 0], bounds[:, 1] - 1])
    kept = np.unique(np.concatenate([np.arange(0, replay.time.size, step), edges]))
    failed = np.nan if replay.failed_at is None else replay.failed_at
    return {
        "replay_time": replay.time[kept],
        "replay_q": short(replay.q[kept]),
        "replay_measured": short(measured[kept]),
        "replay_starts": np.searchsorted(kept, bounds[:, 0]),
        "replay_stops": np.searchsorted(kept, bounds[:, 1] - 1) + 1,
        "replay_end": np.array([list(Outcome).index(replay.outcome), failed, replay.left_out]),
    }


def read_verification_curves(path: Path, equations: int) -> Arrays:
    """Arrays of the file of a verification.

    Parameters
    ----------
    path : Path
    equations : int
        How many the verification has.

    Raises
    ------
    InputError
        It is not complete, or not that of such a verification.
    """
    arrays = read_curves(path)
    shapes = {"time": (None,), "measured": (None, equations), "predicted": (None, equations)}
    check_shapes(path, arrays, shapes, "rows")
    check_motion(path, arrays)
    if "replay_time" in arrays:
        _check_replay(path, arrays)
    return arrays


def _check_replay(path: Path, arrays: Arrays) -> None:
    n = arrays["joints"].size
    shapes: dict[str, tuple[int | None, ...]] = {"replay_time": (None,)}
    check_shapes(path, arrays, {**shapes, "replay_q": (None, n), "replay_measured": (None, n)}, "instants")
    check_shapes(path, arrays, {"replay_starts": (None,), "replay_stops": (None,)}, "windows")
    check_shapes(path, arrays, {"replay_end": (None,)}, "numbers")
    starts, stops, end = (arrays[f"replay_{name}"] for name in ("starts", "stops", "end"))
    count = arrays["replay_time"].size
    ordered = bool((starts < stops).all() and starts.min() >= 0 and stops.max() <= count <= NUMBERS)
    if not ordered or end.size != 3 or not 0 <= end[0] < len(Outcome):
        raise InputError(f"{path}: expected windows of a simulated motion")


def replay_of(arrays: Arrays, sign_width: float = 0.0) -> Replay | None:
    """The simulated motion; None where there was none.

    Parameters
    ----------
    arrays : dict
        See `read_verification_curves`.
    sign_width : float
        See `Replay`.
    """
    if "replay_time" not in arrays:
        return None
    outcome, failed, left_out = arrays["replay_end"].tolist()
    q = arrays["replay_q"].astype(float)
    return Replay(
        outcome=list(Outcome)[int(outcome)],
        time=arrays["replay_time"],
        q=q,
        dq=np.zeros_like(q),
        starts=tuple(arrays["replay_starts"].tolist()),
        failed_at=failed if np.isfinite(failed) else None,
        sign_width=sign_width,
        stops=tuple(arrays["replay_stops"].tolist()),
        left_out=int(left_out),
    )
