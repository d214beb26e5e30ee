"""Designs under every model: the optimiser's M(x) and its gradient against W that results report; tiny searches."""

from __future__ import annotations

import pickle
from functools import cache

import casadi as ca
import numpy as np
import pytest
from criterion_laws import slope

from constraints.linear import linear_limits
from excite.design.formulation import Formulation, formulate
from excite.design.initial_guesses import random_motion
from excite.design.optimisation import design_trajectory
from excite.design.problem import Problem
from excite.information.matrix import Information
from excite.information.target import model_of
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.models.model import RegressorModel
from regressors.models.windows import WindowModel
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
    "drives-1-2-energy-long": {"drives": ("1", "2"), "model": "energy", "window": "long"},
    "joints-1-3": {"joints": ("1", "3")},
    "joints-1-3-energy": {"joints": ("1", "3"), "model": "energy", "window_length": 0.04},
    "joints-1-3-held-elsewhere": {
        "joints": ("1", "3"), "limits": LimitChoice(position=((-3, 3), (0.2, 0.5), (-0.6, 0.6), (-1, 1), (-3, 3))),
    },
    "panda-load": {"robot": "panda", "model": "load", "joints": ("2", "5", "7"), "harmonics": 4},  # joint 4 off zero
    "drives-3-4-5-load": {"drives": ("3", "4", "5"), "model": "load"},
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


def direction(shape: tuple[int, ...], seed: int) -> Array:
    found = np.random.default_rng(seed).normal(size=shape)
    return found / np.abs(found).max()


# --- gradients -------------------------------------------------------------------------------------------------------


def test_gradient_of_the_objective(made: Formulation) -> None:
    """Of a problem as solvers see it, with friction's soft signs, against central differences."""
    problem, x = made.problem, motion(made.problem, 3)
    for seed, sharpness in ((1, 1.0), (2, 8.0)):
        gradient = problem.gradient(problem.point(x, sharpness))
        assert gradient.shape == x.shape == problem.shape
        along = direction(x.shape, seed)
        expected = slope(lambda t, d=along, s=sharpness: problem.point(x + t * d, s).value, 1e-4)
        assert np.sum(gradient * along) == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_gradient_of_any_function_of_the_information(made: Formulation) -> None:
    """``f = <G, M(x)>`` for random G, so that every entry of dM is right, not only what the criterion asks for."""
    information, x = made.problem.information, motion(made.problem, 4)
    at = information.evaluate(x)
    sizes = np.sqrt(np.diag(at.M))
    A = np.random.default_rng(5).normal(size=at.M.shape)
    G = (A + A.T) / np.outer(sizes, sizes)  # each entry of M counts alike
    along, gradient = direction(x.shape, 5), information.gradients([at], [G])[0]
    expected = slope(lambda t: float(np.sum(G * information.evaluate(x + t * along).M)), 2e-5)
    assert np.sum(gradient * along) == pytest.approx(expected, rel=1e-6, abs=1e-8 * np.abs(gradient).sum())


# --- M(x) is that of the model's own W -------------------------------------------------------------------------------


def seen(made: Formulation, width: float) -> RegressorModel:
    return model_of(made.target.robot, made.task, width).restricted(made.target.motion, made.task.model.equations)


def information(made: Formulation, width: float, count: int) -> tuple[Information, Fourier, RegressorModel]:
    """M(x) with friction whose sign turns over ``width``, on about ``count`` rows per equation; made from its parts."""
    model, robot = seen(made, width), made.target.robot
    symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
    function = VectorisedFunction(symbols, model.expression(*symbols)[:, made.target.base.index.tolist()])
    family = Fourier(made.task.trajectory.period, made.task.trajectory.harmonics)
    combination = model.combination(made.task.trajectory.period, count)
    return Information(function, family, combination, made.target.motion, np.ones(1)), family, model


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
    chain, _, model = information(made, 0.05, count)
    x = motion(made.problem)
    W = stacked(model, chain.trajectory(x), count)[:, made.target.base.index]
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
    x = motion(made.problem, 0)
    trajectory = made.problem.information.trajectory(x)
    samples = trajectory.samples(exact.times(period, made.task.output.rate))
    V, W = (model.assemble(samples)[:, index] for model in (soft, exact))
    np.testing.assert_array_equal(V[:, ~coulomb], W[:, ~coulomb])
    r = np.linalg.norm(V - W, axis=0) / np.linalg.norm(W, axis=0)
    assert made.problem.exact_value(x) == pytest.approx(np.linalg.cond(W), rel=1e-6)
    error = difference(made, made.problem.information.evaluate(x).M, x)
    assert np.all(error <= np.add.outer(r, r) + np.outer(r, r) + 0.02)
    point = made.problem.point(x, 1.0)
    assert made.problem.criterion_value(point) == pytest.approx(made.problem.exact_value(x), rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("case", [*CASES][::3])
def test_another_process_builds_the_same_problem(case: str) -> None:
    made = made_of(case)
    problem, x = pickle.loads(pickle.dumps(made.blueprint)).problem(), motion(made.problem)
    assert problem.point(x, 8.0).value == made.problem.point(x, 8.0).value
    assert problem.exact_value(x) == made.problem.exact_value(x)


# --- tiny searches ---------------------------------------------------------------------------------------------------

SEARCHED = ("energy-short", "load-integral-long", "joints-1-3", "three-axes")
LONG = ("load", "drive-2", "joints-1-3-held-elsewhere")


@pytest.mark.parametrize("case", [*SEARCHED, *(pytest.param(case, marks=pytest.mark.slow) for case in LONG)])
def test_designs_keep_limits_move_what_is_asked_and_report_the_criterion_of_their_own_regressor(case: str) -> None:
    """By the certificate over continuous time, and by dense samples; cond(W) is that of a model made anew."""
    design, task = design_trajectory(task_of(case)), task_of(case)
    assert design.feasible
    samples = design.trajectory.samples(np.linspace(0.0, task.trajectory.period, 5001))
    for limit in linear_limits(design.moving):
        values, slack = limit.values(samples), 1e-9 * (limit.upper - limit.lower)
        assert np.all((values >= limit.lower - slack) & (values <= limit.upper + slack))
    # held joints and drives stand, the others move, and all rest at both ends
    transmission = design.moving.transmission
    np.testing.assert_allclose([samples.dq[[0, -1]], samples.ddq[[0, -1]]], 0.0, atol=1e-9)
    drives = [k for k, drive in enumerate(transmission.drives) if not drive.rests]
    rates = np.abs(samples.dq @ transmission.coupling[drives].T).max(axis=0)
    if task.model.drives is not None:
        speeds = {transmission.drives[k].name: rate for k, rate in zip(drives, rates, strict=True)}
        asked = {f"z{k}" for k in task.model.drives}
    else:
        speeds = dict(zip(design.moving.joint_names, np.abs(samples.dq).max(axis=0), strict=True))
        asked = {f"q{k}" for k in task.model.joints or range(1, 6)}
    assert all(speed > 0.1 if name in asked else speed < 1e-12 for name, speed in speeds.items())
    # every base parameter is seen; the search improved on its first motion
    model = model_of(design.moving, task).restricted(design.target.motion, task.model.equations)
    W = model.assemble(design.trajectory.samples(model.times(task.trajectory.period, task.output.rate)))
    assert design.condition_number == pytest.approx(np.linalg.cond(W[:, design.base.index]), rel=1e-6)
    assert design.condition_number < 1e4
    assert design.starts[0].history[-1] < design.starts[0].history[0]
    assert len(design.predicted) == design.base.rank
