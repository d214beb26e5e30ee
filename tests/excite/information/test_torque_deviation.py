"""Criteria of predicted torques: Monte Carlo with Pinocchio, finite differences, laws, and designs."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from criterion_laws import check_design_pays, check_gradient, information_matrix
from hypothesis import given
from hypothesis import strategies as st
from pinocchio_chains import chain_model, inertia

import excite
from excite.design.comparison import compare
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion
from excite.design.task_motion_file import read_task_motion
from excite.information.goal import goal_of, task_torques
from excite.information.target import target_of
from excite.information.weighting import weighting_of
from excite.registry import instance
from excite.tasks.criteria import MaxTorqueDeviation, TorqueDeviation
from excite.tasks.stored_files import TaskMotion
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
KINDS = (TorqueDeviation, MaxTorqueDeviation)


def rows_and_matrix(seed: int, b: int = 5) -> tuple[Array, Array]:
    Y = np.random.default_rng(seed).normal(size=(12, b)) * np.logspace(0.5, -0.5, b)
    return Y, information_matrix(seed + 7, b)


@given(SEED)
def test_values_are_of_the_variances_one_by_one(seed: int) -> None:
    Y, M = rows_and_matrix(seed)
    variances = [y @ np.linalg.solve(M, y) for y in Y]
    assert TorqueDeviation(Y).value(M) == pytest.approx(np.sqrt(np.mean(variances)), rel=1e-9)
    assert MaxTorqueDeviation(Y).value(M) == pytest.approx(np.sqrt(max(variances)), rel=1e-9)
    A = Y.T @ Y / len(Y)
    assert TorqueDeviation(Y).value(M) ** 2 == pytest.approx(np.trace(np.linalg.solve(M, A)), rel=1e-9)


@given(SEED, st.sampled_from(KINDS), st.sampled_from([1.0, 4.0, 16.0]))
def test_gradient_is_that_of_finite_differences(seed: int, kind: type[TorqueDeviation], p: float) -> None:
    Y, M = rows_and_matrix(seed)
    criterion = kind(Y)
    check_gradient(criterion, M, seed, p)
    value, _ = criterion.smooth(M, p)
    assert -1e-12 <= value - np.log(criterion.value(M)) <= np.log(len(Y)) / (2 * p) + 1e-12
    assert criterion.smooth(4 * M, p)[0] == pytest.approx(value - np.log(2), abs=1e-9)


@given(SEED, st.sampled_from(KINDS))
def test_how_parameters_are_chosen_does_not_matter(seed: int, kind: type[TorqueDeviation]) -> None:
    Y, M = rows_and_matrix(seed)
    T = np.random.default_rng(seed + 1).normal(size=(5, 5)) + 4 * np.eye(5)
    assert kind(Y @ T).value(T.T @ M @ T) == pytest.approx(kind(Y).value(M), rel=1e-7)


def test_rows_of_single_parameters_are_known_criteria() -> None:
    _, M = rows_and_matrix(1)
    assert TorqueDeviation().value(M) == pytest.approx(instance("criterion", "trace").value(M) / np.sqrt(5), rel=1e-9)
    assert MaxTorqueDeviation().value(M) == pytest.approx(instance("criterion", "max-deviation").value(M), rel=1e-9)
    assert MaxTorqueDeviation(np.eye(5)).value(M) == pytest.approx(MaxTorqueDeviation().value(M), rel=1e-12)


@pytest.mark.parametrize("conventions", [{"base": "pivoted"}, {"scale": "value"}], ids=str)
def test_conventions_do_not_matter_for_a_design(conventions: dict[str, str]) -> None:
    tasks = [Task("irp6", criterion="torque-deviation", **options) for options in ({}, conventions)]
    problems = [formulate(load_robot("irp6"), task).problem for task in tasks]
    x = random_motion(problems[0], np.random.default_rng(0))
    values = [problem.exact_value(x) for problem in problems]
    assert values[1] == pytest.approx(values[0], rel=1e-8)


# --- the variance itself, by repeated identification -----------------------------------------------------------------


def test_variance_is_that_of_repeated_identification_with_pinocchio() -> None:
    """Torques of estimated inertial parameters by Pinocchio's recursion, on a motion that was not identified with."""
    robot, rng, draws, sigma = load_robot("panda"), np.random.default_rng(0), 300, 0.05
    states = rng.uniform(-1, 1, (3, 8, 7))
    work = TaskMotion("work", robot.joint_names, *states)
    task = Task("panda", criterion="torque-deviation", task_motion=work, friction=False, rotor=False, harmonics=3)
    made = formulate(robot, task)
    motion = made.problem.information.trajectory(random_motion(made.problem, rng))
    base = made.target.base
    W = made.target.model.assemble(motion.samples(np.arange(0.0, 10.0, 0.1)))[:, base.index]
    noise = sigma * rng.normal(size=(len(W), draws))
    errors = np.linalg.pinv(base.D) @ np.linalg.lstsq(W, noise)[0]  # of standard parameters, link by link
    chain = chain_model(robot)
    data = chain.createData()

    def torques(thetas: Array) -> Array:
        for number, theta in enumerate(thetas, 1):
            chain.inertias[number] = inertia(theta)
        return np.array([pin.rnea(chain, data, *state) for state in states.transpose(1, 0, 2)])

    nominal = np.array([link.theta for link in robot.links])
    small = 1e-3  # so that every mass stays above zero
    found = [(torques(nominal + small * e.reshape(7, 10)) - torques(nominal)) / small for e in errors.T]
    M = weighting_of(made.target, task).matrix(W)
    criterion = goal_of(made.target, task).of(TorqueDeviation())
    predicted = criterion.value(M) * sigma / np.sqrt(len(W) / 7)
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(predicted, rel=0.04)
    largest = goal_of(made.target, task).of(MaxTorqueDeviation()).value(M) * sigma / np.sqrt(len(W) / 7)
    assert np.sqrt(np.mean(np.square(found), axis=0).max()) == pytest.approx(largest, rel=0.15)


