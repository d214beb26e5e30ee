"""Yardsticks against slow, obvious NumPy: condition numbers, determinants, and standard deviations by simulation."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from written_files import text_file

from excite.information.matrix import CONVENTIONS, MotionMeasures, noise_per_row
from excite.information.target import IdentificationTarget, target_of
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.samples import Samples

SLIDER = """\
name: slider
joints:
  - {name: lift, kind: prismatic, mdh: {alpha: 90 deg}, limits: {velocity: 1, acceleration: 1}}
  - {name: swing, mdh: {alpha: 90 deg, a: 0.3}, limits: {velocity: 1, acceleration: 1}}
"""


@dataclass(frozen=True, eq=False)
class Case:
    """A motion and what is to be identified by it."""

    target: IdentificationTarget
    samples: Samples
    noise: np.ndarray

    @property
    def full(self) -> np.ndarray:
        return self.target.model.assemble(self.samples)

    @property
    def base_columns(self) -> np.ndarray:
        return self.full[:, self.target.base.index]


def case(robot: str, noise: tuple[float, ...] | None = None, **task: object) -> Case:
    made = Task(robot, noise=noise, **task)
    target = target_of(load_robot(robot), made)
    family = Fourier(5.0, 6)
    x = np.random.default_rng(3).normal(0.0, 0.25, (target.robot.n, family.size))
    samples = Trajectory(family, x).samples(target.model.times(5.0, 60.0))
    return Case(target, samples, noise_per_row(noise, target.model))


@pytest.fixture(scope="module", params=["irp6", "irp6 wide", "panda", "energy", "load", "slider"])
def given(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    path = text_file(tmp_path_factory.mktemp("robots") / "slider.yaml", SLIDER)
    return {
        "irp6": lambda: case("irp6", (0.5, 2.0, 1.0)),
        "irp6 wide": lambda: case("irp6", joints=("1", "2", "3", "4", "5"), offset=True),
        "panda": lambda: case("panda", (1.0, 2.0, 3.0, 4.0, 0.5, 0.25, 0.125), friction=False),
        "energy": lambda: case("irp6", (0.1,), model="energy"),
        "load": lambda: case("irp6", (1.0, 1.0, 1.0, 0.1, 0.1, 0.1), model="load"),
        "slider": lambda: case(str(path), (3.0, 0.5)),
    }[request.param]()


def measures(given: Case) -> MotionMeasures:
    return MotionMeasures.of(given.target, given.samples, given.noise)


def test_condition_numbers(given: Case) -> None:
    found, W, base = measures(given).criteria, given.base_columns, given.target.base
    lengths = [{"kg m": 0.1, "kg m^2": 0.01}.get(unit, 1.0) for unit in base.units]
    singular = np.linalg.svd(given.full, compute_uv=False)
    expected = {
        "condition_number": W,
        "condition_number_noise_weighted": [row / given.noise[k % given.noise.size] for k, row in enumerate(W)],
        "condition_number_length_scaled": W * lengths,
        "condition_number_column_normalised": np.array([column / np.sqrt(np.sum(column**2)) for column in W.T]).T,
    }
    assert list(found) == list(CONVENTIONS)
    assert {name: found[name] for name in expected} == pytest.approx(
        {name: np.linalg.cond(matrix) for name, matrix in expected.items()}, rel=1e-9
    )
    assert found["condition_number_orthonormal"] == pytest.approx(singular[0] / singular[base.rank - 1], rel=1e-8)


def test_pivoted_base_is_one_of_the_regressors_own(given: Case) -> None:
    # Which columns column pivoting takes is tested with the base; here: the measure is that of just as many columns of
    # the full regressor, and they span the same.
    T = given.target.transforms["pivoted"]
    pivoted = given.base_columns @ T
    full = given.full
    distance = [np.linalg.norm(full - column[:, None], axis=0).min() for column in pivoted.T]
    assert np.max(distance) < 1e-9 * np.linalg.norm(full)
    assert np.linalg.matrix_rank(pivoted) == given.target.base.rank
    found = measures(given).criteria
    assert found["condition_number_pivoted"] == pytest.approx(np.linalg.cond(pivoted), rel=1e-8)


def test_determinants_and_singular_values(given: Case) -> None:
    found, W = measures(given).criteria, given.base_columns
    singular = np.linalg.svd(W, compute_uv=False)
    count = len(W) / len(given.target.model.row_labels)
    assert found["smallest_singular_value"] == pytest.approx(singular[-1], rel=1e-9)
    assert np.allclose(measures(given).spectrum, singular, rtol=1e-9, atol=0.0)
    sign, log_det = np.linalg.slogdet(W.T @ W)
    assert sign == 1.0
    assert found["log_det"] == pytest.approx(log_det, rel=1e-9, abs=1e-6)
    assert found["log_det_per_sample"] == pytest.approx(np.linalg.slogdet(W.T @ W / count)[1], rel=1e-9, abs=1e-6)
    assert found["trace_inverse"] == pytest.approx(np.trace(np.linalg.inv(W.T @ W)), rel=1e-6)


def test_a_motion_that_shows_too_little_has_infinite_measures() -> None:
    still = case("irp6")
    zero = np.zeros_like(still.samples.q)
    samples = Samples(still.samples.time, zero, zero, zero, zero)
    found = MotionMeasures.of(still.target, samples, still.noise).criteria
    assert min(value for name, value in found.items() if name.startswith("condition")) > 1e15
    assert found["smallest_singular_value"] < 1e-12


# Predictions


def test_predictions_are_the_covariance_of_weighted_least_squares(given: Case) -> None:
    W, base, told = given.base_columns, given.target.base, measures(given).predicted
    S = np.diag(np.tile(given.noise**2, len(W) // given.noise.size))
    covariance = np.linalg.inv(W.T @ np.linalg.solve(S, W))
    assert np.allclose([p.standard_deviation for p in told], np.sqrt(np.diag(covariance)), rtol=1e-6)
    stated = zip(base.names, base.expressions, base.units, strict=True)
    assert [(p.name, p.expression, p.unit) for p in told] == list(stated)


# Noise


@pytest.mark.parametrize(
    ("limit", "expected"),
    [(np.inf, 1.0), (330.0, 1.0), (10.5, 1.0), (10.0, 0.1), (3.0, 0.1), (1.0, 0.01), (0.17, 0.01), (0.05, 0.001)],
)
def test_noise_that_is_assumed_is_no_larger_than_the_torques_of_the_arm(limit: float, expected: float) -> None:
    robot = load_robot("panda")
    torque = np.full(robot.n, limit)
    model = DifferentialModel(robot.replace(limits=replace(robot.limits, torque=torque)))
    np.testing.assert_array_equal(noise_per_row(None, model), np.full(robot.n, expected))
