"""Biases: rows near standstill left out or allowed for, and noise in the measured motion."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from observed import observations_of
from played import EXACT, PERIOD, TASK, described, found, irp6, noisy, played, three_joints

from excite.design.optimisation import design_trajectory
from excite.identification.biases import (
    _Beside,
    allowing_for_nuisances,
    allowing_for_standstill,
    fails_near_standstill,
    fast_rows,
    motion_noise,
    standstill_candidates,
    without_standstill,
)
from excite.identification.equations import equations_of
from excite.identification.estimator import Context, Estimate
from excite.identification.estimators.least_squares import Weighted, weighted
from excite.identification.identification import Identification
from excite.identification.identify import identify
from excite.identification.preparation import prepare
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.logs.log import Log
from excite.simulation.simulate import simulate
from excite.tasks.search import Search
from excite.tasks.task import Task
from regressors.samples import Array

EXACTLY = replace(EXACT, sign_width=0.0)
C = irp6().transmission.coupling[:3, :3]


def slow(log: Log, speed: float) -> Array:
    """Rows of each joint's equation in which a drive that acts on it is slow, by hand."""
    dz = np.abs(log.dq @ C.T)
    return np.column_stack([np.any((dz < speed) & (np.abs(C[:, j]) > 0), axis=1) for j in range(3)])


def test_rows_of_slow_drives_are_left_out(log: Log) -> None:
    """Of the joints that carry their torque: drive 2 of the IRp-6 acts on joint 2 only, drive 3 on joints 2 and 3."""
    result = found(TASK, log, recipe=replace(EXACTLY, standstill=0.05))
    whole = found(TASK, log, recipe=EXACTLY)  # none are left out unless asked
    assert (whole.prepared[0].standing, len(whole.observations.y)) == ((), 3 * log.count)
    expected = np.flatnonzero(~slow(log, 0.05).ravel())
    assert 0 < expected.size < 0.95 * len(whole.observations.y)
    np.testing.assert_allclose(result.observations.W, whole.observations.W[expected], atol=1e-9)
    assert len({np.sum(result.observations.equation == j) for j in range(3)}) > 1
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-9)
    assert any(note.startswith("rows left out while a drive is slower than 0.05") for note in result.prepared[0].notes)


@pytest.mark.parametrize("changes", [{"every": 3}, {"low_pass": 10.0}])
def test_decimated_equations_leave_the_same_stretches_out(changes: dict) -> None:
    long = played(three_joints(), 3, seconds=3 * PERIOD)
    result = found(TASK, long, recipe=replace(EXACTLY, standstill=0.05, **changes))
    part, observations = result.prepared[0], result.observations
    at = np.searchsorted(part.samples.time, observations.time - 1e-9)
    assert not np.any(slow(replace(long, dq=part.samples.dq), 0.05)[at, observations.equation])


def test_candidates_are_parts_of_the_typical_speed(log: Log) -> None:
    result = found(TASK, log)
    candidates = standstill_candidates(result.target, result.prepared)
    typical = np.median(np.sqrt(np.mean((log.dq @ C.T) ** 2, axis=0)))
    assert candidates[0] == 0.0
    assert list(candidates) == sorted(candidates)
    assert candidates[2] == pytest.approx(0.02 * typical, rel=1e-6)
    energy = found(Task("irp6", model="energy"), log)
    assert standstill_candidates(energy.target, energy.prepared) == (0.0,)


@pytest.mark.parametrize(("share", "count"), [(0.05, 3), (1e-4, 7)])
def test_candidates_keep_the_rows_of_a_slow_drive_but_not_of_one_that_rests(share: float, count: int, log: Log) -> None:
    result = found(TASK, log)
    (part,), of_first = result.prepared, np.array([share, 1.0, 1.0])
    samples = replace(part.samples, q=part.samples.q * of_first, dq=part.samples.dq * of_first)
    candidates = standstill_candidates(result.target, [replace(part, samples=samples)])
    slowest = np.abs(samples.dq[:, 0] * C[0, 0]).max()
    assert len(candidates) == count
    assert bool(candidates[-1] <= 0.5 * slowest) == (count < 7)


