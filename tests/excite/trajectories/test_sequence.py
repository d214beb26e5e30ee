"""A motion again, slowly and with stops: derivatives, its path, its limits, and whole samples."""

from __future__ import annotations

import numpy as np
import pytest

from excite.trajectories import Fourier, Trajectory
from excite.trajectories.sequence import EXCITE, MotionSequence, Piece, again
from regressors.samples import Array, Samples

RATE, PERIOD = 100.0, 3.37
MOTION = Trajectory(Fourier(PERIOD, 4), np.random.default_rng(0).normal(0.0, 0.3, (2, Fourier(PERIOD, 4).size)))


def whole(kept: float = np.inf) -> MotionSequence:
    motions = (MOTION, *again(MOTION, RATE, lambda samples: bool(np.abs(samples.ddq).max() <= kept)))
    return MotionSequence(tuple(Piece(EXCITE, each, round(each.duration * RATE)) for each in motions))


def test_derivatives_are_those_of_finite_differences() -> None:
    step = 1e-5
    for motion in again(MOTION, RATE, lambda _: True):
        time = np.linspace(0.1, motion.duration - 0.1, 997) + 1e-4
        before, at, after = (motion.samples(time + k * step) for k in (-1, 0, 1))
        for value, rate in (("q", "dq"), ("dq", "ddq"), ("ddq", "dddq")):
            slope = (getattr(after, value) - getattr(before, value)) / (2 * step)
            jumps = np.abs(at.dddq).max() * 1e-3  # of a jerk where a move ends
            np.testing.assert_allclose(getattr(at, rate), slope, atol=2e-4 + (jumps if rate == "dddq" else 0.0))


def test_positions_are_those_of_the_path_and_no_velocity_is_higher() -> None:
    samples, segments = whole().sampled()
    path = MOTION.samples(np.linspace(0.0, PERIOD, 200_001))

    def far(q: Array) -> float:
        return float(np.abs(path.q - q).max(axis=1).min())

    assert max(far(q) for q in samples.q[::17]) < 1e-4
    assert (np.abs(samples.dq).max(axis=0) <= np.abs(path.dq).max(axis=0) + 1e-9).all()
    assert set(segments) == {EXCITE}


def test_pieces_meet_at_rest_on_one_sample() -> None:
    sequence = whole()
    samples, _ = sequence.sampled()
    assert np.allclose(np.diff(samples.time), 1 / RATE)
    assert samples.time[-1] == pytest.approx(sequence.duration) == sequence.steps / RATE
    ends = np.cumsum([piece.steps for piece in sequence.pieces])
    assert np.abs(samples.dq[ends]).max() == 0.0
    np.testing.assert_allclose(samples.q[ends], np.tile(samples.q[0], (3, 1)), atol=1e-12)
    held = np.abs(samples.dq[ends[1] :]).max(axis=1) == 0.0
    assert 0.3 < held.mean() < 0.6


def test_moves_are_gentler_where_a_limit_would_be_exceeded() -> None:
    def most(samples: Samples) -> float:
        return float(np.abs(samples.ddq).max())

    free, limit = whole(), most(MOTION.sampled(1000.0))
    stops = again(MOTION, RATE, lambda samples: most(samples) <= 0.5 * limit)[1]
    assert most(stops.samples(np.linspace(0.0, stops.duration, 20_001))) <= 0.5 * limit * 1.001
    assert stops.duration > free.pieces[2].motion.duration
