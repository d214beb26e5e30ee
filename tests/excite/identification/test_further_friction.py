"""Load share, root, asymmetric and Stribeck friction identified from torques that are written out by hand."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pinocchio_chains import joint_torques
from played import periodic

from excite.identification.equations import (
    friction_drives,
    measured_direction,
    measured_regressor,
    sample_way,
)
from excite.identification.identification import Identification
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.logs.log import Log
from excite.simulation.plant import ModelMotion
from excite.tasks.task import Task
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in, load_robot
from regressors.robot.columns import DIRECTED_KINDS
from regressors.samples import Array, Samples

ROBOT = built_in("ur10e")
TASK = Task(
    "ur10e", load_share=("2", "3"), root_friction=("1",), asymmetric_friction=("2",), stribeck=("3",), offset=("4",),
    stribeck_speed=0.2,
)  # fmt: skip
TRUTH = {
    **{f"F{k}c": 2.0 + k for k in range(1, 7)},
    **{f"F{k}v": 5.0 for k in range(1, 7)},
    "F2l": 0.08, "F3l": 0.05, "F1r": 3.0, "F2a": -1.5, "F3s": -1.0, "F4o": 0.7,
}  # fmt: skip


def friction(samples: Samples, rigid: Array, s: Array) -> Array:
    """Friction of the joints, of which each has its own drive, shape (N, 6)."""
    tau = np.zeros_like(samples.dq)
    for name, value in TRUTH.items():
        k = int(name[1]) - 1
        v, speed, load, way = samples.dq[:, k], np.abs(samples.dq[:, k]), np.abs(rigid[:, k]), s[:, k]
        of = {"c": way, "v": v, "o": 1.0, "l": load * way, "r": speed**0.5 * way, "a": speed}
        tau[:, k] += value * (np.exp(-((v / 0.2) ** 2)) * way if name[2] == "s" else of[name[2]])
    return tau


def log(rate: float = 200.0, width: float | None = None) -> tuple[Log, Samples]:
    time = np.arange(round(2.0 * rate)) / rate
    samples = periodic(np.eye(6), 2, 0.5).samples(time)
    rigid = joint_torques(ROBOT, samples)
    s = np.sign(samples.dq) if width is None else np.tanh(samples.dq / width)
    effort = rigid + friction(samples, rigid, s)
    return Log("LOG", "LOG", ROBOT.joint_names, time, samples.q, samples.dq, effort, None), samples


EXACT = Recipe(signals="fourier", period=2.0, harmonics=3, rows="all", sign_width=0.0, covariance="white")


def test_friction_is_found_again() -> None:
    """With half of the masses the share of the load is twice as large; all else stays."""
    half = TASK.changed(carried={name: value / 2 for name, value in standard_values(ROBOT).items()})
    for task, estimator, share, tolerance in (
        (TASK, "physical", 1, 2e-3),
        (TASK, "weighted", 1, 1e-6),
        (half, "weighted", 2, 1e-6),
    ):
        result = estimate_parameters(ROBOT, task, (log()[0],), replace(EXACT, estimator=estimator))
        values = dict(zip(result.names, result.estimate.values, strict=True))
        for name, value in TRUTH.items():
            assert values[name] == pytest.approx(share * value if name[2] == "l" else value, rel=tolerance), name


def test_presliding_directions_enter_every_directed_column() -> None:
    _, samples = log()
    target, distances = target_of(ROBOT, TASK), (1e-3, 2e-3, 5e-4, 1e-2, 3e-3, 1e-4)
    exact, dahl = (measured_regressor(target, samples, d).reshape(samples.time.size, 6, -1) for d in (0.0, distances))
    for k, index in enumerate(target.base.index):
        column = target.base.columns[index]
        joint = (column.owner or 1) - 1
        expected = exact[:, :, k].copy()
        if column.kind in DIRECTED_KINDS:
            pace = sample_way(samples)[:, [joint]]
            s = measured_direction(samples.q[:, [joint]], distances[joint], pace)[:, 0]
            expected[:, joint] *= np.sign(samples.dq[:, joint]) * s
        np.testing.assert_allclose(dahl[:, :, k], expected, atol=1e-9 * np.abs(expected).max())
    assert len(friction_drives(target, samples).columns) == 6 + 2 + 1 + 1


def test_the_width_of_the_sign_is_found_with_all_directed_columns() -> None:
    result = estimate_parameters(ROBOT, TASK, (log(width=0.05)[0],), replace(EXACT, sign_width=None))
    assert result.recipe.sign_width == pytest.approx(0.05, rel=0.05)


def test_the_equations_of_motion_give_back_the_acceleration() -> None:
    """Friction with the load follows from the torques drive by drive, exactly where the load is the estimate's."""
    recorded, samples = log(50.0, width=0.1)
    target = target_of(ROBOT, TASK)
    W = target.model.softened(0.1).instants(samples)[:, target.base.index]
    beta = np.linalg.lstsq(W, recorded.effort.ravel(), rcond=None)[0]
    np.testing.assert_allclose(W @ beta, recorded.effort.ravel(), atol=1e-8)
    rate = ModelMotion(target.model, beta, target.base, None).function(0.1)
    moved, least = rate(np.hstack([samples.q, samples.dq]).T, recorded.effort.T)
    np.testing.assert_allclose(np.array(moved)[6:].T, samples.ddq, atol=1e-6)
    assert np.all(np.array(least) > 0)


