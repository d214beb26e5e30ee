"""Motion under measured torques: the truth gives the motion back, at order four, and failures are told by outcomes."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from motions import order_of, random_fourier
from refused import refusal

from excite.information.target import IdentificationTarget, target_of
from excite.simulation.replay import Outcome, Replay, chosen_windows, windowed_motion
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.models.nominal import parameter_values
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, Stribeck
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.samples import Array

CALM = FrictionCurves({f"z{k}": CoulombViscous(0.0, 20.0) for k in range(1, 6)})
SETTINGS = SimulationSettings(rate=500.0, torque_limits=False)


motion = partial(random_fourier, seed=1, duration=2.0, size=0.15, harmonics=3)


@cache
def target(drives: tuple[str, ...] | None = None) -> IdentificationTarget:
    return target_of(built_in("irp6"), Task("irp6", drives=drives))


@cache
def run(friction: bool = True, rate: float = 500.0) -> Simulation:
    curves = None if friction else CALM
    return simulate_motion(built_in("irp6"), Task("irp6"), motion(3), replace(SETTINGS, rate=rate), friction=curves)


def truth(found: Simulation, which: IdentificationTarget) -> Array:
    return parameter_values(which.model, which.base, dict(found.truth))


def replayed_run(found: Simulation, beta: Array | None = None, horizon: float = 9.0, **options: Any) -> Replay:
    """The motion under the run's torques, from one window where no horizon is given."""
    which, samples = options.pop("which", target()), found.run.samples
    values = truth(found, which) if beta is None else beta
    given = {"torque": found.run.effort, "q": samples.q, "dq": samples.dq, **options}
    return windowed_motion(which.model, values, which.base, samples.time, horizon=horizon, **given)


def with_one(name: str, value: float) -> Array:
    """The true parameters but for one."""
    beta = truth(run(), target()).copy()
    beta[list(target().base.names).index(name)] = value
    return beta


def test_the_truth_gives_the_motion_back() -> None:
    found = run()
    replayed = replayed_run(found, sign_width=found.steps.width)
    assert replayed.ok
    assert (replayed.failed_at, replayed.starts) == (None, (0,))
    # where friction turns the torques jump between two samples
    np.testing.assert_allclose(replayed.q, found.run.samples.q, atol=1e-3)
    np.testing.assert_allclose(replayed.dq, found.run.samples.dq, atol=1e-2)


def test_smooth_motion_comes_back_at_the_order_of_the_torques() -> None:
    errors = []
    for rate in (100.0, 200.0, 400.0):
        found = run(False, rate)
        errors.append(float(np.abs(replayed_run(found).q - found.run.samples.q).max()))
    assert min(order_of(errors)) > 3.7
    assert errors[-1] < 1e-5


@pytest.mark.parametrize("horizon", [0.004, 0.1, 0.3, 5.0])
def test_windows_start_anew_from_the_measured_state(horizon: float) -> None:
    samples = run().run.samples
    replayed = replayed_run(run(), 1.05 * truth(run(), target()), horizon)
    starts = list(range(0, 1000, round(500 * horizon)))
    assert replayed.starts == tuple(starts)
    error = np.abs(replayed.q - samples.q)
    assert np.all(np.isfinite(error))
    assert error[starts].max() < 1e-13 < error.max()


def test_a_choice_of_windows_is_simulated_as_among_all() -> None:
    """Also where the robot is lighter, so that the sign of friction is wider, than in any of the chosen windows."""
    found, beta = run(), 1.05 * truth(run(), target())
    beta[list(target().base.names).index("X2")] *= -9.0
    q = found.run.samples.q + np.where(np.arange(1001) == 50, 0.88, 0.0)[:, None] * np.array([0.0, -1.0, 1.0])
    every, some, enough = (replayed_run(found, beta, 0.1, q=q, most=most) for most in (None, 7, 20))
    np.testing.assert_array_equal(enough.q, every.q)
    assert (every.left_out, enough.left_out, some.left_out) == (0, 0, 13)
    assert some.sign_width == every.sign_width
    assert some.starts == tuple(50 * chosen_windows(20, 7))
    assert some.bounds == tuple((first, 1001 if first == 950 else first + 50) for first in some.starts)
    seen = np.isin(np.arange(1001), some.rows)
    for name in ("q", "dq"):
        np.testing.assert_array_equal(getattr(some, name)[seen], getattr(every, name)[seen])
        assert np.all(np.isnan(getattr(some, name)[~seen]))


def test_an_estimate_that_is_no_robot_somewhere_is_told_of_windows_left_out() -> None:
    """Its mass matrix is positive definite where the motion begins, and not where it ends."""
    found, which = run(), target()
    samples, beta = found.run.samples, with_one("X2", -9.0 * truth(run(), target())[which.base.names.index("X2")])
    q = samples.q + np.linspace(0.0, 1.2, 1001)[:, None] * np.array([0.0, -1.0, 1.0])
    given = (which.model, beta, which.base, samples.time, found.run.effort, q, samples.dq, 0.02)
    one = windowed_motion(*given, most=1)
    assert (one.starts, one.outcome, one.failed_at) == ((0,), Outcome.NOT_POSITIVE, 1.52)
    assert np.all(np.isfinite(one.q[:10]))
    before = windowed_motion(*(x[:700] if np.shape(x)[:1] == (1001,) else x for x in given), most=1)
    assert before.ok