def test_a_drive_that_rests_makes_no_equations(log: Log) -> None:
    result = found(TASK, log)
    part = result.prepared[0]
    still = replace(part.samples, dq=part.samples.dq * [0.0, 1.0, 1.0])
    left = without_standstill(replace(part, samples=still), result.target, 0.01)
    assert not np.any(equations_of(result.target, left, result.recipe).equation == 0)


@pytest.mark.slow
def test_parameters_of_a_robot_that_sticks_are_not_biased() -> None:
    """Under a soft controller, whose joints stand wherever they turn; else errors are many times larger."""
    design = design_trajectory("irp6", search=Search(starts=1, executor="serial"))
    errors = {speed: [] for speed in (0.0, 0.01)}
    for seed in range(2):
        sensors = {"torque_noise": (0.5,), "encoder": (4000,), "rate": 1000.0, "seed": seed}
        log = simulate(design, controller="pd", bandwidth=3.0, breakaway="auto", **sensors)
        for speed, found_ones in errors.items():
            result = identify("irp6", log, design=design, recipe=Recipe(standstill=speed), choose=False)
            found_ones.append(np.abs(result.estimate.values / result.reference.values - 1))
    assert np.max(errors[0.0]) > 5 * np.max(errors[0.01])
    assert np.max(errors[0.01]) < 0.03


@pytest.fixture(scope="module")
def noisy_log() -> Log:
    return noisy(played(three_joints(), 3, seconds=6.0), 1.0, 0.0, 0)


def sticking(noisy_log: Log, size: float, speed: float = 0.05) -> Log:
    """Friction of drive 3 that is smaller near standstill than its model says."""
    dz = noisy_log.dq @ C[2]
    return replace(noisy_log, effort=noisy_log.effort - size * np.outer(np.sign(dz) * (np.abs(dz) < speed), C[2]))


def context_of(result: Identification) -> Context:
    return Context(result.target, result.prepared, result.recipe)


def slowest(result) -> Array:
    """Least speed of the drives of each row, by hand."""
    dz = np.abs(result.prepared[0].samples.dq @ C.T)
    each = np.column_stack([np.where(np.abs(C[:, j]) > 0, dz, np.inf).min(axis=1) for j in range(3)])
    return each.ravel()


def allowed(result: Identification, context: Context) -> tuple[Estimate, Estimate]:
    """The weighted estimate, and the one that allows for standstill."""
    plain = Weighted().estimate(result.observations)
    return plain, allowing_for_standstill(plain, Weighted(), result.observations, context)


def test_friction_that_is_right_changes_nothing(noisy_log: Log) -> None:
    result = found(TASK, noisy_log, recipe=EXACTLY)
    np.testing.assert_array_equal(fast_rows(result.observations, context_of(result), 0.1), slowest(result) >= 0.1)
    plain, wider = allowed(result, context_of(result))
    assert wider is plain


def test_where_friction_holds_the_change_without_slow_rows_enters(noisy_log: Log) -> None:
    result = found(TASK, sticking(noisy_log, 20.0), recipe=EXACTLY)
    speeds = np.sqrt(np.mean((result.prepared[0].samples.dq @ C.T) ** 2, axis=0))
    fast = slowest(result) >= 0.1 * np.median(speeds)
    assert fails_near_standstill(result.estimate, result.observations, fast)
    plain, wider = allowed(result, context_of(result))
    change = Weighted().estimate(result.observations.rows(np.flatnonzero(fast))).values - plain.values
    np.testing.assert_allclose(wider.covariance, plain.covariance + np.outer(change, change), rtol=1e-6)
    truth = np.array([result.target.robot.transmission.drives[2].coulomb])
    place = result.names.index("F3c")
    assert abs(plain.values[place] - truth) > plain.half_width[place]
    assert abs(plain.values[place] - truth) < wider.half_width[place]
    assert any("where friction is uncertain" in note for note in wider.notes)


