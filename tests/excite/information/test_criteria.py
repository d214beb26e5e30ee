"""The condition number's smooth stand-ins, and the whole chain from a motion's coefficients to the criterion."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.design.formulation import Formulation, formulate
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem
from excite.information.criteria import ConditionNumber, condition_number
from excite.information.matrix import Information
from excite.information.target import model_of
from excite.registry import CRITERIA, instance
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.errors import UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.model import RegressorModel
from regressors.readers.library import built_in
from regressors.samples import Array
from regressors.symbolic.vectorised import VectorisedFunction

SEED = st.integers(0, 2**32 - 1)
SHARPNESS = st.sampled_from([1.0, 2.0, 8.0, 32.0])
CRITERION = ConditionNumber()


def random_matrix(seed: int, size: int = 6, spread: float = 2.0) -> tuple[Array, Array]:
    """W and ``M = W'W / N`` whose eigenvalues lie within some powers of ten."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(40, size)) * 10.0 ** rng.uniform(-spread / 2, spread / 2, size)
    return W, W.T @ W / 40


def slope(function: Callable[[float], float], h: float) -> float:
    """Derivative at zero by central differences of fourth order."""
    return (8 * (function(h) - function(-h)) - (function(2 * h) - function(-2 * h))) / (12 * h)


# --- the criterion, as a function of M -------------------------------------------------------------------------------


@given(SEED)
def test_value_is_the_condition_number_of_the_regressor(seed: int) -> None:
    W, M = random_matrix(seed)
    assert CRITERION.value(M) == pytest.approx(np.linalg.cond(W), rel=1e-9)
    assert condition_number(M) == CRITERION.value(M)


def test_singular_matrix() -> None:
    assert condition_number(np.diag([1.0, 0.0])) == np.inf
    assert condition_number(np.diag([1.0, -1e-20])) == np.inf
    for p in CRITERION.stages:
        value, G = CRITERION.smooth(np.diag([1.0, 0.0]), p)
        assert value > 100
        assert np.all(np.isfinite(G))


@given(SEED, SHARPNESS)
def test_gradient_equals_finite_differences(seed: int, p: float) -> None:
    _, M = random_matrix(seed, spread=1.0)
    A = np.random.default_rng(seed).normal(size=M.shape)
    root = np.linalg.cholesky(M)
    direction = root @ ((A + A.T) / np.linalg.norm(A + A.T, 2)) @ root.T  # changes every eigenvalue by like parts
    _, G = CRITERION.smooth(M, p)
    expected = slope(lambda t: CRITERION.smooth(M + t * direction, p)[0], 2e-3 / p)
    np.testing.assert_allclose(G, G.T, atol=1e-10 * np.abs(G).max())
    assert np.sum(G * direction) == pytest.approx(expected, rel=1e-6, abs=1e-7)


@given(SEED, SHARPNESS)
def test_stand_in_is_the_function_that_it_says(seed: int, p: float) -> None:
    """``(1/2p) (log tr M^p + log tr M^-p)`` by matrix powers."""
    _, M = random_matrix(seed, spread=1.0)
    M = M / np.linalg.norm(M, 2)
    powers = [np.linalg.matrix_power(matrix, int(p)) for matrix in (M, np.linalg.inv(M))]
    expected = sum(np.log(np.trace(power)) for power in powers) / (2 * p)
    assert CRITERION.smooth(M, p)[0] == pytest.approx(expected, rel=1e-8)


@given(SEED)
def test_first_stage_is_the_frobenius_condition_number_of_the_regressor(seed: int) -> None:
    W, M = random_matrix(seed)
    frobenius = np.linalg.norm(W) * np.linalg.norm(np.linalg.pinv(W))
    assert np.exp(CRITERION.smooth(M, 1.0)[0]) == pytest.approx(frobenius, rel=1e-9)


