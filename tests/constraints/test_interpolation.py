"""Curves through samples, and the extrema of their pieces: as SciPy has them, and as a slow oracle finds them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.interpolate import BPoly, CubicSpline, PPoly, interp1d, make_interp_spline

from constraints.enclosure import hulled_extrema, piecewise_extrema
from constraints.interpolation import Curve, curve_pieces, curves_text, interpolated_limits
from constraints.linear import LinearConstraint
from regressors.samples import Array, Samples

QUANTITIES = ("position", "velocity", "acceleration", "jerk")


def samples(seed: int, count: int = 12, joints: int = 2) -> Samples:
    """Samples of no motion in particular at uneven instants, at rest at both ends."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.1, 1.0, count)) - 0.1
    q, dq, ddq = rng.normal(size=(3, count, joints))
    dq[[0, -1]] = ddq[[0, -1]] = 0.0
    return Samples(time, q, dq, ddq, np.full_like(q, np.nan))


def of_scipy(s: Samples, curve: Curve, given: int) -> object:
    """SciPy's own curve."""
    if curve is Curve.LINES:
        return interp1d(s.time, s.q, axis=0)
    if curve is Curve.CUBICS and given == 0:
        return CubicSpline(s.time, s.q, bc_type="clamped")
    if curve is Curve.CUBICS:
        return BPoly.from_derivatives(s.time, np.stack([s.q, s.dq], axis=1))
    if given < 2:
        rest = [(1, np.zeros(2)), (2, np.zeros(2))]
        return make_interp_spline(s.time, s.q, 5, bc_type=(rest, rest))
    return BPoly.from_derivatives(s.time, np.stack([s.q, s.dq, s.ddq], axis=1))


CURVES = [(curve, given) for curve in Curve for given in (0, 1, 2)]


@pytest.mark.parametrize(("curve", "given"), CURVES)
def test_curves_are_those_of_scipy(curve: Curve, given: int) -> None:
    s = samples(0)
    fine = np.linspace(s.time[0], s.time[-1], 999)
    values = PPoly(curve_pieces(s, curve, given), s.time)(fine)
    np.testing.assert_allclose(values, of_scipy(s, curve, given)(fine), rtol=0.0, atol=1e-10)


def bounds(order: int, matrix: Array, upper: float) -> LinearConstraint:
    k = len(matrix)
    labels = tuple(f"f{i} {QUANTITIES[order]}" for i in range(k))
    most = np.full(k, upper)
    return LinearConstraint(order, matrix, np.linspace(0.1, 0.2, k), -most, most, labels, ("1",) * k)


@pytest.mark.parametrize(("curve", "given"), [(c, g) for c, g in CURVES if c is not Curve.LINES])
@pytest.mark.parametrize("order", range(4))
def test_extrema_are_those_of_a_slow_oracle(curve: Curve, given: int, order: int) -> None:
    s, matrix = samples(1), np.array([[1.0, 0.0], [0.5, -1.0], [1.0, 1.0]])
    pieces = PPoly(curve_pieces(s, curve, given), s.time).derivative(order)
    u = np.linspace(0.0, 1.0, 4001)  # both ends of every piece, with the polynomial of that piece
    local = np.diff(s.time)[:, None] * u
    powers = local[None] ** np.arange(len(pieces.c) - 1.0, -1.0, -1.0)[:, None, None]
    motion = np.einsum("pkn,pku->kun", pieces.c, powers).reshape(-1, 2)
    limit = bounds(order, matrix, 1.0)
    values = np.abs(motion @ matrix.T + limit.offset).max(axis=0)
    uses = {use.label: use for use in interpolated_limits([limit], s, curve, given).uses}
    for label, largest in zip(limit.labels, values, strict=True):
        assert abs(uses[label].extreme) == pytest.approx(largest, rel=1e-5)
        assert abs(uses[label].extreme) >= largest * (1.0 - 1e-9)


def test_differences_of_lines_never_pass_what_the_motion_keeps() -> None:
    """Each is a mean of the derivative, at uneven instants too: those of sin t reach at most 1."""
    rng = np.random.default_rng(2)
    time = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 4 * np.pi, 400)), [4 * np.pi]])
    q = (1 - np.cos(time)[:, None]) / 2  # at rest at both ends
    still = np.zeros_like(q)
    s = Samples(time, q, still, still, still)
    for order, largest in enumerate((1.0, 0.5, 0.5)):
        (use,) = interpolated_limits([bounds(order, np.eye(1), largest + 0.1 * (order == 0))], s, Curve.LINES).uses
        assert use.use == pytest.approx(1.0, abs=0.02)
        assert use.use <= 1.0 + 1e-9


@pytest.mark.parametrize(("factor", "kept"), [(1.0, True), (1.0 - 0.9e-6, True), (1.0 - 1.1e-6, False)])
def test_a_millionth_of_a_bound_may_be_passed(factor: float, kept: bool) -> None:
    s = samples(3)
    largest = abs(interpolated_limits([bounds(2, np.eye(2), 1.0)], s, Curve.QUINTICS).uses[0].extreme)
    broken = interpolated_limits([bounds(2, np.eye(2), factor * largest)], s, Curve.QUINTICS).broken
    assert (len(broken) == 0) is kept


def test_texts_name_the_curve_the_limit_and_the_amount() -> None:
    s, wide, narrow = samples(4), bounds(0, np.eye(2), 100.0), bounds(3, np.eye(2), 1.0)
    all_kept = [interpolated_limits([wide], s, curve) for curve in Curve]
    assert curves_text(all_kept) == "kept by lines, cubics and quintics"
    jerks = interpolated_limits([wide, narrow], s, Curve.QUINTICS)
    named = f"kept by lines and cubics; quintics pass {jerks.uses[0].label} by > 1000 %"
    assert curves_text([*all_kept[:2], jerks]) == named
    use = jerks.uses[0]
    assert jerks.to_dict() == {"curve": "quintics", "holds": False, "closest": use.label, "use": use.use}


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
