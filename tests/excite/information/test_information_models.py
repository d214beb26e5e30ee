"""Designs under every model: the optimiser's M(x) and its gradient against W that results report; tiny searches."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from constraints.linear import linear_limits
from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.initial_guesses import random_motion
from excite.design.optimisation import design_trajectory
from excite.design.problem import Problem
from excite.information.matrix import Information
from excite.information.target import model_of
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.errors import InputError
from regressors.models.energy import EnergyModel
from regressors.models.model import Combination, RegressorModel
from regressors.models.windows import Window, WindowModel
from regressors.readers.library import built_in
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array

TURNED = {"sensor": "4", "sensor_xyz": (0.02, -0.1, 0.05), "sensor_rpy": (0.4, -0.3, 1.2)}
CASES: dict[str, dict[str, object]] = {
    "energy-short": {"model": "energy"},
    "energy-long": {"model": "energy", "window": "long"},
    "load": {"model": "load"},
    "load-turned": {"model": "load", "equations": ("fz", "nx", "ny"), **TURNED},
    "load-integral-short": {"model": "load-integral", "window_length": 0.02},
    "load-integral-long": {"model": "load-integral", "window": "long", "equations": ("nx", "fx", "fz", "nz"), **TURNED},
    "drive-2": {"drives": ("2",)},
    "drive-2-energy": {"drives": ("2",), "model": "energy"},
    "drives-1-2-energy-long": {"drives": ("1", "2"), "model": "energy", "window": "long"},
    "joints-1-3": {"joints": ("1", "3")},
    "joints-1-3-energy": {"joints": ("1", "3"), "model": "energy", "window_length": 0.04},
    "joints-1-3-held-elsewhere": {
        "joints": ("1", "3"), "limits": LimitChoice(position=((-3, 3), (0.2, 0.5), (-0.6, 0.6), (-1, 1), (-3, 3))),
    },
    "panda-load": {"robot": "panda", "model": "load", "joints": ("2", "5", "7"), "harmonics": 4},  # joint 4 off zero
    "drives-3-4-5-load": {"drives": ("3", "4", "5"), "model": "load"},
    "five-axes-energy": {
        "joints": tuple("12345"), "model": "energy", "harmonics": 8, "period": 10.0, "rotor": False, "offset": True,
    },
    "panda-energy": {"robot": "panda", "model": "energy", "harmonics": 8, "period": 10.0},
    "three-axes": {},
    "five-axes": {"joints": tuple("12345"), "rotor": False, "offset": True, "harmonics": 5, "period": 10.0},
    "panda": {"robot": "panda", "harmonics": 5, "period": 10.0},
    "panda-drives-2-6": {"robot": "panda", "drives": ("2", "6")},  # the fourth joint rests at -0.0698
}  # fmt: skip


def task_of(case: str) -> Task:
    return Task(**{"robot": "irp6", "period": 6.0, "harmonics": 3, "starts": 1, "executor": "serial", **CASES[case]})


@cache
def made_of(case: str) -> Formulation:
    task = task_of(case)
    return formulate(built_in(task.robot), task)


@pytest.fixture(params=CASES)
def made(request: pytest.FixtureRequest) -> Formulation:
    return made_of(request.param)


def motion(problem: Problem, seed: int = 0) -> Array:
    return random_motion(problem, np.random.default_rng(seed))


def slope(function: Callable[[float], float], h: float) -> float:
    """Derivative at zero by central differences of fourth order."""
    return (8 * (function(h) - function(-h)) - (function(2 * h) - function(-2 * h))) / (12 * h)


def direction(shape: tuple[int, ...], seed: int) -> Array:
    found = np.random.default_rng(seed).normal(size=shape)
    return found / np.abs(found).max()


# --- gradients -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sharpness", [1.0, 8.0])
def test_gradient_of_the_objective(made: Formulation, sharpness: float) -> None:
    """Of a problem as solvers see it, with friction's soft signs, against central differences."""
    problem, x = made.problem, motion(made.problem, 3)
    gradient = problem.gradient(problem.point(x, sharpness))
    assert gradient.shape == x.shape == problem.shape
    for seed in (1, 2):
        along = direction(x.shape, seed)
        expected = slope(lambda t, d=along: problem.point(x + t * d, sharpness).value, 1e-4)
        assert np.sum(gradient * along) == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_gradient_of_any_function_of_the_information(made: Formulation) -> None:
    """``f = <G, M(x)>`` for random G, so that every entry of dM is right, not only what the criterion asks for."""
    information, x = made.problem.information, motion(made.problem, 4)
    at = information.evaluate(x)
    sizes = np.sqrt(np.diag(at.M))
    for seed in (5, 6):
        A = np.random.default_rng(seed).normal(size=at.M.shape)
        G = (A + A.T) / np.outer(sizes, sizes)  # each entry of M counts alike
        along = direction(x.shape, seed)
        expected = slope(lambda t, d=along, G=G: float(np.sum(G * information.evaluate(x + t * d).M)), 2e-5)
        scale = np.abs(information.gradient(at, G)).sum()
        assert np.sum(information.gradient(at, G) * along) == pytest.approx(expected, rel=1e-6, abs=1e-8 * scale)