@given(SEED, SHARPNESS)
def test_stand_in_is_an_upper_bound_and_tends_to_the_condition_number(seed: int, p: float) -> None:
    _, M = random_matrix(seed, spread=3.0)
    log_cond = np.log(condition_number(M))
    value, sharper = CRITERION.smooth(M, p)[0], CRITERION.smooth(M, 2 * p)[0]
    assert log_cond - 1e-9 <= sharper <= value + 1e-12  # eigenvalues of M are good to 1e-16 of the largest
    assert value - log_cond <= np.log(len(M)) / p + 1e-12  # each trace counts the extreme eigenvalue at most b times
    assert CRITERION.smooth(M, 1e6)[0] == pytest.approx(log_cond, abs=1e-5)


def test_stand_in_is_exact_only_where_all_eigenvalues_are_extreme_once() -> None:
    assert CRITERION.smooth(np.diag([1.0, 100.0]), 32.0)[0] == pytest.approx(np.log(10.0), rel=1e-12)
    value, G = CRITERION.smooth(np.eye(4), 8.0)
    assert value == pytest.approx(np.log(4) / 8)
    np.testing.assert_allclose(G, 0.0, atol=1e-15)


@given(SEED, SHARPNESS, st.floats(-12, 12))
def test_scale_and_rotation_do_not_matter(seed: int, p: float, power: float) -> None:
    """f(s M) = f(M), so G(s M) = G(M) / s and <G, M> = 0; f(Q M Q') = f(M) with gradient Q G Q'."""
    _, M = random_matrix(seed)
    value, G = CRITERION.smooth(M, p)
    s = 10.0**power
    scaled, G_scaled = CRITERION.smooth(s * M, p)
    assert scaled == pytest.approx(value, abs=1e-9)
    np.testing.assert_allclose(G_scaled * s, G, atol=1e-8 * np.abs(G).max())
    assert abs(np.sum(G * M)) <= 1e-9
    assert condition_number(s * M) == pytest.approx(condition_number(M), rel=1e-9)
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=M.shape))[0]
    turned, G_turned = CRITERION.smooth(Q @ M @ Q.T, p)
    assert turned == pytest.approx(value, abs=1e-9)
    np.testing.assert_allclose(G_turned, Q @ G @ Q.T, atol=1e-6 * np.abs(G).max())


def test_large_powers_do_not_overflow() -> None:
    value, G = CRITERION.smooth(np.diag([1e-200, 1.0, 1e200]), 32.0)
    assert value == pytest.approx(200 * np.log(10.0), rel=1e-12)
    assert np.all(np.isfinite(G))


# --- the whole chain -------------------------------------------------------------------------------------------------


TASKS = {
    "irp6": Task("irp6", harmonics=3),
    "irp6-five-axes": Task("irp6", joints=("1", "2", "3", "4", "5"), rotor=False, offset=True),
    "irp6-joints-1-3": Task("irp6", joints=("1", "3")),
    "irp6-motor-2": Task("irp6", drives=("z2",)),
    "panda": Task("panda"),
    "panda-joints-2-6": Task("panda", drives=("2", "6")),  # the fourth joint rests at -0.0698
}


@pytest.fixture(scope="module", params=TASKS)
def made(request: pytest.FixtureRequest) -> Formulation:
    """Design problems with friction, of one to seven moving coordinates."""
    task = TASKS[request.param]
    return formulate(built_in(task.robot), task)


def motion(problem: Problem, seed: int = 0) -> Array:
    return random_motion(problem, np.random.default_rng(seed))


def soft_model(made: Formulation, width: float) -> RegressorModel:
    """The task's model with friction whose sign turns over ``width``."""
    return model_of(made.target.robot, made.task, width).restricted(made.target.motion)


def information(made: Formulation, width: float, count: int) -> Information:
    """M(x) in the base columns, at ``count`` instants; made from its parts."""
    model = soft_model(made, width)
    symbols = [ca.SX.sym(name, model.robot.n) for name in ("q", "dq", "ddq")]
    function = VectorisedFunction(symbols, model.expression(*symbols)[:, made.target.base.index.tolist()])
    family = Fourier(made.task.trajectory.period, made.task.trajectory.harmonics)
    return Information(function, family, model.combination(made.task.trajectory.period, count), made.target.motion)


