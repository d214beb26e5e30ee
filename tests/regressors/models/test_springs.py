"""Springs in the joints: the gradient of their energy, joints that are locked, a design, an identification, no JAX."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from slow_dynamics import three_axes

import excite
from excite.registry import MODELS
from excite.study.repetitions import repetitions
from regressors.errors import UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.partial import of_drives
from regressors.models.springs import SpringModel
from regressors.robot.columns import Terms
from regressors.robot.locked_joints import with_locked_joints
from regressors.samples import Array

REST = {"q2": 0.2, "q3": -0.1}
STIFFNESS = np.array([30.0, 40.0, 50.0])


def stiffness_columns(model: SpringModel) -> Array:
    samples = random_states(model.robot, 20, seed=1)
    return np.asarray(model.instants(samples).reshape(20, model.robot.n, -1)[:, :, -model.robot.n :])


def test_springs_are_the_gradient_of_their_energy() -> None:
    """``tau = d/dq sum_j k_j (q_j - rest_j)^2 / 2``, by CasADi."""
    robot = three_axes()
    q = ca.SX.sym("q", 3)
    energy = 0.5 * ca.sum1(STIFFNESS * (q - ca.DM([0.0, 0.2, -0.1])) ** 2)
    torque = ca.Function("torque", [q], [ca.gradient(energy, q)])
    samples = random_states(robot, 20, seed=1)
    expected = np.array([np.asarray(torque(x)).ravel() for x in samples.q])
    np.testing.assert_allclose(stiffness_columns(SpringModel(robot, rest=REST)) @ STIFFNESS, expected, atol=1e-12)


def test_other_columns_are_those_of_the_differential_model() -> None:
    robot, samples = three_axes(), random_states(three_axes(), 30, seed=2)
    bare, sprung = DifferentialModel(robot, Terms(offset=True)), SpringModel(robot, Terms(offset=True), rest=REST)
    np.testing.assert_array_equal(sprung.instants(samples)[:, : len(bare.columns)], bare.instants(samples))
    added = sprung.columns[len(bare.columns) :]
    assert [(c.name, c.unit, c.kind) for c in added] == [(f"k{j}", "Nm/rad", "stiffness") for j in (1, 2, 3)]
    assert base_parameters(sprung).names == (*base_parameters(bare).names, "k1", "k2", "k3")


def test_an_offset_takes_up_an_unknown_rest() -> None:
    """Rows with a rest position are those without it less a constant, which lies in the columns of the offsets."""
    robot, samples = three_axes(), random_states(three_axes(), 30, seed=3)
    known, unknown = SpringModel(robot, rest=REST), SpringModel(robot, Terms(offset=True))
    torque = known.instants(samples)[:, -3:] @ STIFFNESS
    W = unknown.instants(samples)
    np.testing.assert_allclose(W @ np.linalg.lstsq(W, torque)[0], torque, atol=1e-9)


def test_joints_that_are_locked_lose_their_springs() -> None:
    whole = SpringModel(three_axes(), rest=REST)
    robot = with_locked_joints(three_axes(), [0, 2])
    model = whole.on(robot)
    assert (model.rest, model.names[-2:]) == ({"q3": -0.1}, ("k1", "k3"))
    assert whole.softened(0.1).options == {**whole.options, "sign_width": 0.1}
    moved = of_drives(whole.robot, ["2"])
    samples = random_states(whole.robot, 10, seed=4)
    expected = np.einsum("j,ijp->ip", moved.matrix[:, 0], whole.instants(samples).reshape(10, 3, -1))
    np.testing.assert_allclose(whole.restricted(moved).instants(samples), expected, atol=1e-9)


def test_an_unknown_joint() -> None:
    with pytest.raises(UnknownName, match="no joint named 'q9'; available: q1, q2, q3"):
        SpringModel(three_axes(), rest={"q9": 0.1})


@pytest.mark.slow
def test_by_name_from_the_design_to_the_verdict(tmp_path: Path) -> None:
    """The simulated robot has no springs, and so do its parameters."""
    assert "springs" in MODELS
    task = excite.Task("irp6", model="springs", harmonics=3, starts=2, executor="serial")
    design = excite.design_trajectory(task)
    assert design.feasible
    design.save(tmp_path / "design")
    stored = excite.load_design(tmp_path / "design")
    assert stored.task.model.model == "springs"
    logs = [excite.simulate(stored, noise=1.0, seed=seed, rate=200.0) for seed in (1, 2)]
    result = excite.identify("irp6", logs[0], design=stored)
    assert result.names[-3:] == ("k1", "k2", "k3")
    assert np.all(np.abs(result.coefficients[-3:]) < 5 * result.estimate.deviation[-3:] + 1.0)
    assert excite.verify(result, logs[1]).holds
    weighted = excite.identify("irp6", logs[0], design=stored, estimator="weighted")
    assert repetitions(weighted, 10, seed=0).estimates.shape == (10, len(weighted.names))