# --- M(x) is that of the model's own W -------------------------------------------------------------------------------


def seen(made: Formulation, width: float) -> RegressorModel:
    return model_of(made.target.robot, made.task, width).restricted(made.target.motion, made.task.model.equations)


def information(made: Formulation, width: float, count: int) -> tuple[Information, Fourier, RegressorModel]:
    """M(x) with friction whose sign turns over ``width``, on about ``count`` rows per equation; made from its parts."""
    model, robot = seen(made, width), made.target.robot
    symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
    function = VectorisedFunction(symbols, model.expression(*symbols)[:, made.target.base.index.tolist()])
    family = Fourier(made.task.trajectory.period, made.task.trajectory.harmonics)
    return (
        Information(function, family, model.combination(made.task.trajectory.period, count), made.target.motion),
        family,
        model,
    )


def stacked(model: RegressorModel, trajectory: Trajectory, count: int) -> Array:
    """W by the model's own `assemble`: at ``count`` instants, or window by window, as the optimiser's weights say."""
    period = trajectory.duration
    if not isinstance(model, WindowModel):
        return model.assemble(trajectory.samples(np.arange(count) * period / count))
    if model.window.kind == "long":
        return model.assemble(trajectory.samples(np.linspace(0.0, period, 2 * count + 1)))
    length = model.window.length
    starts = np.linspace(0.0, period - length, count)
    rows = [model.assemble(trajectory.samples(start + length * np.array([0.0, 0.5, 1.0]))) for start in starts]
    return np.vstack(rows) / length


def test_information_is_that_of_the_stacked_regressor(made: Formulation) -> None:
    """With soft signs, whose integrals are Simpson's in both; only the order of summation differs."""
    count = 40
    chain, family, model = information(made, 0.05, count)
    x = motion(made.problem)
    W = stacked(model, Trajectory(family, chain.joint_coefficients(x)), count)[:, made.target.base.index]
    M = W.T @ W / (W.shape[0] / len(model.row_labels))
    sizes = np.sqrt(np.diag(M))
    np.testing.assert_allclose(chain.evaluate(x).M / np.outer(sizes, sizes), M / np.outer(sizes, sizes), atol=1e-8)


def scale_of_rows(model: RegressorModel) -> float:
    """The optimiser's short windows are means over the window, those of results integrals."""
    return model.window.length if isinstance(model, WindowModel) and model.window.kind == "short" else 1.0


def difference(made: Formulation, M: Array, x: Array) -> Array:
    """M against that of results, entry by entry, in units of the columns' sizes."""
    exact = made.problem.objective.exact_matrix(x)
    sizes = np.sqrt(np.diag(exact))
    return np.abs(scale_of_rows(made.target.model) ** 2 * M - exact) / np.outer(sizes, sizes)


def width_of(problem: Problem) -> float:
    """Velocity over which the optimiser's signs turn: 2 % of the slowest velocity limit."""
    limits = (limit.function.constraint for limit in problem.limits.linear)
    return 0.02 * min(float(limit.upper.min()) for limit in limits if limit.derivative == 1)


def coulomb_of(made: Formulation) -> Array:
    columns = made.target.model.columns
    coulomb = np.array([c.group == "friction" and c.name.endswith("c") for c in columns])
    return np.asarray(coulomb[made.target.base.index])