def test_an_estimate_that_is_no_robot_or_runs_away_is_told() -> None:
    replayed = replayed_run(run(), with_one("X3", -1.0))
    assert (replayed.ok, replayed.outcome, replayed.failed_at) == (False, Outcome.NOT_POSITIVE, 0.0)
    assert np.all(np.isnan(replayed.q[1:]))
    np.testing.assert_allclose(replayed.q[0], run().run.samples.q[0])
    away = replayed_run(run(), with_one("F1v", -300.0))
    assert away.outcome is Outcome.RAN_AWAY
    assert 0.0 < away.failed_at < 2.0
    k = round(away.failed_at * 500)
    assert np.all(np.isfinite(away.q[:k]))
    assert np.all(np.isnan(away.q[k:]))


def test_windows_that_fail_leave_the_others() -> None:
    effort = run().run.effort.copy()
    effort[500] = np.nan
    replayed = replayed_run(run(), horizon=0.1, torque=effort)
    assert replayed.outcome is Outcome.RAN_AWAY
    lost = np.flatnonzero(np.isnan(replayed.q[:, 0]))
    assert set(lost) <= set(range(498, 550))  # a cubic reaches two samples back
    assert 501 in lost


def test_a_partial_motion_moves_its_drives_only() -> None:
    """Drive 2 alone: q3 = -q2, as the parallelogram holds the forearm's direction."""
    which = target(("z2",))
    N = which.motion.matrix
    moving = Trajectory(motion(1).family, N @ motion(1).x)
    found = simulate_motion(built_in("irp6"), Task("irp6"), moving, SETTINGS, friction=CALM)
    samples = found.run.samples
    np.testing.assert_allclose(samples.q[:, 1] + samples.q[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(replayed_run(found, which=which).q, samples.q, atol=1e-6)


def test_friction_curves_take_their_part() -> None:
    curves = FrictionCurves({f"z{k}": Stribeck(Side(8.0, 26.0, 12.0), Side(5.0, 20.0, 6.0), 0.5) for k in (1, 2, 3)})
    found = simulate_motion(built_in("irp6"), Task("irp6"), motion(3), SETTINGS, friction=curves)
    which = target_of(built_in("irp6"), Task("irp6", friction=False))
    with_curves = replayed_run(found, which=which, friction=curves, sign_width=found.steps.width)
    np.testing.assert_allclose(with_curves.q, found.run.samples.q, atol=2e-3)
    assert np.abs(replayed_run(found, which=which).q - found.run.samples.q).max() > 1e-2


TIME, STILL = np.arange(5) / 100.0, np.zeros((5, 3))


def test_bad_input_is_told() -> None:
    good = {"model": target().model, "beta": truth(run(), target()), "base": target().base, "horizon": 1.0}
    good |= {"time": TIME, "torque": STILL, "q": STILL, "dq": STILL}
    for changes, message in (
        ({"beta": np.ones(3)}, "expected 13 finite base parameters"),
        ({"beta": np.full(13, np.nan)}, "expected 13 finite base parameters"),
        ({"torque": np.zeros((5, 2))}, r"torques of shape \(5, 3\) and states of 3 joints, given \(5, 2\)"),
        ({"q": np.zeros((5, 2)), "dq": np.zeros((5, 2))}, "states of 3 joints"),
        ({"time": np.array([0.0, 1.0, 2.0, 3.0, 5.0])}, "uniform sample times: resample first"),
        ({"time": np.zeros(1)}, "two instants or more, given 1"),
        ({"sign_width": 0.0}, "sign_width must be greater than zero"),
        ({"sign_width": 1e-7}, r"sign_width 1e-07 needs \d+ steps per sample of 0.01 s, more than 20"),
        ({"horizon": 0.001}, "a horizon of 0.001 s is shorter than a sample of 0.01 s"),
        ({"q": STILL[:2]}, "5 instants, but q of shape"),
    ):
        assert re.search(message, refusal(windowed_motion, **good | changes))


# --- which windows of a long motion ----------------------------------------------------------------------------------


def test_one_window_is_chosen_in_each_stretch_and_every_part_of_a_repeated_motion_alike() -> None:
    """1200 windows by twenties: at equal distances all would be the first of their period."""
    for count, most in ((1, 1), (1, 60), (60, 60), (61, 60), (91, 60), (120, 60), (1200, 60), (1201, 7), (5, 1)):
        chosen = chosen_windows(count, most)
        edges = np.arange(min(most, count) + 1) * count // min(most, count)
        assert chosen.size == min(most, count)
        assert np.all((chosen >= edges[:-1]) & (chosen < edges[1:]))
    for period in (2, 5, 10, 20, 40):
        phase = chosen_windows(1200, 60) % period / period
        assert np.mean(phase < 0.5) == pytest.approx((period + 1) // 2 / period, abs=0.07)
        assert np.unique(phase).size >= min(period, 20) * 0.75
