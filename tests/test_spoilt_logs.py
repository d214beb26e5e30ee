"""Logs that a benchmark degrades: what each degradation does to a log, and what it leaves alone."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from excite.logs.log import Log
from regressors.errors import InputError

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks" / "degradation"))
from spoil import Degradation, degrade

sys.path.pop(0)
RATE = 1000.0
FRICTION = np.tile([2.0, -3.0], (2001, 1))


@cache
def clean() -> Log:
    """Two joints for 2 s at 1 kHz; every number of a channel is another one."""
    time = np.arange(2001) / RATE
    q = np.column_stack([np.sin(3 * time), np.cos(2 * time)])
    return Log("LOG", "", ("a", "b"), time, q, 2 * q, 10 * q + time[:, None], temperature=30 + q)


def degraded(seed: int = 0, **options: Any) -> Log:
    return degrade(clean(), Degradation(**options), seed, FRICTION)


def channels(log: Log) -> np.ndarray:
    return np.column_stack([log.q, log.dq, log.effort, log.temperature])


def test_nothing_is_done_by_default() -> None:
    assert degraded().identity == clean().identity


@pytest.mark.parametrize("share", [0.001, 0.06, 0.5])
def test_held_rows_repeat_the_row_before_under_their_own_stamps(share: float) -> None:
    log = degraded(hold=share)
    np.testing.assert_array_equal(log.time, clean().time)
    true, seen = channels(clean()), channels(log)
    held = np.any(seen != true, axis=1)
    assert np.count_nonzero(held) == round(share * 2000)
    assert not held[0]
    np.testing.assert_array_equal(seen[held], seen[np.flatnonzero(held) - 1])


@pytest.mark.parametrize("share", [0.01, 0.3])
def test_dropped_rows_are_missing_and_the_others_stay(share: float) -> None:
    log = degraded(drop_rows=share)
    assert log.count == 2001 - round(share * 1999)
    kept = np.searchsorted(clean().time, log.time)
    np.testing.assert_array_equal(log.time, clean().time[kept])
    np.testing.assert_array_equal(channels(log), channels(clean())[kept])
    assert log.time[[0, -1]].tolist() == [0.0, 2.0]


def test_late_stamps_are_as_far_apart_as_said_and_never_early() -> None:
    log = degraded(clock_jitter=(0.0007, 0.0085))
    np.testing.assert_array_equal(channels(log), channels(clean()))
    between, late = np.diff(log.time), log.time - clean().time
    assert between.min() == pytest.approx(0.0007, rel=1e-6)  # behind a long wait the host catches up
    assert 0.006 < between.max() <= 0.0085 + 1e-12
    assert between.mean() == pytest.approx(0.001, rel=0.01)  # the host keeps up
    assert late.min() >= 0
    assert late.max() < 0.05


def test_late_stamps_follow_from_the_recursion() -> None:
    """Row by row: a host that waits, then reads as fast as it can."""
    rng, waits = np.random.default_rng([4, 4]), []
    share = 0.5 * 0.0003 / (0.0003 + 0.0075 / 2)
    long = rng.random(2001) < share
    drawn = rng.uniform(0, 0.0075, 2001), rng.uniform(0, 0.0003, 2001)
    for k in range(2001):
        before = waits[-1] - 0.0003 if waits else 0.0
        waits.append(max(before, drawn[0][k] if long[k] else drawn[1][k]))
    late = degraded(seed=4, clock_jitter=(0.0007, 0.0085)).time - clean().time
    np.testing.assert_allclose(late, waits, atol=1e-12)


@pytest.mark.parametrize(("delay", "rows"), [((0.004,), (4, 4)), ((0.0, 0.007), (0, 7)), ((-0.003,), (-3, -3))])
def test_torques_are_those_of_earlier_rows(delay: tuple[float, ...], rows: tuple[int, int]) -> None:
    log = degraded(delay=delay)
    np.testing.assert_array_equal(log.q, clean().q)
    for k, shift in enumerate(rows):
        np.testing.assert_allclose(log.effort[20:-20, k], clean().effort[20 - shift : 2001 - 20 - shift, k], atol=1e-12)


def test_noise_on_a_log_is_seeded() -> None:
    one, same, other = (degraded(seed, coloured_noise=(2.0,)) for seed in (1, 1, 2))
    assert one.identity == same.identity != other.identity


def test_an_option_leaves_the_random_numbers_of_the_others() -> None:
    alone, both = degraded(hold=0.06), degraded(hold=0.06, coloured_noise=(1.0,), clock_jitter=(0.0005, 0.01))
    np.testing.assert_array_equal(alone.q, both.q)


def test_friction_that_drifts_must_be_known() -> None:
    with pytest.raises(InputError, match="needs the friction"):
        degrade(clean(), Degradation(friction_drift=-0.1))


def test_a_log_without_torques_is_recorded_all_the_same() -> None:
    log = degrade(replace(clean(), effort=None), Degradation(delay=(0.1,), hold=0.1))
    assert log.effort is None
    assert np.any(log.q != clean().q)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"clock_jitter": (0.0012, 0.0085)}, "rows are sampled every 0.001 s"),
        ({"clock_jitter": (0.0007, 0.0009)}, "rows are sampled every 0.001 s"),
        ({"delay": (0.001, 0.002, 0.003)}, "delay needs one value, or 2"),
    ],
)
def test_what_cannot_be_done_to_a_log(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        degraded(**options)
