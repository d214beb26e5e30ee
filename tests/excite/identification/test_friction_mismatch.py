"""Friction of other forms than the model's is noticed, and what it does to the parameters is allowed for."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from excite.identification.estimation import estimate_parameters
from excite.identification.identification import Identification
from excite.information.target import target_of
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.models.nominal import standard_values
from regressors.readers.library import load_robot
from regressors.samples import Array, Samples

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
    assert estimate.mismatch is not None
    np.testing.assert_allclose(estimate.mismatch, estimate.mismatch.T, atol=1e-12)
    assert np.linalg.eigvalsh(estimate.mismatch)[0] >= -1e-12 * np.trace(estimate.mismatch)
    error = truth - estimate.coefficients

    def distance(C: Array) -> float:
        return float(error @ np.linalg.solve(C, error) / len(error))

    assert distance(estimate.covariance + estimate.mismatch) < min(1.9, distance(estimate.covariance))


def test_without_noise_the_change_is_the_error() -> None:
    """In the sizes of the parameters: bumps of other speeds than the true one explain nearly all of it."""
    result, truth = identified(0.1, noise=1e-5)
    assert result.estimate.mismatch is not None
    values, vectors = np.linalg.eigh(result.estimate.mismatch / np.outer(truth, truth))
    change, error = np.sqrt(values[-1]) * vectors[:, -1], (truth - result.estimate.coefficients) / truth
    np.testing.assert_allclose(np.abs(change), np.abs(error), atol=0.15 * np.abs(error).max())
    assert abs(change @ error) > 0.98 * np.linalg.norm(change) * np.linalg.norm(error)
