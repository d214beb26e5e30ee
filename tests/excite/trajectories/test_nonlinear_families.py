"""Families that are not linear in x: waypoints at free times, sines of free frequencies; and their search."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import Here, run
from scipy.interpolate import BPoly

from constraints.linear import LinearConstraint
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.grid_limits import GridConstraint
from excite.design.initial_guesses import candidates, random_motion
from excite.design.problem import Problem
from excite.design.solvers.descent import SqpOptions
from excite.design.solvers.sqp import SequentialQuadratic
from excite.tasks.task import Task
from excite.trajectories import Trajectory, stored_trajectory
from excite.trajectories.fourier import FourierQuintic
from excite.trajectories.nonlinear import NonlinearFamily
from excite.trajectories.sines import Sines
from excite.trajectories.waypoints import Waypoints
from regressors.errors import InputError
from regressors.readers.library import load_robot
from regressors.samples import Array

FAMILIES: dict[str, Callable[[], NonlinearFamily]] = {
    "waypoints": lambda: Waypoints(7.0, 5),
    "fewest intervals": lambda: Waypoints(0.8, 2),
    "sines": lambda: Sines(7.0, 4),
    "one sine": lambda: Sines(20.0, 1),
}
OPTIONS = {"waypoints": {"intervals": 5}, "sines": {"harmonics": 4}}


@pytest.fixture(params=FAMILIES)
def family(request: pytest.FixtureRequest) -> NonlinearFamily:
    return FAMILIES[request.param]()


def motion(family: NonlinearFamily, seed: int, count: int = 2) -> Array:
    """A random motion of a random shape."""
    rng = np.random.default_rng(seed)
    x = family.resting(rng.normal(size=count), rng)
    family.split(x)[0][:] += rng.normal(size=(count, family.size))
    return x


def slope(function: Callable[[Array], Array], x: Array, step: float = 1e-6) -> Array:
    """Central differences, the last axis that of x."""
    return np.stack([(function(x + d) - function(x - d)) / (2 * step) for d in step * np.eye(x.size)], axis=-1)


# --- laws ------------------------------------------------------------------------------------------------------------


def test_each_derivative_is_the_slope_of_the_one_before(family: NonlinearFamily) -> None:
    x, h = motion(family, 1), 1e-5 * family.duration
    t = np.random.default_rng(1).uniform(2 * h, family.duration - 2 * h, 40)
    for d in range(4):
        found = (family.motion(x, t + h, d) - family.motion(x, t - h, d)) / (2 * h)
        expected = family.motion(x, t, d + 1)
        same = np.abs(found - expected).max(axis=1) < 1e-4 * np.abs(expected).max()
        assert same.mean() > 0.9 if d > 1 else same.all()  # jerk jumps at a waypoint: a step across one says nothing


def test_every_motion_rests_at_both_ends_and_returns(family: NonlinearFamily) -> None:
    x, ends, inside = motion(family, 2), np.array([0.0, family.duration]), np.linspace(0, family.duration, 300)
    for d in (1, 2):
        assert np.abs(family.motion(x, ends, d)).max() <= 1e-11 * np.abs(family.motion(x, inside, d)).max()
    first, last = family.motion(x, ends, 0)
    np.testing.assert_allclose(first, last, atol=1e-11)


@pytest.mark.parametrize("derivative", range(4))
def test_slopes_by_x(family: NonlinearFamily, derivative: int) -> None:
    """At fixed instants, and at nodes that move with x."""
    x, t = motion(family, 3), family.duration * np.random.default_rng(3).uniform(size=30)
    found = family.jacobian(x, t, derivative)
    expected = slope(lambda x: family.coordinate_motion(x, t, derivative), x)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    grid, some = family.on_grid(64), np.arange(0, 64, 5)
    tangent = grid.tangent(x, [derivative], some)
    expected = slope(lambda x: grid.values(x, derivative, some), x)
    k, place = expected.shape[1], np.arange(some.size)
    found = np.stack([tangent.rows(np.tile(unit, (some.size, 1, 1)), place) for unit in np.eye(k)], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


def test_motions_are_drawn_towards_a_pose(family: NonlinearFamily) -> None:
    x, t, pose = motion(family, 4), np.linspace(0, family.duration, 50), np.array([0.3, -2.0])
    drawn = family.motion(family.drawn(x, pose, 0.25), t, 0)
    np.testing.assert_allclose(drawn, pose + 0.25 * (family.motion(x, t, 0) - pose), atol=1e-11)
    np.testing.assert_allclose(family.motion(family.resting(pose), t, 0), np.tile(pose, (50, 1)), atol=1e-12)


def test_joints_are_carried_by_coordinates(family: NonlinearFamily) -> None:
    """Over two maps, one after the other."""
    rng, t, x = np.random.default_rng(11), np.linspace(0, family.duration, 40), motion(family, 11)
    (A, a), (B, b) = ((rng.normal(size=(rows, 3 if rows == 4 else 2)), rng.normal(size=rows)) for rows in (3, 4))
    carried = Trajectory(family, x).carried(A, a).carried(B, b)
    np.testing.assert_allclose(carried.samples(t).q, (family.motion(x, t, 0) @ A.T + a) @ B.T + b, atol=1e-10)
    jerk = np.abs(carried.family.motion(x, np.linspace(0, family.duration, 5001), 3)).max(axis=0)
    np.testing.assert_allclose(carried.jerk, jerk, rtol=2e-2)
    dq = carried.samples(np.array([0.0, family.duration])).dq
    np.testing.assert_array_equal(dq, np.zeros((2, 4)))


@pytest.mark.parametrize("derivative", range(4))
def test_extrema_are_those_of_dense_samples(family: NonlinearFamily, derivative: int) -> None:
    """Of combinations of joints that are carried by two coordinates."""
    rng = np.random.default_rng(5)
    carried = Trajectory(family, motion(family, 5)).carried(rng.normal(size=(3, 2)), rng.normal(size=3))
    matrix, offset = rng.normal(size=(2, 3)), rng.normal(size=2)
    t = np.linspace(0, family.duration, 20_001)
    values = carried.family.motion(carried.x, t, derivative) @ matrix.T + (offset if derivative == 0 else 0.0)
    size = np.abs(values).max(axis=0)
    found = carried.family.combined_extrema(carried.x, matrix, offset, derivative)
    for exact, sampled in ((found.high, values.max(axis=0)), (-found.low, -values.min(axis=0))):
        assert np.all(exact >= sampled - 1e-9 * size)
        assert np.all(exact <= sampled + 3e-3 * size)


@pytest.mark.parametrize("derivative", range(4))
def test_what_stays_within_the_grid_bounds_stays_within_the_bounds(family: NonlinearFamily, derivative: int) -> None:
    one = np.ones(1)
    limit = LinearConstraint(derivative, np.eye(1), np.zeros(1), -one, one, ("a",), ("rad",))
    grid = GridConstraint.on_coordinates(limit, family.on_grid(512))
    for seed in range(5):
        x = motion(family, seed, 1)
        x = family.drawn(x, np.zeros(1), float(grid.upper[0]) / np.abs(grid.values(x)).max())
        assert np.abs(grid.values(x)).max() == pytest.approx(grid.upper[0])
        found = Trajectory(family, x).extrema(limit)
        assert max(float(found.high[0]), -float(found.low[0])) <= 1.0 + 1e-9
    assert grid.upper[0] > 0.98


def test_a_motion_read_back_is_the_same_motion(family: NonlinearFamily) -> None:
    rng, t = np.random.default_rng(6), np.linspace(0, family.duration, 100)
    moving = Trajectory(family, motion(family, 6)).carried(rng.normal(size=(3, 2)), rng.normal(size=3))
    again = stored_trajectory(json.loads(json.dumps(moving.family.to_dict(moving.x))), 3)
    np.testing.assert_allclose(again.samples(t).ddq, moving.samples(t).ddq, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(again.samples(t).q, moving.samples(t).q, rtol=1e-11, atol=1e-11)
    assert (type(again.family), again.family.described) == (type(family), family.described)


def test_the_nearest_motion_to_one_of_the_family_is_that_motion(family: NonlinearFamily) -> None:
    """From another shape, which has to be found."""
    rng = np.random.default_rng(7)
    x = family.resting(np.zeros(2), rng)
    count = family.split(x)[1].size
    x[-count:] = family.shape(2) + 0.3 * (x[-count:] - family.shape(2))
    family.split(x)[0][:] += rng.normal(size=(2, family.size))
    t = np.linspace(0, family.duration, 201)
    wanted = family.motion(x, t, 0)
    found = family.nearest(t, wanted)
    assert np.abs(family.motion(found, t, 0) - wanted).max() < 0.02 * np.ptp(wanted)
    assert np.abs(found[-count:] - family.shape(2)).max() > 0.01


@pytest.mark.parametrize("name", OPTIONS)
def test_families_grow(name: str) -> None:
    chosen = Task("irp6", trajectory=name).trajectory
    option, value = chosen.finer(2).richness
    assert value == getattr(chosen, option) + 2
    assert chosen.finer().family().size > chosen.family().size


# --- each family is what it says -------------------------------------------------------------------------------------


def test_waypoints_are_passed_as_stated() -> None:
    """SciPy's polynomial from derivatives at the file's knots."""
    family = Waypoints(6.0, 4)
    x, t = motion(family, 8), np.linspace(0, 6, 200)
    series = family.to_dict(x)
    assert sum(series["durations"]) == pytest.approx(6.0)
    assert min(series["durations"]) > 6.0 / 4 / 4
    knots = np.concatenate([[0.0], np.cumsum(series["durations"])])
    states = np.array([series[part] for part in ("position", "velocity", "acceleration")])
    for d in range(3):
        for k in range(2):
            spline = BPoly.from_derivatives(knots, states[:, k].T.tolist()).derivative(d)
            np.testing.assert_allclose(family.motion(x, t, d)[:, k], spline(np.clip(t, 0, knots[-1])), atol=1e-9)


def test_sines_are_a_sum_of_sines_and_a_quintic() -> None:
    family = Sines(6.0, 3)
    x, t = motion(family, 9), np.linspace(0, 6, 200)
    series = {key: np.array(family.to_dict(x)[key]) for key in ("offset", "amplitude", "frequency", "phase")}
    assert np.all((series["frequency"] > np.pi / 6) & (series["frequency"] < np.pi))
    for k, (c, A, w, phase) in enumerate(zip(*series.values(), strict=True)):
        rest = family.motion(x, t, 0)[:, k] - c - np.sin(np.outer(t, w) + phase) @ A
        fit = np.polynomial.Polynomial.fit(t, rest, 5)
        np.testing.assert_allclose(fit(t), rest, atol=1e-9)
        assert fit(0.0) == pytest.approx(0.0, abs=1e-9)


def test_sines_of_whole_frequencies_are_a_series_with_a_quintic() -> None:
    """The linear family is part of the nonlinear one: the polynomial is the only one that brings both to rest."""
    linear, family = FourierQuintic(5.0, 3), Sines(5.0, 3)
    y, t = np.random.default_rng(10).normal(size=(2, linear.size)), np.linspace(0, 5, 100)
    series = linear.to_dict(y)
    amplitude = np.array(series["sine"]) + 1j * np.array(series["cosine"])
    waves = {
        "amplitude": np.abs(amplitude),
        "phase": np.angle(amplitude),
        "frequency": np.tile([1, 2, 3], (2, 1)) * 0.4 * np.pi,
    }
    x = family.restored({"offset": [0.0, 0.0], **waves})
    expected = linear.motion(y, t, 0)
    np.testing.assert_allclose(family.motion(x, t, 0) - family.motion(x, t[:1], 0), expected - expected[0], atol=1e-9)


# --- the search ------------------------------------------------------------------------------------------------------


def problem_of(name: str, **options: object) -> Problem:
    return formulate(load_robot("irp6"), Task("irp6", trajectory=name, **OPTIONS[name], **options)).problem


@pytest.fixture(scope="module", params=OPTIONS)
def problem(request: pytest.FixtureRequest) -> Problem:
    """Two drives behind the IRp-6's coupling, with limits of torques."""
    return problem_of(request.param, drives=("1", "2"), torque_margin=0.3)


