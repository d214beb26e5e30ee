"""Methods as operators: against the dense matrix that single impulses show, column by column."""

from __future__ import annotations

import numpy as np
import pytest

from excite.logs.signals import savitzky_golay
from excite.logs.signals.butterworth import Butterworth, Differences
from excite.logs.signals.fourier_fit import FourierFit
from excite.logs.signals.method import Method
from excite.logs.signals.savitzky_golay import SavitzkyGolay
from excite.logs.signals.smoothing_spline import SmoothingSpline
from regressors.samples import Array

RATE, COUNT = 100.0, 203
TIME = 3.0 + np.arange(COUNT) / RATE
METHODS = {
    "differences": Differences(),
    "butterworth": Butterworth(cutoff=12.0),
    "savitzky-golay": SavitzkyGolay(window=0.2),
    "fourier": FourierFit(period=1.9, harmonics=4),
    "spline": SmoothingSpline(knots=0.1),
    "spline of each joint": SmoothingSpline(knots=(0.1, 0.25, 0.1)),
}


def positions(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, 3)
    motion = np.sin(2 * np.pi / 1.9 * np.array([1, 2, 3]) * TIME[:, None] + phase)
    return np.asarray(motion + 1e-3 * rng.standard_normal(motion.shape))


def dense(method: Method) -> Array:
    """Matrices from the positions of each joint to q, dq and ddq, shape (3, joints, M, N)."""
    columns = []
    for k in range(COUNT):
        impulse = np.zeros((COUNT, 3))
        impulse[k] = 1.0
        samples = method.motion(TIME, impulse).samples
        columns.append(np.stack([samples.q.T, samples.dq.T, samples.ddq.T]))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("name", METHODS)
def test_an_operator_acts_as_the_dense_matrix_of_its_method(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(savitzky_golay, "_LONG", 1)  # by transforms
    method, q = METHODS[name], positions(1)
    found = method.operator(TIME, positions(0))(q)
    expected = np.einsum("djmk,kj->dmj", dense(method), q)
    for values, true in zip((found.samples.q, found.samples.dq, found.samples.ddq), expected, strict=True):
        np.testing.assert_allclose(values, true, rtol=0, atol=1e-11 * np.abs(true).max())
    np.testing.assert_array_equal(found.samples.time, TIME[found.kept])


@pytest.mark.parametrize(
    "method",
    [Butterworth(), SavitzkyGolay(), FourierFit(), FourierFit(period=1.9), SmoothingSpline()],
    ids=lambda method: repr(method),
)
def test_an_operator_keeps_the_settings_that_its_method_chose(method: Method) -> None:
    """Whatever other positions it meets: those of the first ones are not chosen anew."""
    time = np.arange(800) / RATE
    smooth = np.sin(2 * np.pi / 1.9 * np.array([1.0, 2.0]) * time[:, None])
    noise = 0.05 * np.random.default_rng(2).standard_normal(smooth.shape)
    settled = method.settled(time, smooth)
    found, expected = method.operator(time, smooth)(smooth + noise), settled.motion(time, smooth + noise)
    assert settled.settled(time, smooth + noise) == settled
    assert found.kept == expected.kept
    np.testing.assert_allclose(found.samples.ddq, expected.samples.ddq, rtol=0, atol=1e-9 * np.abs(noise).max() * RATE)


def test_splines_keep_the_knots_that_each_joint_was_given() -> None:
    time = np.arange(600) / RATE
    rng = np.random.default_rng(3)
    q = np.column_stack([np.sin(3 * time), np.sin(40 * time)]) + 1e-2 * rng.standard_normal((600, 2))
    settled = SmoothingSpline().settled(time, q)
    assert isinstance(settled.knots, tuple)
    assert settled.knots[0] > 2 * settled.knots[1]
    chosen, kept = (method.motion(time, q).samples for method in (SmoothingSpline(), settled))
    np.testing.assert_array_equal(chosen.ddq, kept.ddq)