def stacked(made: Formulation, x: Array, width: float, time: Array) -> Array:
    """W in all columns from the model's own assembly, for a motion in which held coordinates stand where they are."""
    family, motion = Fourier(made.task.trajectory.period, made.task.trajectory.harmonics), made.target.motion
    coefficients = motion.matrix @ x + np.outer(motion.offset, family.constant)
    return soft_model(made, width).assemble(Trajectory(family, coefficients).samples(time))


def written(made: Formulation) -> Array:
    """Instants of the task's rate, both ends included."""
    return np.linspace(0.0, made.task.trajectory.period, round(made.task.output.rate * made.task.trajectory.period) + 1)


@pytest.mark.parametrize("width", [0.01, 0.3])
def test_information_is_that_of_the_stacked_regressor(made: Formulation, width: float) -> None:
    count, x = 150, motion(made.problem)
    M = information(made, width, count).evaluate(x).M
    W = stacked(made, x, width, np.arange(count) * made.task.trajectory.period / count)[:, made.target.base.index]
    np.testing.assert_allclose(M, W.T @ W / count, rtol=1e-9, atol=1e-11 * np.abs(M).max())


def test_criterion_of_a_problem_is_that_of_the_exact_regressor_at_the_tasks_rate(made: Formulation) -> None:
    problem, x = made.problem, motion(made.problem)
    W = stacked(made, x, 0.0, written(made))[:, made.target.base.index]
    assert problem.exact_value(x) == pytest.approx(np.linalg.cond(W), rel=1e-6)
    soft = problem.criterion_value(problem.point(x, 1.0))
    assert soft == pytest.approx(problem.exact_value(x), rel=0.2)  # the optimiser sees much the same


def test_gradient_of_any_function_of_the_information(made: Formulation) -> None:
    """``f = <G, M(x)>`` for a random G, down to the coefficients, friction's soft sign included."""
    chain = information(made, 0.03, 120)
    x, rng = motion(made.problem), np.random.default_rng(1)
    at = chain.evaluate(x)
    A = rng.normal(size=at.M.shape)
    G = (A + A.T) / np.sqrt(np.outer(np.diag(at.M), np.diag(at.M)))  # each entry of M counts alike
    gradient = chain.gradient(at, G)
    assert gradient.shape == x.shape
    for _ in range(4):
        direction = rng.normal(size=x.shape)
        direction /= np.abs(direction).max()
        expected = slope(lambda t, d=direction: float(np.sum(G * chain.evaluate(x + t * d).M)), 2e-5)
        assert np.sum(gradient * direction) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("p", CRITERION.stages)
