"""Criteria on chosen parameters, on predicted torques, and of the worst of plausible robots."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from criterion_laws import check_design_pays, check_gradient, information_matrix, regressor
from hypothesis import given, settings, strategies as st
from pinocchio_chains import chain_model, inertia
from refused import refusal
from written_files import text_file

import excite
from excite.design.comparison import compare
from excite.design.design_json import read_task_motion
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion
from excite.information.goal import ChosenParameters, WorstRobot, goal_of, task_torques
from excite.information.target import target_of
from excite.information.weighting import weighting_of
from excite.registry import instance
from excite.tasks.criteria import MaxTorqueDeviation, TorqueDeviation
from excite.tasks.objective import Belief
from excite.tasks.stored_files import TaskMotion
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
NAMES = ("condition", "frobenius", "sigma-min", "logdet", "trace", "max-deviation")
CHOSEN = (4, 1, 2)


def of_chosen(name: str = "trace", chosen: tuple[int, ...] = CHOSEN) -> ChosenParameters:
    return ChosenParameters(instance("criterion", name), chosen)


@given(SEED, st.sampled_from(NAMES))
def test_criterion_is_that_of_what_the_other_columns_do_not_explain(seed: int, name: str) -> None:
    """What is minimised has a part of the volume of all."""
    W, criterion = regressor(seed, 6, 40), instance("criterion", name)
    M, others = W.T @ W / 40, np.delete(W, CHOSEN, axis=1)
    rest = W[:, CHOSEN] - others @ np.linalg.lstsq(others, W[:, CHOSEN])[0]
    assert of_chosen(name).value(M) == pytest.approx(criterion.value(rest.T @ rest / 40), rel=1e-8)
    own, volume = criterion.smooth(rest.T @ rest / 40, 4.0)[0], np.log(instance("criterion", "logdet").value(M))
    assert of_chosen(name).smooth(M, 4.0)[0] == pytest.approx(own + 0.05 * volume, rel=1e-8, abs=1e-8)


@given(SEED, st.sampled_from(NAMES), st.sampled_from([1.0, 4.0, 16.0]))
def test_gradient_of_chosen_parameters_is_that_of_finite_differences(seed: int, name: str, p: float) -> None:
    M, criterion = information_matrix(seed, 6, 40), of_chosen(name)
    check_gradient(criterion, M, seed, p)
    value, _, reported = criterion.smooth_and_value(M, p)
    assert (value, reported) == (criterion.smooth(M, p)[0], pytest.approx(criterion.value(M), rel=1e-12))


@pytest.mark.parametrize("name", NAMES)
def test_singular_information(name: str) -> None:
    """Of a chosen parameter, or of another one."""
    for hidden in (1, 3):
        W = regressor(2, 6, 40)
        W[:, hidden] = W[:, 0] - W[:, 5]
        M = W.T @ W / 40
        M[hidden] = M[:, hidden] = 0.0
        value, G = of_chosen(name).smooth(M, 4.0)
        assert of_chosen(name).value(M) == np.inf
        assert np.all(np.isfinite([value, *G.ravel()]))


# --- names and groups ------------------------------------------------------------------------------------------------

ALL = ("X1", "X2", "X3", "X4", "X5", "X6", "X7", "F1c", "F2c", "F3c", "F1v", "F2v", "F3v")
GROUPS = {
    ("X5", "F3c"): ("X5", "F3c"),
    ("friction",): ALL[7:],
    ("coulomb",): ALL[7:10],
    ("viscous", "F1c"): ("F1c", *ALL[10:]),
    ("inertial",): ALL[:7],
    ("gravity",): ("X6", "X7"),
    ("inertia",): ALL[:5],
}


def test_names_and_groups() -> None:
    for interest, expected in GROUPS.items():
        task = Task("irp6", interest=interest)
        chosen = goal_of(target_of(load_robot("irp6"), task), task).chosen
        assert {ALL[k] for k in chosen} == set(expected)


def test_names_of_another_base() -> None:
    task = Task("panda", friction=False, base="pivoted", interest=("I2yz", "I4yy"))
    target = target_of(load_robot("panda"), task)
    for name, chosen in zip(task.objective.interest, goal_of(target, task).chosen, strict=True):
        column = target.base.D[:, target.model.names.index(name)]
        np.testing.assert_allclose(target.transforms["pivoted"][:, chosen], column, atol=1e-12)


# --- the whole chain -------------------------------------------------------------------------------------------------


def test_designs_for_chosen_parameters(tmp_path: Path) -> None:
    task = Task("irp6", harmonics=3, starts=1, executor="serial", criterion="trace")
    plain = excite.design_trajectory(task)
    own = excite.design_trajectory(task.changed(interest=("X1", "friction"), begin=plain))
    chosen = {"X1", *ALL[7:]}
    variances = sum(p.standard_deviation**2 for p in own.predicted if p.name in chosen) * own.rows / 3
    assert own.minimised_value == pytest.approx(np.sqrt(variances), rel=1e-9)
    stored = check_design_pays(own, plain, tmp_path / "design")
    assert stored.minimised_value == own.minimised_value


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
    for text, message in (
        ("time\n0", "columns NAME.position of joints missing"),
        ("time,q1.position\n0,1", "q1.velocity, q1.acceleration missing"),
        ("time,q1.position,q1.velocity,q1.acceleration", "rows missing"),
        ("time,q1.position,q1.velocity,q1.acceleration\n0,1,x,2", "'x' is not a number"),
    ):
        assert message in refusal(read_task_motion, text_file(tmp_path / "work.csv", f"{text}\n"))


WORST_OF = ("condition", "trace", "max-deviation", "sigma-min")
RELATIVE = {"criterion": "trace", "scale": "value", "noise": (2.0, 8.0, 4.0)}


def ratios_and_matrix(seed: int, b: int = 4) -> tuple[Array, Array]:
    return np.exp(np.random.default_rng(seed).normal(size=(6, b))), information_matrix(seed, b)


@settings(max_examples=30)
@given(SEED, st.sampled_from(WORST_OF))
def test_value_is_the_worst_one(seed: int, name: str) -> None:
    ratios, M = ratios_and_matrix(seed)
    criterion = instance("criterion", name)
    values = [criterion.value(np.diag(r) @ M @ np.diag(r)) for r in ratios]
    worst = WorstRobot(criterion, ratios)
    assert worst.value(M) == pytest.approx(max(values), rel=1e-9)
    stand_in = [worst.smooth(M, p)[0] for p in worst.stages]
    assert min(stand_in) >= np.log(max(values)) - 1e-9
    exact = max(criterion.smooth(np.diag(r) @ M @ np.diag(r), 64.0)[0] for r in ratios)
    assert stand_in[-1] == pytest.approx(exact, abs=np.log(6) / 256 + 1e-12)


@settings(max_examples=30)
@given(SEED, st.sampled_from(WORST_OF), st.sampled_from([1.0, 4.0]))
def test_gradient_of_the_worst_is_that_of_finite_differences(seed: int, name: str, p: float) -> None:
    ratios, M = ratios_and_matrix(seed)
    check_gradient(WorstRobot(instance("criterion", name), ratios), M, seed, p, 1e-3)


def test_robots_are_drawn_from_the_prior() -> None:
    """Of parameters that are columns themselves: ``|value + deviation z| / |value|``, at least their prior share."""
    known = (Belief("X7", 8.0, 0.8), Belief("F2c", 20.0, 30.0))
    task = Task("irp6", prior=known, plausible_robots=400, **RELATIVE)
    target = target_of(load_robot("irp6"), task)
    ratios = goal_of(target, task).ratios
    assert ratios.shape == (401, 13)
    assert ratios[0] == pytest.approx(np.where(np.array(target.base.names) == "F2c", 1.5, 1.0))
    by_name = dict(zip(target.base.names, ratios[1:].T, strict=True))
    assert np.mean(by_name["X7"]) == pytest.approx(1.0, abs=0.02)
    assert np.std(by_name["X7"]) == pytest.approx(0.1, rel=0.1)
    assert by_name["F2c"].min() == pytest.approx(1.5)  # its deviation over its value
    assert by_name["X1"] == pytest.approx(1.0)  # nothing is said of it
    again = goal_of(target, task).ratios
    np.testing.assert_array_equal(again, ratios)


@pytest.mark.slow
def test_designs_for_the_worst_of_plausible_robots(tmp_path: Path) -> None:
    options = {**RELATIVE, "harmonics": 3, "starts": 1, "executor": "serial", "prior": 0.2}
    plain = excite.design_trajectory(Task("irp6", **options))
    worst = excite.design_trajectory(Task("irp6", plausible_robots=8, begin=plain, **options))
    check_design_pays(worst, plain, tmp_path / "design")


# --- what is refused -------------------------------------------------------------------------------------------------

ONE_JOINT = TaskMotion("a", ("q1",), *np.zeros((3, 2, 1)))
UNCERTAIN = "`plausible_robots` are drawn from prior knowledge"
TORQUES = {"criterion": "torque-deviation"}
REFUSED: tuple[tuple[dict[str, object], str], ...] = (
    ({"interest": ("X99",)}, "X99"),
    ({"robot": "panda", "interest": ("m4",)}, "m4 is not identifiable on its own"),
    ({"interest": ("rotor",)}, "no base parameter is one of the group rotor"),
    ({"interest": ("X5",)}, "is always 1"),
    ({"interest": ("X5",), "base": "orthonormal"}, "choose another `base`"),
    ({"criterion": "trace", "task_motion": ONE_JOINT}, "not for"),
    ({**TORQUES, "task_motion": ONE_JOINT}, "needs also q2, q3"),
    ({**TORQUES, "interest": ("X5",)}, "every parameter counts"),
    ({**TORQUES, "task_motion": "nowhere"}, "holds no design"),
    ({"plausible_robots": 5, "prior": 0.2}, UNCERTAIN),
    ({"plausible_robots": 5, "scale": "value"}, UNCERTAIN),
    ({"plausible_robots": 5, "prior": 0.2, "scale": "prior"}, UNCERTAIN),
    ({"plausible_robots": 5, "prior": 0.2, **RELATIVE, **TORQUES}, "leave `plausible_robots` out"),
)


def test_refused() -> None:
    for options, message in REFUSED:
        options = {"robot": "irp6", **options}
        with pytest.raises(InputError, match=message):
            formulate(load_robot(options["robot"]), Task(**options))
    for wrong in ({"q": [[1.0, 2.0]]}, {"q": "text"}, {"joints": None}, {"q": [[float("nan")]]}):
        content = {"name": "a", "joints": ["q1"], "q": [[0.0]], "dq": [[0.0]], "ddq": [[0.0]], **wrong}
        with pytest.raises(InputError, match="task_motion"):
            TaskMotion.from_dict(content)