def test_optimiser_sees_nearly_what_results_report(made: Formulation) -> None:
    """Against W at the task's rate with exact signs.

    Rows are fewer, and count the rests at the ends differently: 2 %. To that comes what soft signs take from the
    Coulomb columns, and only from them: r of a column's size, hence r_i + r_j + r_i r_j of an entry of M.
    """
    index, coulomb, period = made.target.base.index, coulomb_of(made), made.task.trajectory.period
    exact, soft = seen(made, 0.0), seen(made, width_of(made.problem))
    for seed in range(3 if made.task.robot == "irp6" else 1):
        x = motion(made.problem, seed)
        trajectory = Trajectory(made.problem.family, made.problem.information.joint_coefficients(x))
        samples = trajectory.samples(exact.times(period, made.task.output.rate))
        V, W = (model.assemble(samples)[:, index] for model in (soft, exact))
        np.testing.assert_array_equal(V[:, ~coulomb], W[:, ~coulomb])
        r = np.linalg.norm(V - W, axis=0) / np.linalg.norm(W, axis=0)
        assert made.problem.exact_value(x) == pytest.approx(np.linalg.cond(W), rel=1e-6)
        error = difference(made, made.problem.information.evaluate(x).M, x)
        assert np.all(error <= np.add.outer(r, r) + np.outer(r, r) + 0.02)
        point = made.problem.point(x, 1.0)
        assert made.problem.criterion_value(point) == pytest.approx(made.problem.exact_value(x), rel=0.2)


@pytest.mark.parametrize("case", ["energy-short", "energy-long", "drive-2-energy", "drives-1-2-energy-long"])
def test_soft_signs_take_no_more_than_their_width(case: str) -> None:
    """``u - u tanh(u / w)`` lies between 0 and 0.2785 w, so a window's path is short of the exact one by that much."""
    made = made_of(case)
    period, width = made.task.trajectory.period, width_of(made.problem)
    trajectory = Trajectory(made.problem.family, made.problem.information.joint_coefficients(motion(made.problem, 8)))
    samples = trajectory.samples(np.linspace(0.0, period, 12001))
    V, W = (seen(made, w).assemble(samples)[:, made.target.base.index][:, coulomb_of(made)] for w in (width, 0.0))
    first, last = made.target.model.window.ends(samples.time)
    lasted = (samples.time[last] - samples.time[first])[:, None]
    missing = W - V
    assert missing.min() >= -1e-9
    assert (missing / (width * lasted)).max() <= 0.2785 + 1e-6
    assert missing.max() > 1e-4 * width * period / len(W)


@pytest.mark.parametrize("case", ["energy-short", "energy-long", "load", "load-integral-short", "drive-2-energy"])
def test_information_tends_to_what_results_report(case: str) -> None:
    """Many rows and sharp signs leave only what the rests at the ends count: one in N, of theirs and of ours."""
    made, x = made_of(case), motion(made_of(case).problem, 7)
    exact = made.target.model
    theirs = exact.assemble(Trajectory(made.problem.family, made.problem.information.joint_coefficients(x)).samples(
        exact.times(made.task.trajectory.period, made.task.output.rate))).shape[0] / len(exact.row_labels)  # fmt: skip
    for count in (200, 800):
        error = difference(made, information(made, 1e-6, count)[0].evaluate(x).M, x)
        assert error.max() <= 1.5 / theirs + 1.5 / count


@pytest.mark.slow
def test_another_process_builds_the_same_problem(made: Formulation) -> None:
    problem, x = pickle.loads(pickle.dumps(made.blueprint)).problem(), motion(made.problem)
    assert problem.point(x, 8.0).value == made.problem.point(x, 8.0).value
    assert problem.exact_value(x) == made.problem.exact_value(x)


# --- weights ---------------------------------------------------------------------------------------------------------


@given(duration=st.floats(0.5, 20.0), count=st.integers(3, 60), part=st.floats(0.001, 0.9))
def test_weights_of_short_windows(duration: float, count: int, part: float) -> None:
    """Mean slopes and mean values over windows that lie within the motion, of every cubic exactly."""
    length = part * duration
    weights = EnergyModel(built_in("irp6"), window=Window("short", length)).combination(duration, count)
    assert weights.time.min() >= 0.0
    assert weights.time.max() <= duration * (1 + 1e-12)
    starts = np.linspace(0.0, duration - length, count)
    assert_weights(weights, starts, starts + length, 1.0 / length)


