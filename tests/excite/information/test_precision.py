"""Precision that is asked for: what a target allows each parameter and torque, and half-widths that are predicted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from written_files import saved

import excite
from excite.design.design_json import read_precision_target
from excite.information.half_widths import (
    ABOUT_ZERO,
    allowed_half_widths,
    half_width_factor,
    precision_scales,
    residual_degrees_of_freedom,
    torque_precision,
)
from excite.information.precision_forecast import RunInformation
from excite.information.prior import base_sizes, prior_of
from excite.information.target import IdentificationTarget, inverse_half, target_of
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.robot_of_task import robot_and_task
from regressors.errors import InputError, UnknownName


@pytest.fixture(scope="module")
def irp6() -> IdentificationTarget:
    return target_of(*robot_and_task("irp6"))


@pytest.fixture(scope="module")
def ur10e() -> IdentificationTarget:
    return target_of(*robot_and_task("ur10e"))


def _values(target: IdentificationTarget) -> np.ndarray:
    return np.abs(prior_of(target.model, target.base, None).base_values(np.eye(target.base.rank)))


def test_names_go_before_kinds_and_kinds_before_groups(irp6: IdentificationTarget) -> None:
    precision = PrecisionTarget(0.1, parameters={"F1c": 0.01}, groups={"friction": 0.2, "coulomb": 0.05})
    share = dict(zip(irp6.base.names, allowed_half_widths(precision, irp6) / _values(irp6), strict=True))
    assert share == pytest.approx(
        dict.fromkeys(irp6.base.names, 0.1) | {"F1c": 0.01, "F2c": 0.05, "F3c": 0.05}
        | {f"F{k}v": 0.2 for k in (1, 2, 3)}
    )  # fmt: skip
    allowed = allowed_half_widths(PrecisionTarget(None, groups={"gravity": 0.1}), irp6)  # nothing of the others
    assert {name for name, a in zip(irp6.base.names, allowed, strict=True) if np.isfinite(a)} == {"X6", "X7"}


def test_about_zero_the_size_stands_for_the_value(ur10e: IdentificationTarget) -> None:
    scale, value, size = precision_scales(PrecisionTarget(), ur10e), _values(ur10e), base_sizes(ur10e.model, ur10e.base)
    zero, described = value < ABOUT_ZERO * size, np.isfinite(size)
    assert np.sum(zero & described) > 5
    assert np.array_equal(scale[zero & described], size[zero & described])
    assert np.array_equal(scale[~zero & described], value[~zero & described])


def test_friction_that_is_not_described_is_not_asked_for_unless_scaled(ur10e: IdentificationTarget) -> None:
    names = ur10e.base.names
    assert np.isinf(allowed_half_widths(PrecisionTarget(), ur10e)[names.index("F2c")])
    scaled = allowed_half_widths(PrecisionTarget(0.1, scales={"F2c": 10.0}), ur10e)
    assert scaled[names.index("F2c")] == pytest.approx(1.0)


def test_targets_that_mean_nothing(irp6: IdentificationTarget, ur10e: IdentificationTarget) -> None:
    for given, message in (
        ({"share": 0.0}, "above zero"),
        ({"share": None}, "nothing is asked"),
        ({"level": 1.0}, "between 0 and 1"),
        ({"scales": {"X1": -1.0}}, "above zero"),
        ({"groups": {"frictions": 0.1}}, "no group"),
    ):
        with pytest.raises(InputError, match=message):
            PrecisionTarget(**given)
    with pytest.raises(UnknownName, match="X1"):
        allowed_half_widths(PrecisionTarget(parameters={"X99": 0.1}), irp6)
    with pytest.raises(InputError, match="scales"):
        allowed_half_widths(PrecisionTarget(parameters={"F2c": 0.1}), ur10e)
    with pytest.raises(InputError, match="asks nothing"):
        allowed_half_widths(PrecisionTarget(None, groups={"friction": 0.1}), ur10e)
    two = excite.TaskMotion("two", ("q1", "q2"), *(np.zeros((2, 2)),) * 3)
    with pytest.raises(InputError, match="above zero"):
        excite.TaskTorques(0.0, two)
    with pytest.raises(InputError, match="TaskMotion"):
        excite.TaskTorques(0.1, "two.csv")
    with pytest.raises(InputError, match="q3"):
        torque_precision(excite.TaskTorques(0.1, two), irp6)


ROWS, COLUMNS, REPEATS = 40, 3, 4000


def _regressions() -> tuple[np.ndarray, np.ndarray]:
    """Factor of the covariance for noise 0.7, and half-widths of 99 % intervals of repeated least squares."""
    rng = np.random.default_rng(5)
    W = rng.normal(size=(ROWS, COLUMNS)) * [1.0, 20.0, 1e-3]
    noise = 0.7 * rng.normal(size=(ROWS, REPEATS))
    residual = noise - W @ np.linalg.lstsq(W, noise, rcond=None)[0]
    sigma = np.sqrt((residual**2).sum(0) / (ROWS - COLUMNS))
    t = scipy.stats.t.ppf(0.995, ROWS - COLUMNS)
    widths = t * sigma[:, None] * np.sqrt(np.diag(np.linalg.inv(W.T @ W)))
    return inverse_half(W / 0.7), widths


@pytest.mark.parametrize("probability", [0.5, 0.8, 0.95])
def test_half_widths_of_all_parameters_keep_to_the_prediction_with_its_probability(probability: float) -> None:
    factor, widths = _regressions()
    predicted = half_width_factor(ROWS - COLUMNS, probability=probability) * np.linalg.norm(factor, axis=1)
    share = np.mean(np.all(widths <= predicted, axis=1))
    assert abs(share - probability) < 4 * np.sqrt(probability * (1 - probability) / REPEATS)


def test_few_rows_widen_both_quantile_and_scatter() -> None:
    factors = [half_width_factor(f) for f in (3, 10, 100, 10**7)]
    assert factors == sorted(factors, reverse=True)
    assert factors[-1] == pytest.approx(scipy.stats.norm.ppf(0.995), rel=1e-3)
    assert half_width_factor(10**7, level=0.95) == pytest.approx(1.96, rel=1e-3)
    assert residual_degrees_of_freedom(20, 13, 3) == 3
    assert residual_degrees_of_freedom(3013, 13, 3) == 250


ONE = excite.Search(starts=1, executor="serial")


@pytest.fixture(scope="module")
def torques() -> excite.TaskTorques:
    rng, t = np.random.default_rng(3), np.linspace(0.0, 2.0 * np.pi, 301)
    wave = [np.column_stack([0.2 * np.sin(k * t + phase) for k in (1, 2, 3)]) for phase in rng.uniform(0, 6, 3)]
    return excite.TaskTorques(0.01, excite.TaskMotion("waves", ("q1", "q2", "q3"), *wave))


@pytest.fixture(scope="module")
def design(torques: excite.TaskTorques) -> excite.Design:
    target = excite.PrecisionTarget(None, parameters={"X2": 0.3}, torques=torques)
    criterion = {"criterion": "trace", "scale": "precision", "noise": (1.0, 2.0, 3.0)}
    return excite.design_trajectory("irp6", precision=target, search=ONE, **criterion)


def test_the_error_of_torques_is_that_of_sampled_parameters(design: excite.Design) -> None:
    run = design.run_information
    beta = run.half @ np.random.default_rng(0).normal(size=(run.half.shape[1], 4000))
    sampled = np.sqrt(np.sum((run.torques.rows @ beta) ** 2, axis=1).mean(axis=1))
    assert run.deviation[13:] == pytest.approx(sampled, rel=0.03)
    assert run.names[13:] == run.torques.names


def test_the_criterion_adds_what_is_asked(design: excite.Design) -> None:
    run, W = design.run_information, _rows(design)[0]
    value = next(start.value for start in design.starts if start.index == design.best_start)
    every = replace(run, half=inverse_half(W), rows=len(W))
    asked = float(np.sum((every.deviation / every.allowed) ** 2))
    assert asked == pytest.approx(value**2 / (every.rows / 3), rel=1e-3)


def _rows(design: excite.Design) -> tuple[np.ndarray, np.ndarray]:
    """Regressor of the motion in units of its noise, and velocities."""
    model, base = design.target.model, design.target.base
    samples = design.trajectory.samples(model.times(design.trajectory.duration, design.task.output.rate))
    W = model.assemble(samples)[:, base.index]
    return W / np.tile(design.task.objective.noise, len(samples.q))[:, None], samples.dq


def _least_speeds(dq: np.ndarray) -> np.ndarray:
    """Speed of the slowest drive in every row of the IRp-6, over the typical one or its own."""
    speed = np.abs(np.column_stack([dq[:, 0], dq[:, 1], dq[:, 1] + dq[:, 2]]))  # z_3 = q_2 + q_3
    usual = np.sqrt(np.mean(speed**2, axis=0))
    speed /= np.minimum(usual, np.median(usual))
    return np.stack([speed[:, 0], speed[:, 1:].min(axis=1), speed[:, 2]], axis=1).ravel()


def test_the_forecast_allows_for_estimates_without_slow_rows(design: excite.Design) -> None:
    """Estimates by least squares from rows faster than 0.2 and 0.4 of the typical speed of drives, many times."""
    run, (W, dq) = design.run_information, _rows(design)
    noise, least = np.random.default_rng(2).normal(size=(len(W), 2000)), _least_speeds(dq)
    near, far = (np.flatnonzero(least >= share) for share in (0.2, 0.4))
    first, other = (np.linalg.lstsq(W[rows], noise[rows], rcond=None)[0] for rows in (near, far))
    variance = np.diag(np.linalg.inv(W[near].T @ W[near]))[:, None] + (other - first) ** 2
    within = np.mean(variance <= run.deviation[:13, None] ** 2, axis=1)
    assert run.rows == near.size < 0.95 * len(W)
    assert np.all(np.abs(within - 0.95) < 0.02)


def test_the_forecast_allows_for_offsets_that_runs_do_not_show(design: excite.Design) -> None:
    """What the posterior of offsets of 0.5 % of the torques adds, by normal equations of many noisy logs."""
    run, (W, dq) = design.run_information, _rows(design)
    noise = np.tile(design.task.objective.noise, len(dq))
    torques = W * noise[:, None] @ prior_of(run.target.model, run.target.base, None).base_values(np.eye(13))
    G = np.tile(np.diag(0.005 * np.sqrt(np.mean(torques.reshape(-1, 3) ** 2, axis=0))), (len(dq), 1)) / noise[:, None]
    fast = _least_speeds(dq) >= 0.2
    A, R = np.hstack([W, G])[fast], np.linalg.lstsq(W[fast], G[fast])[0]
    for runs in (1, 400):
        left = np.linalg.inv(runs * A.T @ A + np.diag([0.0] * 13 + [1.0] * 3))
        pulls = np.random.default_rng(4).multivariate_normal(np.zeros(16), runs * A.T @ A, 4000)
        added = (pulls @ left[:, 13:] @ R.T) ** 2 + np.diag(R @ left[13:, 13:] @ R.T)
        factor = run._factor(runs)
        counted = ((run.half_widths(runs) / factor) ** 2 - run.deviation**2 / runs)[:13]
        within = np.mean(added <= counted * (1 + 1e-9), axis=0)
        assert np.all((within > 0.93) & (counted < 5.0 * added.mean(axis=0)))


def test_a_motion_whose_coupled_drives_take_turns_promises_no_precision(irp6: IdentificationTarget) -> None:
    time = np.linspace(0.0, 8.0, 801)
    turn = np.where(time[:, None] < 4.0, [1.0, 1.0, -1.0], [1.0, 0.0, 1.0])  # drive 2, then drive 3
    q, dq, ddq = (turn * x[:, None] for x in (-np.cos(6.0 * time), 6.0 * np.sin(6.0 * time), 36.0 * np.cos(6.0 * time)))
    samples = excite.Samples(time, q, dq, ddq, np.zeros_like(q))
    with pytest.raises(InputError, match="coupled drives move at the same time"):
        RunInformation.of(PrecisionTarget(0.05), irp6, samples, np.ones(3), 8.0)


def test_a_share_is_of_the_torque_along_the_motion(torques: excite.TaskTorques, irp6: IdentificationTarget) -> None:
    motion = torques.motion
    states = (part[:, ::-1] for part in (motion.q, motion.dq, motion.ddq))
    reordered = replace(torques, motion=excite.TaskMotion("waves", motion.joints[::-1], *states))
    allowed = torque_precision(torques, irp6).allowed
    assert torque_precision(replace(torques, share=0.02), irp6).allowed == pytest.approx(2.0 * allowed)
    assert torque_precision(reordered, irp6).allowed == pytest.approx(allowed)
    assert np.all(allowed > 0.01)


def test_a_file_names_a_motion(design: excite.Design, tmp_path: Path) -> None:
    assert excite.load_design(saved(tmp_path / "d", design)).task.objective.precision == design.task.objective.precision
    (tmp_path / "p.yaml").write_text("share: null\ntorques: {motion: d, share: 0.05}\n")
    torques = excite.PrecisionTarget(**read_precision_target(tmp_path / "p.yaml")).torques
    assert (torques.share, torques.motion.joints) == (0.05, ("q1", "q2", "q3"))
    (tmp_path / "p.yaml").write_text("torques: {motion: d}\n")
    with pytest.raises(InputError, match="share"):
        read_precision_target(tmp_path / "p.yaml")
    (tmp_path / "bad.csv").write_text("time,a\n0,1\n")
    (tmp_path / "p.yaml").write_text("torques: {motion: bad.csv, share: 0.1}\n")
    with pytest.raises(InputError, match=r"NAME\.position"):
        read_precision_target(tmp_path / "p.yaml")
