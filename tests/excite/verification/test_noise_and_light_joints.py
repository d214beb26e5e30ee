"""A good model is believed on a noisy log and with a light wrist; a wrong one is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from identified import with_estimate
from played import EXACT, found, noisy, played, three_joints
from written_files import saved

from excite.identification.identification import Identification
from excite.identification.result_json import load_result
from excite.logs.log import Log
from excite.logs.signals.periods import measurement_noise
from excite.simulation.replay import Outcome, Replay
from excite.storage.records import json_of
from excite.tasks.further_settings import Tolerances
from excite.tasks.task import Task
from excite.verification.simulated_motion import longest_replay, motion_remarks, shortest_horizon
from excite.verification.verdict import corrected_errors
from excite.verification.verify import verify
from regressors.samples import Array, Samples

TIME = np.arange(2000) / 200.0
TORQUE = np.column_stack([10 * np.sin(2 * np.pi * 0.4 * TIME), 0.5 * np.cos(2 * np.pi * 0.3 * TIME)])


# ---------------------------------------------------------------- noise


@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 0.3])
@pytest.mark.parametrize("noise", [0.0, 0.3, 2.0])
def test_the_error_without_noise_is_that_of_the_model(share: float, noise: float) -> None:
    size = np.sqrt(np.mean(TORQUE**2, axis=0))
    inside = 0
    for seed in range(10):
        measured = TORQUE + noise * size * np.random.default_rng(seed).normal(size=TORQUE.shape)
        predicted = (1 - share) * TORQUE
        level = measurement_noise(measured, measured - predicted, 200.0, 4.0)
        each, whole = corrected_errors(measured, predicted, level)
        inside += whole.least <= share + 0.003
        for error, true in zip(each, size, strict=True):
            assert error.noise == pytest.approx(noise * true, rel=0.12, abs=0.003 * true)
        assert whole.relative == pytest.approx(share, abs=0.003 + 0.15 * noise)
        if share == 0.3 and noise < 1.0:
            assert whole.least > 0.1
    assert inside >= 9  # it is a bound with a confidence of 99 %


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    log = noisy(played(three_joints(), 3, seconds=4.0), 0.3, 1e-6, 1)
    return load_result(saved(tmp_path_factory.mktemp("result"), found(Task("irp6"), log, recipe=EXACT)))


@pytest.fixture(scope="module")
def mostly_noise() -> Log:
    """Another motion, 86 % of whose error is noise of the measurement."""
    return noisy(played(three_joints(4), 3, seconds=20.0, source="NOISY"), 40.0, 1e-6, 2)


def test_noise_of_the_measurement_does_not_speak_against_a_result(result: Identification, mostly_noise: Log) -> None:
    v = verify(result, mostly_noise, signals="butterworth")
    assert v.holds
    assert v.relative_error > 0.4
    assert v.corrected_total.relative < 0.1
    assert any("most is noise of the measurements" in remark for remark in v.verdict.remarks)
    content = json_of(v)
    assert content["relative_error"] == v.relative_error
    assert content["corrected_error"] == v.corrected_total.relative
    assert [part["noise"] for part in content["corrected"]] == pytest.approx([40.0] * 3, rel=0.1)


@pytest.mark.parametrize(("factor", "but"), [(1.4, ""), (0.0, "masses")])
def test_noise_does_not_hide_a_wrong_result(result: Identification, mostly_noise: Log, factor: float, but: str) -> None:
    """Parameters are wrong by a factor, of friction only or all but it."""
    factors = [factor if name.startswith("F") == (but == "masses") else 1.0 for name in result.names]
    wrong = with_estimate(result, fit=result.coefficients * factors)
    v = verify(wrong, mostly_noise, signals="butterworth")
    assert not v.holds
    assert "more than 10 %; the error of" in v.verdict.text
    assert "does not generalise" in v.verdict.text


# ---------------------------------------------------------------- joints of little inertia


def simulated(measured: Samples, inertia: Array, horizon: float, torque: Array, gravity: Array) -> Replay:
    """Motion of bodies of some inertia under torques less those of gravity, restarted after each horizon."""
    step, count = TIME[1], TIME.size
    starts = tuple(range(0, count - 1, round(horizon / step)))
    acceleration = (torque - gravity) / inertia
    q = np.empty_like(measured.q)
    for first, last in zip(starts, (*starts[1:], count), strict=True):
        at, speed = measured.q[first].copy(), measured.dq[first].copy()
        for k in range(first, last):
            q[k] = at
            at = at + step * speed + step**2 / 2 * acceleration[k]
            speed = speed + step * acceleration[k]
    far = np.abs(q - measured.q).max() > 50.0
    q = np.where(np.abs(q - measured.q) > 50.0, np.nan, q)
    outcome = Outcome.RAN_AWAY if far else Outcome.DONE
    return Replay(outcome, TIME, q, np.zeros_like(q), starts, (*starts[1:], TIME.size), 0.1 if far else None, 0.01)


@pytest.mark.parametrize(("wrist", "longest"), [(1.0, 0.5), (1e-5, 0.25), (1e-6, 0.0625)])
def test_a_light_wrist_that_runs_away_is_simulated_over_less_time(wrist: float, longest: float) -> None:
    """The model's torques are wrong by 2.8 % of a load that is carried."""
    inertia, carried = np.array([1.0, wrist]), np.array([3.0, 0.5]) * np.ones_like(TORQUE)
    w = 2 * np.pi * np.array([0.4, 0.3])
    q = 0.5 * np.sin(np.multiply.outer(TIME, w))
    measured = Samples(TIME, q, 0.5 * w * np.cos(np.multiply.outer(TIME, w)), -(w**2) * q, np.zeros_like(q))
    tried = list[float]()

    def simulate(horizon: float) -> Replay:
        tried.append(horizon)
        return simulated(measured, inertia, horizon, inertia * measured.ddq + carried, 1.028 * carried)

    replay, horizon = longest_replay(simulate, 0.5, shortest_horizon(TIME))
    assert tried == [0.5 / 2**k for k in range(len(tried))]
    assert (tried[-1], horizon, replay.ok) == (longest, longest, True)
    remarks = motion_remarks(replay, horizon, 0.5)
    assert remarks == () if horizon == 0.5 else "diverges within 0.5 s" in remarks[0]
    lost = replace(replay, outcome=Outcome.RAN_AWAY, failed_at=0.1)
    assert (
        "cannot be simulated (the motion diverges (at 0.100 s), over shorter" in motion_remarks(lost, horizon, 0.5)[0]
    )


def test_a_simulated_motion_that_drifts_is_a_remark_where_the_torques_are_right(result: Identification) -> None:
    log = noisy(played(three_joints(4), 3, seconds=4.0, source="OTHER"), 0.3, 1e-6, 2)
    v = verify(result, log, signals="butterworth", tolerances=Tolerances(motion=1e-6))
    assert v.verdict.holds
    assert any("as light joints do: q1 by" in remark for remark in v.verdict.remarks)