def test_gradient_of_the_objective(made: Formulation, p: float) -> None:
    problem, x = made.problem, motion(made.problem, 3)
    gradient = problem.gradient(problem.point(x, p))
    rng = np.random.default_rng(2)
    for _ in range(2):
        direction = rng.normal(size=x.shape)
        direction /= np.abs(direction).max()
        expected = slope(lambda t, d=direction: problem.point(x + t * d, p).value, 1e-5)
        assert np.sum(gradient * direction) == pytest.approx(expected, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("convention", ["pivoted", "orthonormal"])
@pytest.mark.parametrize("joints", [None, ("1", "2", "3", "4", "5")], ids=["three", "five"])
def test_other_conventions_of_the_criterion(convention: str, joints: tuple[str, ...] | None) -> None:
    """``M_c = T' M T``: the value against the regressor itself, the gradient against finite differences."""
    made = formulate(built_in("irp6"), Task("irp6", joints=joints, base=convention, rotor=joints is None))
    problem, x = made.problem, motion(made.problem, 5)
    W = stacked(made, x, 0.0, written(made))
    if convention == "orthonormal":
        sigma = np.linalg.svd(W, compute_uv=False)
        expected = sigma[0] / sigma[made.target.base.rank - 1]
    else:
        expected = np.linalg.cond(W[:, base_parameters(made.target.model, "pivoted").index])
    assert problem.exact_value(x) == pytest.approx(expected, rel=1e-5)
    direction = np.random.default_rng(6).normal(size=x.shape)
    direction /= np.abs(direction).max()
    difference = slope(lambda t: problem.point(x + t * direction, 2.0).value, 1e-5)
    found = np.sum(problem.gradient(problem.point(x, 2.0)) * direction)
    assert found == pytest.approx(difference, rel=1e-5, abs=1e-6)


def test_another_process_builds_the_same_problem() -> None:
    made = formulate(built_in("irp6"), Task("irp6", harmonics=3))
    first, second = made.blueprint.problem(), dataclasses.replace(made.blueprint).problem()
    x = motion(first)
    assert first.point(x, 8.0).value == second.point(x, 8.0).value


def test_soft_friction_tends_to_the_exact_one() -> None:
    made = formulate(built_in("irp6"), Task("irp6", harmonics=3))
    states = random_states(made.target.robot, 200, seed=7)
    exact = made.target.model.instants(states)
    soft, softer = (soft_model(made, width).instants(states) for width in (1e-9, 0.1))
    np.testing.assert_array_equal(soft, exact)
    assert not np.array_equal(softer, exact)


# --- the other criteria ----------------------------------------------------------------------------------------------


def information_matrix(seed: int, b: int = 6) -> np.ndarray:
    W = np.random.default_rng(seed).normal(size=(40, b)) * np.logspace(-1, 1, b)
    return W.T @ W / 40


DEFINITIONS = {
    "condition": lambda M: np.linalg.cond(np.linalg.cholesky(M).T),
    "frobenius": lambda M: np.linalg.norm(np.linalg.cholesky(M)) * np.linalg.norm(np.linalg.inv(np.linalg.cholesky(M))),
    "sigma-min": lambda M: 1 / np.linalg.svd(np.linalg.cholesky(M), compute_uv=False)[-1],
    "logdet": lambda M: np.linalg.det(M) ** (-0.5 / len(M)),
    "trace": lambda M: np.sqrt(np.trace(np.linalg.inv(M))),
}


@pytest.mark.parametrize("name", DEFINITIONS)
def test_value_is_that_of_its_definition(name: str) -> None:
    M = information_matrix(1)
    assert instance("criterion", name).value(M) == pytest.approx(DEFINITIONS[name](M), rel=1e-10)


@pytest.mark.parametrize("name", CRITERIA)
def test_stand_in_is_its_logarithm_in_the_end(name: str) -> None:
    M, made = information_matrix(2), instance("criterion", name)
    sharpest = np.inf if len(made.stages) == 1 else 4096.0
    value, _ = made.smooth(M, min(sharpest, 4096.0))
    assert value == pytest.approx(np.log(made.value(M)), abs=1e-3)
    assert made.smooth(M, made.stages[0])[0] >= np.log(made.value(M)) - 1e-12


@pytest.mark.parametrize("name", CRITERIA)
def test_gradient_of_every_stage_is_that_of_finite_differences(name: str) -> None:
    M, made = information_matrix(3), instance("criterion", name)
    A = np.random.default_rng(4).normal(size=M.shape)
    direction, h = A + A.T, 1e-6
    for sharpness in made.stages[:3]:
        slope = (made.smooth(M + h * direction, sharpness)[0] - made.smooth(M - h * direction, sharpness)[0]) / (2 * h)
        assert np.sum(made.smooth(M, sharpness)[1] * direction) == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("name", CRITERIA)
def test_singular_information_is_the_worst(name: str) -> None:
    M = np.diag([0.0, 1.0, 2.0])
    assert instance("criterion", name).value(M) > 1e100


def test_unknown_criterion() -> None:
    with pytest.raises(UnknownName, match="no criterion named 'entropy'; available: condition, frobenius"):
        instance("criterion", "entropy")
