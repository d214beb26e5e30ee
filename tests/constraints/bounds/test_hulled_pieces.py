"""Extrema of many polynomial pieces are those of every piece on its own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from constraints.enclosure import hulled_extrema, piecewise_extrema


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 5), st.integers(1, 12), st.floats(1e-3, 10.0))
def test_extrema_are_those_of_all_pieces(seed: int, degree: int, pieces: int, length: float) -> None:
    rng = np.random.default_rng(seed)
    breaks = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, pieces) * length)])
    coefficients = rng.normal(size=(degree + 1, pieces, 3)) / length ** np.arange(degree, -1.0, -1.0)[:, None, None]
    for piece in range(1, pieces):  # continuous
        h = breaks[piece] - breaks[piece - 1]
        coefficients[-1, piece] = [np.polyval(coefficients[:, piece - 1, k], h) for k in range(3)]
    got, slow = hulled_extrema(breaks, coefficients), piecewise_extrema(breaks, coefficients)
    size = np.abs(np.concatenate([slow.low, slow.high])).max()
    assert got.low == pytest.approx(slow.low, abs=1e-9 * size)
    assert got.high == pytest.approx(slow.high, abs=1e-9 * size)


def test_an_extremum_inside_a_piece_is_found() -> None:
    coefficients = np.array([[[-4.0]], [[4.0]], [[0.0]]])  # 4 t (1 - t) on [0, 1]
    found = hulled_extrema(np.array([0.0, 1.0]), coefficients)
    assert (found.low[0], found.high[0], found.high_time[0]) == pytest.approx((0.0, 1.0, 0.5))
