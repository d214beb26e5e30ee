"""The whole way from logs to parameters, on motions whose torques Pinocchio and hand arithmetic made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import (
    EXACT,
    LOAD,
    PERIOD,
    TASK,
    curves,
    described,
    found,
    irp6,
    mixed,
    periodic,
    played,
    three_joints,
)

from excite.identification.covariance import condition_number
from excite.identification.estimator import Context
from excite.identification.estimators.robust import commanded, instruments
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.logs.log import Log
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.fourier import Fourier
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in
from regressors.robot.friction.curves import FrictionCurves

# Rotor inertias seen through the gears, from the numbers of the description
GEARED = {1: 7.658e-05 * 158.0**2, 2: 7.658e-05 * 167.5**2, 3: 7.658e-05 * 167.5**2, 4: 4.0e-5 * 128.0**2}


def test_the_differential_model_gives_the_truth_back(log: Log) -> None:
    result = found(TASK, log)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-10)
    assert result.recipe.sign_width == result.recipe.breakaway == 0.0
    # and the truth is the arithmetic of the description
    known = standard_values(built_in("irp6"))
    truth = dict(zip(result.names, described(result), strict=True))
    held = known["m4"] + known["m5"]  # at the tip of the forearm, to which the wrist is fixed
    assert (truth["F1c"], truth["F2c"], truth["F3v"]) == (28.0, 28.75, 26.0 + 8.0)  # drive 4 turns with drive 3
    # rotors are in the diagonal terms, and a mass that is held far out makes them larger
    own = known["I3zz"] + GEARED[3] + GEARED[4]
    assert own < truth["X4"] < own + 2.0 * held
    upper = known["I2zz"] + GEARED[2] + 0.455**2 * (known["m3"] + held)
    assert truth["X3"] - truth["X4"] == pytest.approx(upper, rel=1e-9)


@pytest.mark.parametrize("window", ["short", "long"])
@pytest.mark.parametrize(("friction", "tolerance"), [(None, 2e-4), (FrictionCurves(curves()), 2e-7)])
def test_the_energy_model_gives_the_truth_back(window: str, friction: FrictionCurves | None, tolerance: float) -> None:
    # with friction in it, power jumps between two samples
    result = found(Task("irp6", model="energy", window=window), played(three_joints(), 3, 1000.0), friction=friction)
    truth = described(result)
    np.testing.assert_allclose(result.estimate.values, truth, atol=tolerance * np.abs(truth).max())
    assert len(truth) == (13 if friction is None else 7)


def test_a_load_is_given_back() -> None:
    for task, tolerance in (
        (Task("irp6", model="load"), 1e-12),
        (Task("irp6", model="load-integral", window="long"), 1e-8),
        (Task("irp6", model="load-integral", window_length=0.01), 1e-8),
        (Task("irp6", model="load", equations=("fx", "fy", "fz", "ny", "nz")), 1e-11),
    ):
        result = found(task, played(periodic(np.eye(5), 3), 5, 500.0, load=LOAD))
        np.testing.assert_allclose(result.estimate.values, LOAD, atol=tolerance)


def test_partial_motions_give_their_part_of_the_truth_back() -> None:
    for chosen, directions, names in (
        ({"drives": ("2",)}, mixed([0.0, 1.0, -1.0]), "X3 X7 F2c F2v"),
        ({"joints": ("1", "3")}, mixed([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), "X1 X4 X5 X6 F1c F3c F1v F3v"),
    ):
        result = found(Task("irp6", **chosen), played(periodic(directions, 2), 3))
        assert " ".join(result.estimate.names) == names
        np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-9)


def test_a_common_low_pass_leaves_the_truth_where_it_is() -> None:
    log = played(three_joints(), 3, 500.0, 6.0)
    whole, filtered = (found(TASK, log, recipe=replace(EXACT, low_pass=hz, covariance="white")) for hz in (None, 4.0))
    assert len(filtered.observations.y) < len(whole.observations.y) / 10
    np.testing.assert_allclose(filtered.estimate.values, whole.estimate.values, rtol=1e-9)


def test_every_estimator_finds_it(log: Log) -> None:
    for estimator in ("huber", "least-squares", "physical", "recursive", "weighted"):
        result = found(TASK, log, recipe=replace(EXACT, estimator=estimator))
        np.testing.assert_allclose(result.estimate.values, described(result), rtol=2e-4)


# ---------------------------------------------------------------- laws


def test_rows_of_a_log_are_a_shorter_log(noise: Log) -> None:
    recipe = Recipe(rows="101:500")
    cut = replace(noise.rows(slice(100, 500)), source="cut")
    of_rows = found(TASK, noise, recipe=recipe)
    of_cut = found(TASK, cut, recipe=replace(recipe, rows="all"))
    np.testing.assert_array_equal(of_rows.estimate.values, of_cut.estimate.values)


def test_two_logs_are_their_equations_together(noise: Log) -> None:
    recipe = Recipe(rows="all", estimator="least-squares", sign_width=0.0)
    parts = [replace(noise.rows(part), source=f"log{k}") for k, part in enumerate((slice(0, 420), slice(420, 800)))]
    both = found(TASK, *parts, recipe=recipe)
    alone = [found(TASK, part, recipe=recipe).observations for part in parts]
    W, y = (np.concatenate([getattr(o, name) for o in alone]) for name in ("W", "y"))
    np.testing.assert_allclose(both.estimate.values, np.linalg.solve(W.T @ W, W.T @ y), rtol=1e-9)
    assert both.observations.logs == ("log0", "log1")


def test_torques_in_other_units_scale_the_estimate(noise: Log) -> None:
    recipe = Recipe(rows="all", sign_width=0.0)
    once, doubled = (found(TASK, replace(noise, effort=k * noise.effort), recipe=recipe) for k in (1.0, 2.0))
    np.testing.assert_allclose(doubled.estimate.values, 2.0 * once.estimate.values, rtol=1e-10)
    np.testing.assert_allclose(doubled.estimate.deviation, 2.0 * once.estimate.deviation, rtol=1e-6)


def test_condition_number_is_that_of_the_stacked_equations(log: Log) -> None:
    result = found(TASK, log)
    assert result.condition_number == pytest.approx(np.linalg.cond(result.observations.W), rel=1e-9)
    W = result.observations.W.copy()
    W[:, 3] = W[:, 0] - 2.0 * W[:, 1]
    assert condition_number(replace(result.observations, W=W)) == np.inf


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
    other = Trajectory(Fourier(PERIOD, 3), 0.3 * np.random.default_rng(9).normal(size=(3, 5)))
    with pytest.raises(InputError, match=r"^LOG does not follow the design's motion: it deviates by \d+ %"):
        commanded(other, follower(0.0))


def test_instruments_are_the_regressor_of_the_commanded_motion() -> None:
    target, part = target_of(irp6(), TASK), follower(0.2, noise=1e-4)
    Z = instruments(commanded_motion(), Context(target, (part, part), EXACT))
    W = target.model.assemble(follower(0.2).samples)[:, target.base.index]
    assert Z.shape == (2 * len(W), target.base.rank)
    smooth = [k for k, name in enumerate(target.base.names) if name.startswith("X")]
    np.testing.assert_allclose(Z[: len(W), smooth], W[:, smooth], atol=0.02)
    np.testing.assert_array_equal(Z[: len(W)], Z[len(W) :])
