"""Load share, root, asymmetric and Stribeck friction identified from torques that are written out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pinocchio_chains import joint_torques
from played import periodic

from excite.identification.equations import (
    drive_rows,
    equations_of,
    friction_drives,
    measured_direction,
    measured_regressor,
)
from excite.identification.estimation import estimate_parameters
from excite.identification.preparation import prepare
from excite.identification.presliding import _score_of_columns
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.logs.log import Log
from excite.simulation.plant import ModelMotion
from excite.tasks.task import Task
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in
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
        v, speed, load = samples.dq[:, k], np.abs(samples.dq[:, k]), np.abs(rigid[:, k])
        torque = {
            "c": s[:, k],
            "v": v,
            "o": 1.0,
            "l": load * s[:, k],
            "r": speed**0.5 * s[:, k],
            "a": speed,
            "s": np.exp(-((v / 0.2) ** 2)) * s[:, k],
        }[name[2]]
        tau[:, k] += value * torque
    return tau


def log(rate: float = 200.0, width: float | None = None) -> tuple[Log, Samples]:
    time = np.arange(round(2.0 * rate)) / rate
    samples = periodic(np.eye(6), 2, 0.5).samples(time)
    rigid = joint_torques(ROBOT, samples)
    s = np.sign(samples.dq) if width is None else np.tanh(samples.dq / width)
    effort = rigid + friction(samples, rigid, s)
    return Log("LOG", "LOG", ROBOT.joint_names, time, samples.q, samples.dq, effort, None), samples


EXACT = Recipe(signals="fourier", period=2.0, harmonics=3, rows="all", sign_width=0.0, covariance="white")


@pytest.mark.parametrize("estimator", ["weighted", "physical"])
def test_friction_is_found_again(estimator: str) -> None:
    result = estimate_parameters(ROBOT, TASK, (log()[0],), replace(EXACT, estimator=estimator))
    values = dict(zip(result.estimate.names, result.estimate.values, strict=True))
    tolerance = 1e-6 if estimator == "weighted" else 2e-3
    for name, value in TRUTH.items():
        assert values[name] == pytest.approx(value, rel=tolerance), name


def test_what_is_carried_decides_the_share() -> None:
    """With half of the masses the share is twice as large; all else stays."""
    half = {name: value / 2 for name, value in standard_values(ROBOT).items()}
    result = estimate_parameters(ROBOT, TASK.changed(carried=half), (log()[0],), EXACT)
    values = dict(zip(result.estimate.names, result.estimate.values, strict=True))
    for name, value in TRUTH.items():
        assert values[name] == pytest.approx(2 * value if name.endswith("l") else value, rel=1e-6), name


@pytest.mark.parametrize("distances", [1e-3, (1e-3, 2e-3, 5e-4, 1e-2, 3e-3, 1e-4)])
def test_presliding_directions_enter_every_directed_column(distances: float | tuple[float, ...]) -> None:
    _, samples = log()
    target = target_of(ROBOT, TASK)
    exact, dahl = (measured_regressor(target, samples, d).reshape(samples.time.size, 6, -1) for d in (0.0, distances))
    each = np.broadcast_to(distances, 6)
    for k, index in enumerate(target.base.index):
        column = target.base.columns[index]
        joint = (column.owner or 1) - 1
        if column.kind not in DIRECTED_KINDS:
            np.testing.assert_array_equal(exact[:, :, k], dahl[:, :, k])
            continue
        s = measured_direction(samples.q[:, [joint]], each[joint])[:, 0]
        expected = exact[:, joint, k] * np.sign(samples.dq[:, joint]) * s
        np.testing.assert_allclose(dahl[:, joint, k], expected, atol=1e-9 * np.abs(exact[:, :, k]).max())
    assert len(friction_drives(target, samples).columns) == 6 + 2 + 1 + 1


def test_the_width_of_the_sign_is_found_with_all_directed_columns() -> None:
    result = estimate_parameters(ROBOT, TASK, (log(width=0.05)[0],), replace(EXACT, sign_width=None))
    assert result.recipe.sign_width == pytest.approx(0.05, rel=0.05)


def test_the_equations_of_motion_give_back_the_acceleration() -> None:
    """Friction with the load follows from the torques drive by drive, exactly where the load is the estimate's."""
    recorded, samples = log(50.0, width=0.1)
    target = target_of(ROBOT, TASK)
    assert recorded.effort is not None
    W = target.model.softened(0.1).instants(samples)[:, target.base.index]
    beta = np.linalg.lstsq(W, recorded.effort.ravel(), rcond=None)[0]
    np.testing.assert_allclose(W @ beta, recorded.effort.ravel(), atol=1e-8)
    rate = ModelMotion(target.model, beta, target.base, None).function(0.1)
    moved, least = rate(np.hstack([samples.q, samples.dq]).T, recorded.effort.T)
    np.testing.assert_allclose(np.array(moved)[6:].T, samples.ddq, atol=1e-6)
    assert np.all(np.array(least) > 0)


def test_presliding_is_judged_with_the_magnitudes_of_all_directed_columns() -> None:
    """At the true width nothing is left to explain; with constant magnitudes load shares and roots would be."""
    recorded, _ = log(width=0.05)
    target = target_of(ROBOT, TASK)
    part = prepare(recorded, ROBOT, target, EXACT)
    drives = friction_drives(target, part.samples)
    score = _score_of_columns([(part, equations_of(target, part, EXACT))], [drives])
    dz = part.samples.dq @ drive_rows(ROBOT).T
    assert score([np.tanh(dz / 0.05)]) < score([np.tanh(dz / 0.06)]) - 3.0