RATE, PERIOD = 100.0, 6.0
SPEED = 0.07  # of the friction that the model does not have [rad/s]


@cache
def experiment() -> tuple[Task, Samples, Array, Array, tuple[str, ...]]:
    """A motion of the IRp-6, and its torques per standard parameter and for each drive's friction near standstill."""
    robot = load_robot("irp6")
    task = Task("irp6").changed(robot=robot)
    target = target_of(robot, task.changed(stribeck=True, stribeck_speed=SPEED), 0.0)
    t, w = np.arange(round(RATE * PERIOD) + 1)[:, None] / RATE, 2 * np.pi / PERIOD
    k = np.array([[1, 2, 3], [3, 1, 2]])
    q = 0.25 * np.sin(w * k[0] * t) + 0.1 * np.cos(w * 2 * k[1] * t)
    dq = 0.25 * w * k[0] * np.cos(w * k[0] * t) - 0.2 * w * k[1] * np.sin(w * 2 * k[1] * t)
    ddq = -0.25 * (w * k[0]) ** 2 * np.sin(w * k[0] * t) - 0.4 * (w * k[1]) ** 2 * np.cos(w * 2 * k[1] * t)
    samples = Samples(t[:, 0], q, dq, ddq, ddq)
    definition, names = target.model.definition()
    return task, samples, target.model.instants(samples) @ definition, target_of(robot, task).base.D, names


def identified(share: float, seed: int = 0, colour: float = 0.0, noise: float = 0.02) -> tuple[Identification, Array]:
    """The result of a log with friction near standstill of a share of Coulomb's, and the true base parameters."""
    task, samples, W, D, names = experiment()
    robot, rng = load_robot("irp6"), np.random.default_rng(seed)
    known = standard_values(robot)
    theta = np.array([share * known[f"{name[:-1]}c"] if name.endswith("s") else known[name] for name in names])
    exact = (W @ theta).reshape(-1, 3)
    e = rng.normal(size=exact.shape)
    for k in range(1, len(e)):
        e[k] = colour * e[k - 1] + np.sqrt(1 - colour**2) * e[k]
    effort = exact + noise * exact.std(axis=0) * e
    log = Log("a.csv", f"{share} {seed} {colour}", robot.joint_names[:3], samples.time, samples.q, None, effort)
    result = estimate_parameters(robot, task, [log])
    definition, own = result.target.model.definition()
    return result, D @ definition @ np.array([known[name] for name in own])


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_noise_alone_is_no_mismatch(colour: float) -> None:
    assert all(identified(0.0, seed, colour)[0].estimate.mismatch is None for seed in range(3))


@pytest.mark.parametrize(("share", "colour"), [(0.05, 0.0), (0.3, 0.0), (0.3, 0.8)])
def test_friction_near_standstill_is_allowed_for(share: float, colour: float) -> None:
    result, truth = identified(share, colour=colour)
    estimate = result.estimate
    np.testing.assert_allclose(estimate.mismatch, estimate.mismatch.T, atol=1e-12)
    assert np.linalg.eigvalsh(estimate.mismatch)[0] >= -1e-12 * np.trace(estimate.mismatch)
    error = truth - estimate.coefficients

    def distance(C: Array) -> float:
        return float(error @ np.linalg.solve(C, error) / len(error))

    assert distance(estimate.covariance + estimate.mismatch) < min(1.9, distance(estimate.covariance))


def test_without_noise_the_change_is_the_error() -> None:
    """In the sizes of the parameters: bumps of other speeds than the true one explain nearly all of it."""
    result, truth = identified(0.1, noise=1e-5)
    values, vectors = np.linalg.eigh(result.estimate.mismatch / np.outer(truth, truth))
    change, error = np.sqrt(values[-1]) * vectors[:, -1], (truth - result.estimate.coefficients) / truth
    np.testing.assert_allclose(np.abs(change), np.abs(error), atol=0.15 * np.abs(error).max())
    assert abs(change @ error) > 0.98 * np.linalg.norm(change) * np.linalg.norm(error)
