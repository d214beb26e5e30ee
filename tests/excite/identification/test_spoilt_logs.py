"""Logs that are spoilt: the fault is named with its remedy, and no fault of a sound log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, TASK, found, noisy, played, three_joints

from excite.identification.log_faults import NO_FAULT
from excite.identification.spoilt_log import GAIN, FaultSearch, named
from excite.logs.log import Log
from regressors.samples import Array


def sound(seed: int = 3) -> Log:
    return noisy(played(three_joints(seed), 3, seconds=4.0), 1.0, 1e-6, seed)


def torques(change: Callable[[Array], Array]) -> Log:
    log = sound()
    return replace(log, effort=change(log.effort.copy()), sha256="spoilt")


def positions(change: Callable[[Array], Array]) -> Log:
    log = sound()
    return replace(log, q=change(log.q.copy()), dq=None, sha256="spoilt")


def late(y: Array) -> Array:
    return np.vstack([np.repeat(y[:1], 4, axis=0), y[:-4]])


CASES = {
    "torque columns exchanged": (
        torques(lambda y: y[:, [0, 2, 1]]),
        "the torque columns of q2 and q3 are exchanged",
        "the columns that now stand for q1, q3, q2, in this order",
    ),
    "torque columns shifted": (torques(lambda y: np.roll(y, 1, axis=1)), "the torque columns are shifted", "by one"),
    "torque sign": (
        torques(lambda y: y * np.array([1, -1, 1])),
        "the torques of q2 have the opposite sign",
        "`sign: [1, -1, 1]`",
    ),
    "torque unit": (
        torques(lambda y: y * np.array([1, 1e3, 1])),
        "the torques of q2 are in mNm, not in Nm",
        "`unit: [Nm, mNm, Nm]`",
    ),
    "position sign": (
        positions(lambda q: q * np.array([1, -1, 1])),
        "the positions of q2 have the opposite sign",
        "`sign: [1, -1, 1]` for the positions",
    ),
    "all torques late": (torques(late), "all torques are 20 ms later than the positions", "`delay=0.02`"),
    "one channel late": (
        torques(lambda y: np.column_stack([y[:, 0], late(y)[:, 1], y[:, 2]])),
        "the torques of q2 are 20 ms later than those of the other joints",
        "use `delay=(",
    ),
    "magnitudes": (torques(np.abs), "never negative", "record torques with their signs"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_named_with_what_mends_it(case: str) -> None:
    log, what, cure = CASES[case]
    (doubt,) = found(TASK, log, recipe=EXACT).doubts
    assert what in doubt.what
    assert cure in doubt.cure


@pytest.mark.parametrize("seed", range(3))
def test_a_sound_log_is_not_accused(seed: int) -> None:
    result = found(TASK, sound(seed), recipe=EXACT)
    assert result.doubts == ()
    search = FaultSearch.of(result.target, result.prepared, result.friction)
    none = search.plain.fit(NO_FAULT)
    fits = [*search.fits(), *search.late_joints(none)]
    assert named(none, fits) is None
    assert none.size - min(fit.size for fit in fits) < GAIN / 2