def test_the_gradient_is_that_of_the_criterion(problem: Problem) -> None:
    x = random_motion(problem, np.random.default_rng(1))
    for sharpness in (problem.criterion.stages[0], problem.criterion.stages[-1]):
        found = problem.gradient(problem.point(x, sharpness))
        expected = slope(lambda x, s=sharpness: np.array(problem.point(x, s).value), x)
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())
        count = problem.family.split(x)[1].size
        assert np.abs(found[-count:]).min() > 0.0


def test_tangents_are_derivatives_of_the_limits(problem: Problem) -> None:
    rng = np.random.default_rng(2)
    x = random_motion(problem, rng)
    step = rng.normal(size=x.size)
    assert len(problem.limits.nonlinear_in_x) > len(problem.limits.nonlinear) > 0
    for limit in problem.limits.nonlinear_in_x:
        values = limit.values(x)
        some = np.arange(0, values.shape[1], 61)
        tangent = limit.tangent(x, some)
        expected = (limit.values(x + 1e-6 * step) - limit.values(x - 1e-6 * step))[:, some] / 2e-6
        function, place = (i.ravel() for i in np.indices(expected.shape))
        found = tangent.rows(function, place) @ step
        np.testing.assert_allclose(found, expected.ravel(), atol=1e-5 * np.abs(expected).max())


