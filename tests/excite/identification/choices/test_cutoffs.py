"""Candidates of the cutoff, and which is taken."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.identification.choices.cutoff_and_timing import choose_cutoff, cutoff_candidates
from excite.identification.choices.left_out import LeftOut
from excite.logs.signals.butterworth import edge


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


@pytest.mark.parametrize(
    ("duration", "rate", "lowest", "count"), [(40.0, 1000.0, 1.367, 9), (10.0, 100.0, 4.375, 4), (1.0, 100.0, None, 0)]
)
def test_candidates_of_usual_logs(duration: float, rate: float, lowest: float | None, count: int) -> None:
    candidates = cutoff_candidates(duration, rate)
    assert len(candidates) == count
    assert not candidates or candidates[0] == pytest.approx(lowest, rel=1e-3)


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


@pytest.mark.parametrize(("optimum", "end"), [(1e-3, 0), (1e5, -1)])
def test_an_optimum_beyond_the_candidates_is_their_end(optimum: float, end: int) -> None:
    candidates = cutoff_candidates(40.0, 1000.0)
    scored, asked = scored_with(optimum)
    _, choice = choose_cutoff(candidates, scored)
    assert choice.value == pytest.approx(candidates[end], rel=5e-3)
    assert min(asked) >= candidates[0]
    assert max(asked) <= candidates[-1]


def test_of_equals_the_lowest_is_taken() -> None:
    """What no error tells apart passes least noise into the accelerations."""
    scored, _ = scored_with(10.0, slope=0.0)
    candidates = cutoff_candidates(40.0, 1000.0)
    assert choose_cutoff(candidates, scored)[1].value == pytest.approx(candidates[0], rel=5e-3)


def test_one_candidate() -> None:
    scored, asked = scored_with(10.0)
    assert choose_cutoff([35.0], scored)[0] == 35.0
    assert asked == [35.0]