def test_where_rows_are_left_out_twice_the_speed_is_tried(noisy_log: Log) -> None:
    result = found(TASK, noisy_log, recipe=replace(EXACTLY, standstill=0.05))
    plain, wider = allowed(result, context_of(result))
    fast = fast_rows(result.observations, context_of(result), 0.1)
    assert 0 < np.count_nonzero(~fast) < fast.size
    change = Weighted().estimate(result.observations.rows(np.flatnonzero(fast))).values - plain.values
    np.testing.assert_allclose(wider.covariance, plain.covariance + np.outer(change, change), rtol=1e-6)


def test_what_only_slow_rows_show_has_an_interval_as_wide_as_itself(noisy_log: Log) -> None:
    """Friction of drives that hardly move in any row that is compared with."""
    result = found(TASK, noisy_log, recipe=EXACTLY)
    part = result.prepared[0]
    moved = replace(part.samples, dq=part.samples.dq * [1.0, 1e-3, 1e-3])
    slow = Context(result.target, (replace(part, samples=moved),), replace(EXACTLY, standstill=1e-2))
    plain, wider = allowed(result, slow)
    place = result.names.index("F3c")
    assert wider.deviation[place] >= abs(plain.values[place])


RECIPE = Recipe(rows="all", cutoff=40.0, sign_width=0.0)
NOISE = 3e-4


@pytest.fixture(scope="module")
def exact() -> Log:
    return played(three_joints(), 3, seconds=4.0)


@pytest.mark.parametrize(("stretch", "delay"), [(2**16, 0.0), (500, 0.01)])
def test_the_noise_has_the_size_that_passes_the_filter(exact, stretch, delay, monkeypatch) -> None:
    monkeypatch.setattr("excite.identification.biases._NOISE_STRETCH", stretch)
    recipe, target = replace(RECIPE, delay=delay), target_of(irp6(), TASK)
    clean = prepare(exact, irp6(), target, recipe)
    for seed in (1, 2):
        part = prepare(noisy(exact, 0.0, NOISE, seed), irp6(), target, recipe)
        drawn, _ = motion_noise(part, target, recipe, "ddq", seed)
        assert drawn.shape == part.samples.q.shape
        measured = np.std(part.samples.ddq - clean.samples.ddq, axis=0)
        np.testing.assert_allclose(np.std(drawn, axis=0), measured, rtol=0.2)


def test_short_windows_hold_as_much_noise_as_accelerations(exact: Log) -> None:
    """Their rows are differences of velocities, in which noise is a far larger share than in the velocities."""
    log, shares = noisy(exact, 0.0, NOISE, 1), {}
    for window in ("short", "long", None):
        task = TASK if window is None else TASK.changed(model="energy", window=window)
        part = prepare(log, irp6(), target := target_of(irp6(), task), RECIPE)
        shares[window] = motion_noise(part, target, RECIPE, "ddq" if window is None else "dq", 1)[1]
    assert shares["short"] == pytest.approx(shares[None], rel=0.2)
    assert shares["long"] < 0.2 * shares["short"]


def test_what_happens_at_standstill_is_no_noise_of_the_motion(exact: Log) -> None:
    slow = np.min(np.abs(exact.dq @ C.T), axis=1) < 0.04
    shaken = exact.q + 1e-4 * slow[:, None] * np.random.default_rng(0).normal(size=exact.q.shape)
    part = prepare(replace(exact, q=shaken), irp6(), target := target_of(irp6(), TASK), RECIPE)
    every, moving = (motion_noise(part, target, replace(RECIPE, standstill=v), "ddq")[1] for v in (0.0, 0.08))
    assert moving < 0.2 * every


def test_motions_that_are_no_linear_function_of_positions_have_none_nor_exact_ones(exact: Log) -> None:
    part = prepare(exact, irp6(), target := target_of(irp6(), TASK), RECIPE)
    for change in ({"average": True, "period": 2.0}, {"measured_velocity": True}, {"signals": "spline"}):
        assert motion_noise(part, target, replace(RECIPE, **change), "ddq") is None
    result = found(TASK, noisy(exact, 0.3, 0.0, 0), recipe=RECIPE)
    assert not any("noise in the motion" in note for note in result.estimate.notes)


