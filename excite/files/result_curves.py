"""``curves.npz``: what the figures of an identification show of its logs, and the measured motion.

| array | shape | |
|---|---|---|
| ``time``, ``log``, ``equation`` | (m,) | instant [s], log and equation of each row |
| ``measured``, ``predicted`` | (m,) | both sides of the row [unit of its equation] |
| ``every`` | () | 1, or k where only the rows of every k-th instant are in the file |
| ``motion_time``, ``motion_log`` | (K,) | instants of the motion [s], and their logs |
| ``motion_q`` | (K, n) | positions of ``joints`` [rad or m] |
| ``joints`` | (n,) | names |
| ``history_time``, ``history`` | (h,), (h, p) | estimates over time, of the recursive method only |
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from excite.identification.identification import Identification
from excite.identification.preparation import PreparedLog
from excite.storage.curves_file import NUMBERS, Arrays, chosen, every, read_curves, short
from regressors.errors import InputError
from regressors.samples import Array, Index

CURVES = "curves.npz"
_ROWS = ("time", "log", "equation", "measured", "predicted")
_INSTANTS = 3000  # of estimates over time


def result_curves(result: Identification) -> Arrays:
    """Arrays of the file."""
    observations = result.observations
    step = every(2 * len(observations.y))
    kept = _every(observations.time, observations.log, step)
    arrays: Arrays = {
        "time": observations.time[kept],
        "log": observations.log[kept].astype(np.int16),
        "equation": observations.equation[kept].astype(np.int16),
        "measured": short(observations.y[kept]),
        "predicted": short(result.estimate.predicted(observations)[kept]),
        "every": np.array(step),
        **motion_arrays(result.prepared),
    }
    if result.estimate.history is not None:
        time, path = result.estimate.history
        part = chosen(time.size, _INSTANTS)
        arrays |= {"history_time": time[part], "history": short(path[part])}
    return arrays


def _every(time: Array, log: Index, step: int) -> Index:
    """Rows of every k-th instant."""
    new = np.concatenate([[True], (time[1:] != time[:-1]) | (log[1:] != log[:-1])])
    return np.flatnonzero((np.cumsum(new) - 1) % step == 0)


def motion_arrays(parts: tuple[PreparedLog, ...]) -> Arrays:
    """Instants and positions of logs, few enough for a player."""
    kept = [chosen(part.samples.time.size) for part in parts]
    pairs = list(zip(parts, kept, strict=True))
    return {
        "joints": np.array(parts[0].log.joints),
        "motion_time": np.concatenate([part.samples.time[index] for part, index in pairs]),
        "motion_log": np.repeat(np.arange(len(parts)), [index.size for index in kept]).astype(np.int16),
        "motion_q": np.concatenate([part.samples.q[index] for part, index in pairs]),
    }


def read_result_curves(path: Path, logs: int, equations: int) -> Arrays:
    """Arrays of the file of a result."""
    arrays = read_curves(path)
    check_shapes(path, arrays, dict.fromkeys(_ROWS, (None,)), "rows")
    check_motion(path, arrays)
    if not _within(arrays["log"], logs) or not _within(arrays["equation"], equations):
        raise InputError(f"{path}: expected rows of {logs} log(s) and {equations} equation(s)")
    if not _within(arrays["motion_log"], logs):
        raise InputError(f"{path}: expected the motion of {logs} log(s)")
    return arrays


def _within(numbers: Index, count: int) -> bool:
    return numbers.dtype.kind == "i" and numbers.size > 0 and numbers.min() >= 0 and numbers.max() < count


def check_motion(path: Path, arrays: Arrays) -> None:
    """Raise `InputError` where the arrays of the motion are missing or do not fit each other."""
    joints = arrays.get("joints")
    if joints is None or joints.dtype.kind != "U" or joints.ndim != 1:
        raise InputError(f"{path}: expected names of joints")
    shapes = {"motion_time": (None,), "motion_log": (None,), "motion_q": (None, joints.size)}
    check_shapes(path, arrays, shapes, "instants of the motion")


def check_shapes(path: Path, arrays: Arrays, shapes: dict[str, tuple[int | None, ...]], what: str) -> None:
    """Raise `InputError` unless all arrays hold numbers, as many of them, in their shapes."""
    counts = set()
    for name, shape in shapes.items():
        array = arrays.get(name)
        if array is None or array.dtype.kind not in "fiu" or array.ndim != len(shape):
            raise InputError(f"{path}: expected numbers under {name!r}")
        if array.shape[1:] != shape[1:] or array.size > 20 * NUMBERS:
            raise InputError(f"{path}: expected numbers under {name!r}")
        counts.add(array.shape[0])
    if len(counts) != 1 or 0 in counts:
        raise InputError(f"{path}: expected as many {what} under each of {', '.join(shapes)}")