@given(duration=st.floats(0.5, 20.0), count=st.integers(3, 60))
def test_weights_of_long_windows(duration: float, count: int) -> None:
    """Changes and integrals from the start on, up to instants that are spread evenly, of every cubic exactly."""
    weights = EnergyModel(built_in("irp6"), window=Window("long")).combination(duration, count)
    ends = np.linspace(0.0, duration, 2 * count + 1)[1:]
    np.testing.assert_allclose(weights.time, [0.0, *ends])
    assert_weights(weights, np.zeros_like(ends), ends, 1.0, degree=2)  # every second instant ends a parabola's half


def assert_weights(weights: Combination, start: Array, end: Array, scale: float, degree: int = 3) -> None:
    assert weights.integral is not None
    for power in range(degree + 1):
        value, antiderivative = (lambda t, p=power: t**p), (lambda t, p=power: t ** (p + 1) / (p + 1))
        found = weights.difference @ value(weights.time), weights.integral @ value(weights.time)
        expected = scale * (value(end) - value(start)), scale * (antiderivative(end) - antiderivative(start))
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-10 * max(1.0, scale) * max(1.0, end.max()) ** (power + 1))


# --- tiny searches ---------------------------------------------------------------------------------------------------

SEARCHED = [case for case in CASES if "panda" not in case and case not in ("five-axes-energy", "load-turned")]


@cache
def designed(case: str) -> Design:
    task = task_of(case)
    return design_trajectory(task)


@pytest.fixture(params=SEARCHED)
def case(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.mark.slow
def test_designs_keep_every_limit(case: str) -> None:
    """By the certificate over continuous time, and by dense samples of all joints and drives that the robot has."""
    design = designed(case)
    assert design.feasible
    samples = design.trajectory.samples(np.linspace(0.0, design.task.trajectory.period, 5001))
    for limit in linear_limits(design.moving):
        values = limit.values(samples)
        slack = 1e-9 * (limit.upper - limit.lower)
        assert np.all(values >= limit.lower - slack)
        assert np.all(values <= limit.upper + slack)


def test_designs_move_what_they_were_asked_to_move(case: str) -> None:
    """Held joints and drives stand, the others move, and all rest at both ends."""
    design = designed(case)
    samples = design.trajectory.samples(np.linspace(0.0, design.task.trajectory.period, 601))
    transmission = design.moving.transmission
    np.testing.assert_allclose(samples.dq[[0, -1]], 0.0, atol=1e-9)
    np.testing.assert_allclose(samples.ddq[[0, -1]], 0.0, atol=1e-9)
    by_joint = dict(zip(design.moving.joint_names, np.abs(samples.dq).max(axis=0), strict=True))
    drives = [k for k, drive in enumerate(transmission.drives) if not drive.rests]
    rates = np.abs(samples.dq @ transmission.coupling[drives].T).max(axis=0)
    by_drive = {transmission.drives[k].name: rate for k, rate in zip(drives, rates, strict=True)}
    if design.task.model.drives is not None:
        speeds, asked = by_drive, {f"z{k}" for k in design.task.model.drives}
    else:
        speeds, asked = by_joint, {f"q{k}" for k in design.task.model.joints or range(1, 6)}
    assert all((speed > 0.1) == (name in asked) for name, speed in speeds.items())
    assert all(speed > 0.1 or speed < 1e-12 for speed in speeds.values())


def test_designs_report_the_criterion_of_their_own_regressor(case: str) -> None:
    """cond(W) of a model made anew, and every base parameter is seen; the search improved on its first motion."""
    design = designed(case)
    model = model_of(design.moving, design.task).restricted(design.target.motion, design.task.model.equations)
    W = model.assemble(design.trajectory.samples(model.times(design.task.trajectory.period, design.task.output.rate)))
    assert design.condition_number == pytest.approx(np.linalg.cond(W[:, design.base.index]), rel=1e-6)
    assert design.condition_number < 1e4
    assert design.starts[0].history[-1] < design.starts[0].history[0]
    assert len(design.predicted) == design.base.rank


@pytest.mark.parametrize("length", [6.5, 20.0])
def test_a_window_longer_than_the_motion_is_refused_before_the_search(length: float) -> None:
    with pytest.raises(InputError, match="longer than the motion"):
        formulate(built_in("irp6"), Task("irp6", model="energy", period=6.0, harmonics=3, window_length=length))
