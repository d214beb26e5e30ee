"""The factor of a BFGS approximation against the formula on full matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.design.solvers.descent import BfgsFactor
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)


def hessian(factor: BfgsFactor) -> Array:
    J = np.linalg.inv(factor.J)
    return np.asarray(J.T @ J)


def updated(H: Array, s: Array, y: Array) -> Array:
    """Powell's damped update of H itself."""
    Hs = H @ s
    curvature, sy = s @ Hs, s @ y
    theta = 1.0 if sy >= 0.2 * curvature else 0.8 * curvature / (curvature - sy)
    r = theta * y + (1 - theta) * Hs
    return np.asarray(H - np.outer(Hs, Hs) / curvature + np.outer(r, r) / (s @ r))


def test_it_begins_as_a_multiple_of_the_identity() -> None:
    g = np.array([3.0, 0.0, -4.0])
    np.testing.assert_allclose(hessian(BfgsFactor(g)), 5.0 * np.eye(3), rtol=1e-14)
    assert np.all(np.isfinite(BfgsFactor(np.zeros(3)).J))


@given(SEED, st.floats(-3.0, 3.0))
def test_an_update_is_that_of_the_full_matrix(seed: int, bend: float) -> None:
    """[Powell 1978]: ``H_new s = y`` if s'y >= s'Hs / 5, else with y drawn towards Hs just so far."""
    rng = np.random.default_rng(seed)
    factor = BfgsFactor(rng.normal(size=5))
    for _ in range(4):
        H, s = hessian(factor), rng.normal(size=5)
        y = bend * H @ s + rng.normal(size=5)
        expected = updated(H, s, y)
        factor.update(s, y, factor.whitened(s))
        new = hessian(factor)
        scale = np.linalg.cond(expected) * np.abs(expected).max()
        np.testing.assert_allclose(new, expected, atol=1e-13 * scale)
        assert np.linalg.eigvalsh(new)[0] > 0
        if s @ y >= 0.2 * (s @ H @ s):
            np.testing.assert_allclose(new @ s, y, atol=1e-12 * scale)
        else:
            assert s @ new @ s == pytest.approx(0.2 * (s @ H @ s), rel=1e-6)


def test_a_step_of_no_length_changes_nothing() -> None:
    factor = BfgsFactor(np.ones(4))
    before = factor.J.copy()
    factor.update(np.zeros(4), np.ones(4), np.zeros(4))
    np.testing.assert_array_equal(factor.J, before)


def test_whitened_steps_have_the_length_of_their_curvature() -> None:
    rng = np.random.default_rng(0)
    factor = BfgsFactor(rng.normal(size=6))
    for _ in range(5):
        s = rng.normal(size=6)
        factor.update(s, rng.normal(size=6), factor.whitened(s))
    d = rng.normal(size=6)
    w = factor.whitened(d)
    assert w @ w == pytest.approx(d @ hessian(factor) @ d, rel=1e-9)