def missed(result: Identification) -> int:
    return int(np.sum(np.abs(result.estimate.values - result.reference.values) > result.estimate.half_width))


def test_intervals_reach_the_truth_although_the_estimate_is_biased(exact: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    results = [found(TASK, noisy(exact, 0.3, NOISE, seed), recipe=RECIPE) for seed in range(4)]
    assert any("noise of the positions shifts" in note for note in results[0].estimate.notes)
    assert sum(missed(r) for r in results) <= 2
    monkeypatch.setattr("excite.identification.procedure.allowing_for_motion_noise", lambda estimate, *_: estimate)
    without = [found(TASK, noisy(exact, 0.3, NOISE, seed), recipe=RECIPE) for seed in range(4)]
    assert sum(missed(r) for r in without) > 8


def test_a_hidden_offset_is_in_the_intervals_that_count_it() -> None:
    clean = played(three_joints(5), 3)
    size = np.sqrt(np.mean(clean.effort**2, axis=0))
    log = noisy(replace(clean, effort=clean.effort + 0.005 * size), 1.0, 0.0, 1)
    plain = found(TASK, log)
    wider = allowing_for_nuisances(plain.estimate, plain.observations, context_of(plain))
    np.testing.assert_array_equal(wider.values, plain.estimate.values)
    assert missed(replace(plain, estimate=wider)) == 0 < missed(plain)
    assert any("an offset of 0.5 % of the measured torques" in note for note in wider.notes)
    along = found(TASK.changed(offset=True), log)
    assert allowing_for_nuisances(along.estimate, along.observations, context_of(along)) is along.estimate


def test_errors_of_columns_beside_have_the_moments_of_their_posterior() -> None:
    """Against the normal equations of all unknowns at once, with the prior of the columns' errors."""
    rng = np.random.default_rng(5)
    W, G = rng.normal(size=(400, 3)), rng.normal(size=(400, 2))
    W[:, 0] += 3 * G[:, 0]
    y = W @ np.ones(3) + G @ np.array([0.5, -0.2]) + 4.0 * rng.normal(size=400)
    observations, A = observations_of(W, y), np.hstack([W, G])
    context = SimpleNamespace(
        target=SimpleNamespace(model=SimpleNamespace(window=None)), recipe=Recipe(covariance="white")
    )
    moments = _Beside.fitted(weighted(observations), observations, G, context).moments()
    rest = y - A @ np.linalg.lstsq(A, y)[0]
    left = np.linalg.inv(A.T @ A / (rest @ rest / (400 - 5)) + np.diag([0, 0, 0, 1, 1]))
    mean = left @ A.T @ y / (rest @ rest / (400 - 5))
    R = np.linalg.lstsq(W, G)[0]
    np.testing.assert_allclose(moments, R @ (np.outer(mean[3:], mean[3:]) + left[3:, 3:]) @ R.T, rtol=1e-6, atol=1e-9)


def test_windows_in_which_a_drive_sticks_are_allowed_for(noisy_log: Log) -> None:
    energy = TASK.changed(model="energy")
    result = found(energy, noisy_log, recipe=EXACTLY)
    first, last = result.target.model.window.ends(result.prepared[0].samples.time)
    slowest = np.abs(result.prepared[0].samples.dq @ C.T).min(axis=1)
    fast = fast_rows(result.observations, context_of(result), 0.05)
    np.testing.assert_array_equal(fast, (slowest[first] >= 0.05) & (slowest[last] >= 0.05))
    said = [note for note in result.estimate.notes if "where friction is uncertain" in note]
    held = found(energy, sticking(noisy_log, 300.0), recipe=EXACTLY)
    assert not said
    assert any("where friction is uncertain" in note for note in held.estimate.notes)
