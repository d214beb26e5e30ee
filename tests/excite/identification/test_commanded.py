"""The commanded motion in a log of it, and a load as the joints feel it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_chains import chain_model, inertia
from played import EXACT, LOAD, PERIOD, TASK, irp6

from excite.identification.estimators.instrumental import commanded, instruments
from excite.identification.preparation import PreparedLog
from excite.information.target import target_of
from excite.logs.log import Log
from excite.trajectories import Trajectory
from excite.trajectories.fourier import Fourier
from regressors.errors import InputError
from regressors.models.load import PayloadModel
from regressors.readers.library import built_in
from regressors.samples import Samples


def commanded_motion() -> Trajectory:
    return Trajectory(Fourier(PERIOD, 3), 0.3 * np.random.default_rng(7).normal(size=(3, 5)))


def follower(delay: float, noise: float = 0.0) -> PreparedLog:
    """A log that plays a design so much later, and does not start at time zero."""
    time = 5.0 + np.arange(500) / 200.0
    samples = commanded_motion().samples(np.mod(time - delay, PERIOD))
    q = samples.q + noise * np.random.default_rng(8).normal(size=samples.q.shape)
    return PreparedLog(Log("LOG", "", ("q1", "q2", "q3"), time, q), replace(samples, time=time, q=q), q, ())


@pytest.mark.parametrize("delay", [0.0, 0.137, -0.4, 5.93])
def test_the_commanded_motion_is_found_whenever_it_began(delay: float) -> None:
    part = follower(delay, noise=1e-4)
    motion = commanded(commanded_motion(), part)
    exact = follower(delay).samples
    np.testing.assert_allclose(motion.q, exact.q, atol=2e-5)
    np.testing.assert_allclose(motion.ddq, exact.ddq, atol=2e-3)
    np.testing.assert_array_equal(motion.time, part.samples.time)


def test_another_motion_is_not_taken_for_the_commanded_one() -> None:
    part = follower(0.0)
    other = Trajectory(Fourier(PERIOD, 3), 0.3 * np.random.default_rng(9).normal(size=(3, 5)))
    with pytest.raises(InputError, match=r"^LOG does not follow the design's motion: it deviates by \d+ %"):
        commanded(other, part)


def test_instruments_are_the_regressor_of_the_commanded_motion() -> None:
    target, part = target_of(irp6(), TASK), follower(0.2, noise=1e-4)
    Z = instruments(commanded_motion(), target, (part, part), EXACT)
    W = target.model.assemble(follower(0.2).samples)[:, target.base.index]
    assert Z.shape == (2 * len(W), target.base.rank)
    smooth = [k for k, name in enumerate(target.base.names) if name.startswith("X")]
    np.testing.assert_allclose(Z[: len(W), smooth], W[:, smooth], atol=0.02)
    np.testing.assert_array_equal(Z[: len(W)], Z[len(W) :])


@pytest.mark.parametrize("name", ["irp6", "panda"])
def test_the_load_regressor_is_what_the_load_adds_to_the_torques(name: str) -> None:
    robot = built_in(name)
    rng = np.random.default_rng(5)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 7, robot.n))
    K = PayloadModel(robot).instants(Samples(np.arange(7.0), q, dq, ddq, np.zeros_like(q)))
    bare, loaded = chain_model(robot), chain_model(robot)
    loaded.appendBodyToJoint(loaded.njoints - 1, inertia(LOAD), pin.SE3.Identity())
    extra = [
        pin.rnea(loaded, loaded.createData(), *x) - pin.rnea(bare, bare.createData(), *x)
        for x in zip(q, dq, ddq, strict=True)
    ]
    np.testing.assert_allclose((K @ LOAD).reshape(-1, robot.n), extra, atol=1e-11)
    assert K.shape[1] == 10