def test_starts_keep_all_limits(problem: Problem) -> None:
    for x in candidates(problem, 0, np.random.default_rng(3)):
        assert problem.violation(x) <= 0.0
        assert problem.nonlinear_hold(x)


def test_what_is_beyond_a_limit_is_drawn_to_it(problem: Problem) -> None:
    x = random_motion(problem, np.random.default_rng(4))
    assert problem.inside(x) is x
    beyond = problem.drawn(x, 3.0)
    assert problem.violation(beyond) > 0.1
    drawn = problem.inside(beyond)
    assert problem.violation(drawn) == pytest.approx(0.0, abs=1e-8)
    np.testing.assert_array_equal(problem.family.split(drawn)[1], problem.family.split(x)[1])


def _held(problem: Problem) -> None:
    """Take the slopes by the shape out of a problem: its search leaves the shape as it is."""
    family = problem.family

    class Held(type(family)):
        def shape_slopes(self, x: Array, time: Array, derivative: int) -> Array:
            return 0.0 * super().shape_slopes(x, time, derivative)

        def nodes(self, x: Array, count: int) -> tuple[Array, Array | None]:
            time, drift = super().nodes(x, count)
            return time, None if drift is None else 0.0 * drift

    family.__class__ = Held


FEW = {"waypoints": {"intervals": 3}, "sines": {"harmonics": 2}}


