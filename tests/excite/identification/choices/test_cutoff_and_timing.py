"""Candidates of the cutoff and which is taken; delays inside their intervals; rows of moving drives."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, strategies as st
from observed import statistics_of
from played import irp6, noisy, played, three_joints

from excite.identification.choices.cutoff_and_rows import choose_cutoff, cutoff_candidates, preferred_rows
from excite.identification.choices.delays import DelayLikelihood, choose_delay
from excite.identification.choices.left_out import LeftOut, left_out, time_blocks
from excite.identification.identify import identify
from excite.logs.signals.filters import edge


@given(st.floats(0.05, 1e4), st.floats(1.0, 1e4))
def test_candidates_leave_nine_tenths_of_a_log_and_stay_below_the_rate(duration: float, rate: float) -> None:
    candidates = cutoff_candidates(duration, rate)
    assert candidates == sorted(candidates)
    for cutoff in candidates:
        assert cutoff <= 0.35 * rate * (1 + 1e-12)
        assert 2 / cutoff <= 0.05 * duration * (1 + 1e-12)
        assert edge(rate, cutoff) <= 0.05 * duration * rate + 1
    if candidates:
        assert candidates[-1] == pytest.approx(0.35 * rate)
        assert 2 / (candidates[0] / 2) > 0.05 * duration  # no further one would do
        np.testing.assert_allclose(np.diff(np.log2(candidates)), 1.0)
    else:
        assert 2 / (0.35 * rate) > 0.05 * duration


def scored_with(optimum: float, slope: float = 0.5):
    """Errors that grow with the distance from an optimum on the logarithmic scale; counts of what was asked."""
    asked = []

    def scored(cutoff: float) -> LeftOut:
        asked.append(cutoff)
        size = np.exp(slope * abs(np.log2(cutoff / optimum)))
        return LeftOut(np.full((5, 1), 0.01 * size**2), 5, np.array([5.0]))

    return scored, asked


@pytest.mark.parametrize("optimum", [2.0, 7.0, 24.0, 90.0, 260.0])
def test_a_planted_optimum_is_found_to_a_quarter_octave(optimum: float) -> None:
    scored, asked = scored_with(optimum)
    cutoff, choice = choose_cutoff(cutoff_candidates(40.0, 1000.0), scored)
    assert cutoff == choice.value
    assert abs(np.log2(choice.value / optimum)) <= 0.25 / 2 + 0.01
    assert len(asked) == len(set(asked)) == len(choice.candidates) <= 9 + 4
    assert [c.value for c in choice.candidates] == sorted(asked)
    best = min(choice.candidates, key=lambda c: c.score)
    assert choice.value == pytest.approx(best.value, rel=5e-3)
    assert f"low-passed at {choice.value:g} Hz" in choice.reason
    assert "(350 Hz: " in choice.reason


def test_an_optimum_beyond_the_candidates_is_their_end() -> None:
    """Of equals the highest is taken, which takes least of the motion away."""
    candidates = cutoff_candidates(40.0, 1000.0)
    for optimum, slope, end in ((1e-3, 0.5, 0), (1e5, 0.5, -1), (10.0, 0.0, -1)):
        scored, asked = scored_with(optimum, slope)
        _, choice = choose_cutoff(candidates, scored)
        assert choice.value == pytest.approx(candidates[end], rel=5e-3)
        assert min(asked) >= candidates[0]
        assert max(asked) <= candidates[-1]
    scored, asked = scored_with(10.0)
    assert choose_cutoff([35.0], scored)[0] == 35.0
    assert asked == [35.0]


@pytest.mark.parametrize(("growth", "scatter", "end"), [(0.0004, 0.003, -1), (0.01, 1e-4, 0)])
def test_a_gain_within_its_standard_error_costs_no_bandwidth(growth: float, scatter: float, end: int) -> None:
    """Errors that grow with every octave: a lower cutoff is taken only where the blocks agree that it gains."""
    candidates, ups = cutoff_candidates(40.0, 1000.0), np.array([1.0, -1.0, 1.0, -1.0, 0.0])

    def scored(cutoff: float) -> LeftOut:
        octaves = np.log2(cutoff / candidates[0])
        return LeftOut(0.01 * np.exp(2 * octaves * (growth + scatter * ups))[:, None], 5, np.array([5.0]))

    value, choice = choose_cutoff(candidates, scored)
    assert value == pytest.approx(candidates[end], rel=5e-3)
    assert ("+-" in choice.reason) == (end == -1)


@pytest.mark.parametrize(
    ("all_rows", "moving", "low", "chosen"),
    [
        (1.0, 1.005, 1.3, "of moving drives"),  # alike, with a much higher cutoff
        (1.0, 1.005, 20.0, "all"),
        (1.0, 1.1, 1.3, "all"),
        (1.1, 1.0, 20.0, "of moving drives"),
        (1.0, 1.005, None, "all"),
    ],
)
def test_rows_of_moving_drives_win_by_errors_or_by_bandwidth(
    all_rows: float, moving: float, low: float | None, chosen: str
) -> None:
    errors = {"all": all_rows, "of moving drives": moving}
    left_out = {name: LeftOut(np.full((5, 1), 0.01 * e**2), 5, np.array([5.0])) for name, e in errors.items()}
    name, reason = preferred_rows({"all": low, "of moving drives": 35.0}, left_out)
    assert name == chosen
    assert ("35 Hz" in reason) == (chosen != "all" and low == 1.3)


TIME = np.arange(0.0, 8.0, 0.008)
RNG = np.random.default_rng(0)
FREQUENCIES, PHASES = RNG.uniform(2.0, 20.0, (3, 4)), RNG.uniform(0, 6, (3, 4))


def columns(time: np.ndarray) -> np.ndarray:
    """Three columns of each of two equations, sums of sines."""
    waves = np.sin(time[:, None, None] * FREQUENCIES + PHASES).sum(axis=2)
    return np.stack([waves, np.roll(waves, 1, axis=1)], axis=1)


def delayed_by(delay: float, noise: float, seed: int):
    """Left-out errors of torques that were recorded some time after the columns."""
    torque = columns(TIME - delay) @ np.array([2.0, -1.0, 0.5])
    torque = torque + noise * np.random.default_rng(seed).normal(size=torque.shape)
    blocks = time_blocks([TIME])

    def scored(tried: float) -> LeftOut:
        return left_out(statistics_of(columns(TIME - tried), torque, *blocks))

    def residuals(_: np.ndarray, tried: float) -> list[np.ndarray]:
        W = columns(TIME - tried)
        fit = np.linalg.lstsq(W.reshape(-1, 3), torque.ravel(), rcond=None)[0]
        return list((torque - W @ fit).T)

    return scored, residuals


@pytest.mark.parametrize("delay", [0.004, -0.006, 0.0015, 0.018, 0.031, -0.044])
def test_planted_delays_are_found_within_their_intervals(delay: float) -> None:
    found, choice = choose_delay(*delayed_by(delay, 0.1, 1), 0.008)
    low, high = choice.interval
    assert low <= delay <= high
    assert low < found < high
    assert 2 * 0.0008 < high - low < 2 * 0.0015  # a tenth of the sample time is the resolution
    assert (choice.value, choice.unit) == (found, "s")
    assert ("ms before them" if delay > 0 else "ms after them") in choice.reason
    assert [c.value for c in choice.candidates] == sorted(c.value for c in choice.candidates)
    assert 0.0 in [c.value for c in choice.candidates]


def test_intervals_cover() -> None:
    """99 % intervals: of 20 experiments, at most 1 may miss."""
    choices = [choose_delay(*delayed_by(0.003, 0.3, seed), 0.008)[1] for seed in range(20)]
    assert sum(not choice.interval[0] <= 0.003 <= choice.interval[1] for choice in choices) <= 1
    found, choice = choose_delay(*delayed_by(0.08, 0.1, 1), 0.008)  # beyond the longest
    assert (found, choice.interval) == (0.0, None)
    assert choose_delay(*delayed_by(0.05, 0.1, 1), 0.008)[0] == pytest.approx(0.05, abs=2e-4)


def test_delays_far_beyond_the_longest_are_not_looked_for() -> None:
    scored, residuals = delayed_by(0.1, 0.1, 1)
    likelihood = DelayLikelihood.of(residuals(np.ones(2), 0.05), scored(0.05))
    found, _ = likelihood.found(partial(residuals, np.ones(2)), 0.05, 0.005, 0.008)
    assert 0.05 < found <= 0.06


def test_a_row_on_the_wrong_side_of_a_reversal_moves_no_delay() -> None:
    """Noise alone, but for one row of a hundred deviations that only a delay of 3 ms explains."""
    scored, residuals = delayed_by(0.0, 0.1, 1)
    reversal = np.arange(TIME.size) == 400

    def with_reversal(weights: np.ndarray, tried: float) -> list[np.ndarray]:
        return [row + 10.0 * reversal * (abs(tried - 0.003) > 0.001) for row in residuals(weights, tried)]

    found, choice = choose_delay(scored, with_reversal, 0.008)
    low, high = choice.interval
    assert found == 0.0
    assert low < 0.0 < high
    assert high - low < 2 * 0.0015


def test_no_delay_is_exactly_none() -> None:
    for noise, seed in ((0.0, 0), (0.01, 0), (0.01, 1), (1.0, 0), (1.0, 1), (1.0, 2)):
        found, choice = choose_delay(*delayed_by(0.0, noise, seed), 0.008)
        low, high = choice.interval
        assert (found, choice.value) == (0.0, 0.0)
        assert low < 0.0 < high
        assert "no delay" in choice.reason


C = irp6().transmission.coupling[:3, :3]


def test_rows_of_moving_drives_choose_where_friction_does_what_it_likes_at_others() -> None:
    """Near standstill the friction of each drive is off by up to its own size, for a while at a time."""
    log, rng = noisy(played(three_joints(), 3, seconds=6.0), 1.0, 0.0, 1), np.random.default_rng(1)
    slow = np.abs(log.dq @ C.T) < 0.03
    held = np.repeat(rng.uniform(-1, 1, (len(slow) // 10 + 1, 3)), 10, axis=0)[: len(slow)]
    sticking = replace(log, effort=log.effort + (40.0 * slow * held) @ C, sha256="sticking")
    result = identify("irp6", sticking, choose=("cutoff", "delay", "standstill"))
    assert ("rows", "of moving drives") in [(choice.name, choice.value) for choice in result.choices]
    assert result.recipe.delay == 0.0
    assert result.recipe.standstill
    assert np.all(np.abs(result.estimate.values - result.reference.values) <= result.estimate.half_width)
    assert any("rows of moving drives" in choice.reason for choice in result.choices)