# --- task motions ----------------------------------------------------------------------------------------------------


def test_torques_of_joints_are_divided_by_their_noise() -> None:
    noise = (0.5, 8.0, 2.0)
    plain, weighted = (Task("irp6", criterion="torque-deviation", noise=noise, weighted=w) for w in (False, True))
    target = target_of(load_robot("irp6"), plain)
    expected = task_torques(target, plain).reshape(-1, 3, 13) / np.array(noise)[:, None]
    np.testing.assert_allclose(task_torques(target, weighted).reshape(-1, 3, 13), expected, rtol=1e-12)


@pytest.mark.parametrize("options", [{"model": "energy"}, {"joints": ("3",)}, {"model": "load"}], ids=str)
def test_rows_of_other_models(options: dict[str, str]) -> None:
    task = Task("irp6", criterion="torque-deviation", harmonics=3, period=6.4, **options)
    problem = formulate(load_robot("irp6"), task).problem
    assert 0 < problem.exact_value(random_motion(problem, np.random.default_rng(0))) < np.inf


def test_files(tmp_path: Path) -> None:
    task = Task("irp6", harmonics=3, starts=1, executor="serial", criterion="trace")
    work = excite.design_trajectory(task)
    work.save(tmp_path / "work")
    of_design, of_file = (read_task_motion(tmp_path / "work" / name) for name in (".", "trajectory.csv"))
    assert of_design.joints == work.moving.joint_names
    assert len(of_design.q) == len(of_file.q) == 200
    own = excite.design_trajectory(task, criterion="torque-deviation", task_motion=tmp_path / "work", begin=work)
    check_design_pays(own, work, tmp_path / "own")
    for path in (tmp_path / "work").iterdir():
        if path.is_file():
            path.unlink()
    stored = excite.load_design(tmp_path / "own")
    again = compare([stored])[0]
    assert again.goal == pytest.approx(own.minimised_value, rel=1e-12)
    assert formulate(load_robot("irp6"), stored.task).problem.exact_value(own.trajectory.x) == pytest.approx(again.goal)


def test_same_motion_as_an_object_and_as_a_file(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    states = rng.normal(size=(3, 4, 3))
    header = ["time", *(f"q{k}.{what}" for k in (1, 2, 3) for what in ("position", "velocity", "acceleration"))]
    with (tmp_path / "work.csv").open("w", newline="") as stream:
        lines = csv.writer(stream)
        lines.writerow(header)
        lines.writerows([t, *states[:, t].T.ravel()] for t in range(4))
    read = read_task_motion(tmp_path / "work.csv")
    assert read.joints == ("q1", "q2", "q3")
    np.testing.assert_array_equal([read.q, read.dq, read.ddq], states)
    again = TaskMotion.from_dict(read.to_dict())
    np.testing.assert_array_equal(again.ddq, read.ddq)


WRONG_FILES = {
    "no columns": ("time\n0\n", "columns NAME.position of joints missing"),
    "no rates": ("time,q1.position\n0,1\n", "q1.velocity, q1.acceleration missing"),
    "no rows": ("time,q1.position,q1.velocity,q1.acceleration\n", "rows missing"),
    "no number": ("time,q1.position,q1.velocity,q1.acceleration\n0,1,x,2\n", "'x' is not a number"),
}


@pytest.mark.parametrize(("text", "message"), WRONG_FILES.values(), ids=WRONG_FILES)
def test_wrong_files(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "work.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_task_motion(tmp_path / "work.csv")


ZERO = np.zeros((2, 1))
REFUSED = {
    "another criterion": ({"criterion": "trace", "task_motion": TaskMotion("a", ("q1",), ZERO, ZERO, ZERO)}, "not for"),
    "another robot": ({"task_motion": TaskMotion("a", ("q1",), ZERO, ZERO, ZERO)}, "needs also q2, q3"),
    "interest too": ({"interest": ("X5",)}, "every parameter counts"),
    "no such folder": ({"task_motion": "nowhere"}, "holds no design"),
}


@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        formulate(load_robot("irp6"), Task("irp6", **{"criterion": "torque-deviation", **options}))


@pytest.mark.parametrize(
    "wrong", [{"q": [[1.0, 2.0]]}, {"q": "text"}, {"joints": None}, {"q": [[float("nan")]]}], ids=str
)
def test_wrong_content(wrong: dict[str, object]) -> None:
    content = {"name": "a", "joints": ["q1"], "q": [[0.0]], "dq": [[0.0]], "ddq": [[0.0]], **wrong}
    with pytest.raises(InputError, match="task_motion"):
        TaskMotion.from_dict(content)