def _poor(problem: Problem, index: int) -> Array:
    """A motion within the limits of a poor shape: a long first interval, or slow sines only."""
    x = candidates(problem, index, np.random.default_rng([0, index]))[0].copy()
    family = problem.family
    shape = family.split(x)[1]
    shape[:] = np.linspace(2.0, -2.0, shape.size) if isinstance(family, Waypoints) else -0.9 * family._turn
    return problem.drawn(x, 0.9 * min(problem.reach(x), 1.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", FEW)
def test_free_shapes_are_better_than_held_ones(name: str) -> None:
    """The search with a held shape that is poor, then with a free one from where that ended: it moves, and pays."""
    task = Task("irp6", trajectory=name, **FEW[name])
    free, held = (formulate(load_robot("irp6"), task).problem for _ in range(2))
    assert not free.family.linear
    _held(held)
    solver = SequentialQuadratic(SqpOptions(iterations=15))
    gains = []
    for index in range(2, 5):
        start = _poor(free, index)
        first = solver.solve(held, [start])
        then = solver.solve(free, [first.x])
        shapes = [free.family.split(x)[1] for x in (start, first.x, then.x)]
        np.testing.assert_array_equal(shapes[0], shapes[1])
        assert np.abs(shapes[2] - shapes[1]).max() > 0.05
        assert free.violation(then.x) <= 1e-9
        gains.append(np.log(first.value / then.value))
    assert np.mean(gains) > 0.05


# --- by the command --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def designs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One of each family; the sines of two drives that move three joints."""
    folder = tmp_path_factory.mktemp("nonlinear")
    options = {"waypoints": ("--intervals", "3"), "sines": ("--harmonics", "2", "--drives", "1,2")}
    for name, more in options.items():
        asked = ("irp6", "--trajectory", name, "--starts", "1", "--executor", "serial", *more)
        ended = run("design", *asked, "--out", name, cwd=folder)
        assert ended.returncode == 0, ended.stderr
        assert "of free" in ended.stdout
    return {name: folder / name for name in options}


@pytest.mark.slow
@pytest.mark.parametrize("name", OPTIONS)
def test_designs_keep_all_limits(name: str, designs: dict[str, Path]) -> None:
    design = load_design(designs[name])
    assert design.feasible
    assert design.trajectory.family.name == name
    samples = design.trajectory.samples(np.linspace(0, 10, 5001))
    transmission, joints = design.moving.transmission, design.moving.limits
    assert transmission is not None
    for rate, bound in ((samples.dq, transmission.limits.velocity), (samples.ddq, transmission.limits.acceleration)):
        assert np.all(np.abs(rate @ transmission.coupling.T) <= bound * (1 + 1e-9))
    assert np.all((samples.q >= joints.lower - 1e-9) & (samples.q <= joints.upper + 1e-9))
    assert max(use.use for use in design.limits) > 0.99  # and use what they leave
    table = np.genfromtxt(designs[name] / "trajectory.csv", delimiter=",", skip_header=1)
    again = design.trajectory.sampled(100.0)
    np.testing.assert_allclose(table[:, 1::3][:, : again.q.shape[1]], again.q, atol=1e-9)


@pytest.mark.slow
def test_a_design_begins_with_the_motion_of_the_other_family(designs: dict[str, Path]) -> None:
    old = load_design(designs["waypoints"])
    task = Task("irp6", trajectory="sines", harmonics=5, begin=str(designs["waypoints"]))
    problem = formulate(load_robot("irp6"), task).problem
    (x,) = candidates(problem, 0, np.random.default_rng(0))
    assert problem.violation(x) <= 0.0
    t = np.linspace(0, 10, 300)
    q, wanted = problem.family.motion(x, t, 0), old.trajectory.samples(t).q
    assert np.linalg.norm(q - wanted) < 0.15 * np.linalg.norm(wanted - wanted.mean(axis=0))
    for later in candidates(problem, 1, np.random.default_rng(0)):
        assert problem.violation(later) <= 0.0


def test_shapes_to_start_from() -> None:
    problem = problem_of("waypoints", start=("sines", "cosine", "quintic"))
    (x,) = candidates(problem, 0, np.random.default_rng(0))
    assert -0.1 < problem.violation(x) < 0.0


@pytest.mark.slow
def test_designs_are_compared(
    designs: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    here = Here(tmp_path, monkeypatch, capfd)
    ended = here.run("compare", str(designs["waypoints"]), "--model", "load", "--json")
    assert ended.returncode == 0, ended.stderr
    (found,) = json.loads(ended.stdout)
    assert found["feasible"]
    assert found["parameters"] > 0


# --- bad input -------------------------------------------------------------------------------------------------------

BAD = {
    "intervals": (
        {"trajectory": "waypoints", "intervals": 1},
        "expected 2 or more, so that the motion can return to its start, given 1",
    ),
    "sines": ({"trajectory": "sines", "harmonics": 0}, "`harmonics` must be a whole number from 1 to 1000, given 0"),
    "solver": ({"trajectory": "sines", "solver": "ipopt"}, "family sines are for the solver sqp, not for ipopt"),
    "samples": ({"trajectory": "waypoints", "rate": 1.0}, "10 s at 1 Hz is 10 samples, too few for 15 intervals"),
}


@pytest.mark.parametrize("case", BAD)
def test_tasks_that_cannot_be(case: str) -> None:
    options, message = BAD[case]
    with pytest.raises(InputError, match=message):
        formulate(load_robot("irp6"), Task("irp6", **options))


DAMAGED = {
    "knots": ("waypoints", {"position": [[1.0, 2.0]]}, "expected states at 6 knots and 5 durations"),
    "durations": ("waypoints", {"durations": [1.0] * 5}, "durations must add up to 7 s"),
    "short": ("waypoints", {"durations": [0.1, 2.0, 2.0, 2.0, 0.9]}, "each at least"),
    "waves": ("sines", {"phase": [[1.0]]}, "expected 4 sines for each of 2 coordinates"),
    "frequency": ("sines", {"frequency": [[9.0] * 4] * 2}, "frequencies must be from 0.448"),
    "matrix": ("sines", {"matrix": [[1.0, 0.0]]}, "2 coordinates of 2 joints, given a matrix of shape"),
    "not finite": ("waypoints", {"rest": [float("nan"), 0.0]}, "expected finite numbers"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_damaged_motions(case: str) -> None:
    name, change, message = DAMAGED[case]
    family = FAMILIES[name]()
    with pytest.raises(InputError, match=message):
        stored_trajectory({**family.to_dict(motion(family, 1)), **change}, 2)
