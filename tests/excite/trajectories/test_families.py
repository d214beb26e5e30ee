"""Families of motions: laws that every family keeps, and each is what it says."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import Here
from hypothesis import given, settings, strategies as st
from motion_families import LINEAR, NONLINEAR, motion
from scipy.interpolate import BPoly
from written_files import saved

from constraints.enclosure import (
    chebyshev_extrema,
    chebyshev_nodes,
    node_factor,
)
from constraints.linear import LinearConstraint
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.grid_limits import GridConstraint
from excite.design.initial_guesses import candidates, random_motion
from excite.design.optimisation import design_trajectory
from excite.design.problem import Problem
from excite.tasks.task import Task
from excite.trajectories import Fourier, LinearFamily, Trajectory, stored_trajectory
from excite.trajectories.bspline import BSpline
from excite.trajectories.family import Family
from excite.trajectories.fourier import Cosine, FourierQuintic
from excite.trajectories.nonlinear import NonlinearFamily
from excite.trajectories.polynomial import Polynomial
from excite.trajectories.sines import Sines
from excite.trajectories.waypoints import Waypoints
from regressors.errors import InputError, UnknownName
from regressors.readers.library import load_robot
from regressors.samples import Array

FAMILIES = LINEAR | NONLINEAR


@pytest.fixture(params=FAMILIES)
def family(request: pytest.FixtureRequest) -> Family:
    return FAMILIES[request.param]()


@pytest.fixture(params=LINEAR)
def linear(request: pytest.FixtureRequest) -> LinearFamily:
    return LINEAR[request.param]()


def values_of(family: Family, time: np.ndarray, derivative: int) -> np.ndarray:
    """Of every motion of a linear family, of one of another."""
    return family.basis(time, derivative) if family.linear else family.motion(motion(family, 1), time, derivative)


# --- laws of every family --------------------------------------------------------------------------------------------


def test_each_derivative_is_the_slope_of_the_one_before(family: Family) -> None:
    h = (1e-6 if family.linear else 1e-5) * family.duration
    t = np.random.default_rng(1).uniform(2 * h, family.duration - 2 * h, 40)
    for d in range(3 if family.linear else 4):
        slope = (values_of(family, t + h, d) - values_of(family, t - h, d)) / (2 * h)
        expected = values_of(family, t, d + 1)
        # the jerk of a cubic jumps at a knot, and at a waypoint: a step across one says nothing
        same = np.abs(slope - expected).max(axis=1) < 1e-4 * np.abs(expected).max()
        assert same.mean() > 0.9 if d > 1 else same.all()


def test_every_motion_rests_at_both_ends_and_returns(family: Family) -> None:
    ends, inside = np.array([0.0, family.duration]), np.linspace(0, family.duration, 300)
    exact = family.linear and not isinstance(family, Polynomial)
    for d in (1, 2):
        size = np.abs(values_of(family, inside, d)).max()
        assert np.abs(values_of(family, ends, d)).max() <= (1e-12 if exact else 1e-11) * size
    first, last = values_of(family, ends, 0)
    np.testing.assert_allclose(first, last, atol=1e-12 if family.linear else 1e-11)


def test_the_constant_stays_at_one(linear: LinearFamily) -> None:
    t = np.linspace(0, linear.duration, 50)
    np.testing.assert_allclose(linear.basis(t, 0) @ linear.constant, 1.0, atol=1e-12)
    scale = np.abs(linear.basis(t, 1)).max()
    np.testing.assert_allclose(linear.basis(t, 1) @ linear.constant, 0.0, atol=1e-11 * scale)


def test_free_coefficients_are_those_of_the_physical_ones(linear: LinearFamily) -> None:
    x = motion(linear, 2)
    assert np.linalg.matrix_rank(linear.basis(np.linspace(0, linear.duration, 500), 0)) == linear.size
    np.testing.assert_allclose(linear.from_coefficients(linear.coefficients(x)), x, atol=1e-9)


@pytest.mark.parametrize("derivative", range(4))
def test_extrema_are_those_of_dense_samples(linear: LinearFamily, derivative: int) -> None:
    x = motion(linear, 3)
    t = 0.5 * linear.duration * (1.0 - np.cos(np.linspace(0.0, np.pi, 40_001)))
    values = linear.basis(t, derivative) @ x.T
    size = np.abs(values).max(axis=0)
    found = linear.extrema(x, derivative)
    for exact, sampled in ((found.high, values.max(axis=0)), (-found.low, -values.min(axis=0))):
        assert np.all(exact >= sampled - 1e-9 * size)  # samples do not go beyond
        assert np.all(exact <= sampled + (1e-4 if isinstance(linear, Polynomial) else 3e-3) * size)
    for value, time in ((found.high, found.high_time), (found.low, found.low_time)):
        inside = np.clip(time, 0, np.nextafter(linear.duration, 0))
        reached = np.array([linear.basis(inside[[k]], derivative)[0] @ x[k] for k in range(3)])
        jumps = isinstance(linear, BSpline) and derivative == linear.order - 2
        assert np.all(np.abs(reached - value) < 1e-8 * size) or jumps


@pytest.mark.parametrize("derivative", range(4))
def test_what_stays_within_the_grid_bounds_stays_within_the_bounds(family: Family, derivative: int) -> None:
    """The guarantee that the optimiser builds on, for motions that touch the tightened bounds."""
    one = np.ones(1)
    limit = LinearConstraint(derivative, np.eye(1), np.zeros(1), -one, one, ("a",), ("rad",))
    grid = GridConstraint.on_coordinates(limit, family.on_grid(1024 if isinstance(family, Polynomial) else 512))
    for seed in range(5):
        x = motion(family, seed, 1)
        x = family.drawn(x, np.zeros(1), float(grid.upper[0]) / np.abs(grid.values(x)).max())
        assert np.abs(grid.values(x)).max() == pytest.approx(grid.upper[0])
        found = Trajectory(family, x).extrema(limit)
        assert max(float(found.high[0]), -float(found.low[0])) <= 1.0 + 1e-9
    assert grid.upper[0] > 0.98


def test_a_motion_read_back_is_the_same_motion(family: Family) -> None:
    rng, t = np.random.default_rng(6), np.linspace(0, family.duration, 100)
    moving = Trajectory(family, motion(family, 6, 3 if family.linear else 2))
    moving = moving if family.linear else moving.carried(rng.normal(size=(3, 2)), rng.normal(size=3))
    again = stored_trajectory(json.loads(json.dumps(moving.family.to_dict(moving.x))), 3)
    rounding = 1e-12 if family.linear else 1e-11
    np.testing.assert_allclose(again.samples(t).q, moving.samples(t).q, rtol=rounding, atol=rounding)
    size = np.abs(moving.samples(t).ddq).max()
    np.testing.assert_allclose(again.samples(t).ddq, moving.samples(t).ddq, rtol=1e-9, atol=1e-9 * max(size, 1.0))
    assert (type(again.family), again.family.described) == (type(family), family.described)


def test_families_grow(family: LinearFamily) -> None:
    name = family.name
    chosen = Task("irp6", trajectory=name).trajectory
    option, value = chosen.finer(2).richness
    assert value == getattr(chosen, option) + 2
    assert chosen.finer().family().size > chosen.family().size


# --- each family is what it says -------------------------------------------------------------------------------------


def test_cosines_come_back_the_way_they_went() -> None:
    family = Cosine(6.0, 5)
    t = np.linspace(0, 3, 50)
    there, back = (Trajectory(family, motion(family, 4)).samples(time).q for time in (t, 6.0 - t))
    np.testing.assert_allclose(there, back, atol=1e-12)


def test_a_series_with_a_quintic_is_its_sum() -> None:
    family = FourierQuintic(4.0, 3)
    assert family.size == 2 * 3 + 1  # five conditions at the ends on 2 K + 6 terms
    x, t = motion(family, 6, 1), np.linspace(0, 4.0, 70)
    series = family.to_dict(x)
    u = t / 2.0 - 1.0
    expected = np.polynomial.chebyshev.chebval(u, series["chebyshev"][0])
    for k, (a, b) in enumerate(zip(series["cosine"][0], series["sine"][0], strict=True), 1):
        expected = expected + a * np.cos(k * np.pi / 2 * t) + b * np.sin(k * np.pi / 2 * t)
    np.testing.assert_allclose(family.basis(t, 0) @ x[0], expected, atol=1e-12)


def test_a_spline_is_its_recursion() -> None:
    """De Boor's recursion written out."""
    family = BSpline(5.0, 6, 4)
    x, knots = motion(family, 7, 1), family.knots
    control = np.array(family.to_dict(x)["control"])[0]

    def bump(i: int, order: int, t: float) -> float:
        if order == 1:
            return float(knots[i] <= t < knots[i + 1])
        left, right = knots[i + order - 1] - knots[i], knots[i + order] - knots[i + 1]
        a = (t - knots[i]) / left * bump(i, order - 1, t) if left > 0 else 0.0
        b = (knots[i + order] - t) / right * bump(i + 1, order - 1, t) if right > 0 else 0.0
        return a + b

    for t in (0.0, 0.7, 2.5, 4.999):
        expected = sum(c * bump(i, 4, t) for i, c in enumerate(control))
        assert family.basis(np.array([t]), 0)[0] @ x[0] == pytest.approx(expected, abs=1e-12)


def test_polynomials_are_numpys() -> None:
    family = Polynomial(10.0, 5)
    x, t = motion(family, 1), np.linspace(0.0, 10.0, 300)
    for derivative in range(4):
        for column, series in zip(family.motion(x, t, derivative).T, family.coefficients(x), strict=True):
            polynomial = np.polynomial.Chebyshev(series, domain=(0.0, 10.0))
            expected = (polynomial.deriv(derivative) if derivative else polynomial)(t)
            np.testing.assert_allclose(column, expected, atol=1e-9 * np.abs(expected).max())
            assert polynomial.degree() == 4 * family.harmonics + 5 == family.size + 4


# --- extrema of polynomials ------------------------------------------------------------------------------------------


@given(st.lists(st.floats(-2, 2), min_size=2, max_size=7), st.floats(0.1, 20))
@settings(max_examples=60)
def test_extrema_of_a_polynomial(coefficients: list[float], duration: float) -> None:
    values = np.polynomial.Polynomial(coefficients, domain=[0, duration], window=[-1, 1])
    t = np.linspace(0, duration, 5001)
    found = chebyshev_extrema(lambda time: values(time)[:, None], 11, duration)
    size = max(np.abs(values(t)).max(), 1e-12)
    assert values(t).max() - 1e-9 * size <= found.high[0] <= values(t).max() + 1e-5 * size
    assert values(t).min() - 1e-5 * size <= found.low[0] <= values(t).min() + 1e-9 * size


@pytest.mark.parametrize("degree", [1, 3, 10])
def test_nodes_bound_polynomials(degree: int) -> None:
    """Chebyshev's polynomial itself comes near the bound of Ehlich and Zeller, and never beyond it."""
    for count in (degree + 1, 2 * degree + 3):
        nodes = chebyshev_nodes(count, 0.0, 1.0)
        for shift in np.linspace(0, 0.5, 11):
            series = np.cos(np.pi * shift) * np.eye(degree + 1)[degree]
            on_nodes = np.abs(np.polynomial.chebyshev.chebval(2 * nodes - 1, series)).max()
            everywhere = np.abs(series[degree])
            assert on_nodes >= node_factor(degree, count) * everywhere - 1e-12
    with pytest.raises(ValueError, match="are too few for polynomials"):
        node_factor(degree, degree)


# --- by the command --------------------------------------------------------------------------------------------------

OPTIONS = {
    "fourier-quintic": ("--harmonics", "4"),
    "cosine": ("--harmonics", "7"),
    "bspline": ("--intervals", "9", "--order", "5"),
    "polynomial": ("--harmonics", "4"),
    "waypoints": ("--intervals", "3"),
    "sines": ("--harmonics", "2", "--drives", "1,2"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OPTIONS)
def test_designs_of_every_family_keep_all_limits(name: str, here: Here) -> None:
    design = load_design(here.designed("irp6", "--trajectory", name, "--starts", "1", *OPTIONS[name]))
    assert design.feasible
    assert design.condition_number < 120 or name in ("waypoints", "sines")
    assert design.trajectory.family.name == name
    samples, transmission = design.trajectory.samples(np.linspace(0, 10, 5001)), design.moving.transmission
    joints, drives = design.moving.limits, transmission.limits
    for rate, bound in ((samples.dq, drives.velocity), (samples.ddq, drives.acceleration)):
        assert np.all(np.abs(rate @ transmission.coupling.T) <= bound * (1 + 1e-9))
    assert np.all((samples.q >= joints.lower - 1e-9) & (samples.q <= joints.upper + 1e-9))
    assert max(use.use for use in design.limits) > 0.99  # and use what they leave
    table = np.genfromtxt(design.folder / "trajectory.csv", delimiter=",", skip_header=1)
    again = design.trajectory.sampled(100.0)
    np.testing.assert_allclose(table[:, 1::3][:, : again.q.shape[1]], again.q, atol=1e-9)


def test_families_that_cannot_be() -> None:
    for family, options, message in (
        ("bspline", {"order": 3}, "order of the spline must be one of 4, 5, 6, given 3"),
        ("bspline", {"intervals": 2}, "2 are too few for a motion at rest at both ends; expected 3 or more"),
        ("bspline", {"rate": 1.0}, "10 s at 1 Hz is 10 samples, too few for 15 intervals"),
        ("fourier-quintic", {"harmonics": 0}, "`harmonics` must be a whole number from 1 to"),
        ("cosine", {"harmonics": 1}, "expected 2 or more"),
        ("waypoints", {"intervals": 1}, "expected 2 or more, so that the motion can return to its start, given 1"),
        ("waypoints", {"rate": 1.0}, "10 s at 1 Hz is 10 samples, too few for 15 intervals"),
        ("sines", {"harmonics": 0}, "`harmonics` must be a whole number from 1 to 1000, given 0"),
    ):
        with pytest.raises(InputError, match=message):
            Task("irp6", trajectory=family, **options).trajectory.family()
    for period in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(InputError, match="period must be a positive number of seconds"):
            Fourier(period, 5)
    for family, harmonics in ((Fourier, 0), (Fourier, 1), (Polynomial, 0)):
        with pytest.raises(InputError, match=r"harmonics: "):
            family(5.0, harmonics)


DAMAGED = (
    ("quintic", {"family": "wavelets"}, "no trajectory family named 'wavelets'"),
    ("quintic", {"control": [[1.0, 2.0]]}, "expected 17 finite coefficients for each of 2 joints"),
    ("quintic", {"control": [[float("nan")] * 17] * 2}, "finite"),
    ("waypoints", {"position": [[1.0, 2.0]]}, "expected states at 6 knots and 5 durations"),
    ("waypoints", {"durations": [1.0] * 5}, "durations must add up to 7 s"),
    ("waypoints", {"durations": [0.1, 2.0, 2.0, 2.0, 0.9]}, "each at least"),
    ("sines", {"phase": [[1.0]]}, "expected 4 sines for each of 2 coordinates"),
    ("sines", {"frequency": [[9.0] * 4] * 2}, "frequencies must be from 0.448"),
    ("sines", {"matrix": [[1.0, 0.0]]}, "2 coordinates of 2 joints, given a matrix of shape"),
    ("waypoints", {"rest": [float("nan"), 0.0]}, "expected finite numbers"),
)


def test_damaged_motions() -> None:
    for name, change, message in DAMAGED:
        family = FAMILIES[name]()
        with pytest.raises((InputError, UnknownName), match=message):
            stored_trajectory({**family.to_dict(motion(family, 1, 2)), **change}, 2)


# --- from one family to another --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def series_design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    design = design_trajectory(Task("irp6", harmonics=3, starts=1, executor="serial"))
    return saved(tmp_path_factory.mktemp("begin"), design)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bspline", "fourier-quintic", "cosine", "sines"])
def test_a_design_begins_with_the_motion_of_another_family(name: str, series_design: Path) -> None:
    """As near to it as the family comes, drawn inside the limits; what a spline is near to stays about as good."""
    problem = formulate(load_robot("irp6"), Task("irp6", trajectory=name, begin=str(series_design))).problem
    (x,), t = candidates(problem, 0, np.random.default_rng(0)), np.linspace(0, 10, 400)
    assert problem.violation(x) <= 0.0
    q, wanted = problem.family.motion(x, t, 0), load_design(series_design).trajectory.samples(t).q
    astray = np.linalg.norm(q - wanted) / np.linalg.norm(wanted - wanted.mean(axis=0))
    assert astray < 0.1 or name == "cosine" or (name == "sines" and astray < 0.15)
    later = candidates(problem, 1, np.random.default_rng(0))
    assert len(later) == 3
    assert all(problem.violation(motion) <= 0.0 for motion in later)


def test_beginnings_that_cannot_be(series_design: Path) -> None:
    other_joints = "moves q1, q2, q3; the motion to begin with must move q1, q2, q3, q4, q5"
    for begin, message in (("nowhere", "nowhere is no design folder"), (str(series_design), other_joints)):
        with pytest.raises(InputError, match=message):
            formulate(load_robot("irp6"), Task("irp6", joints=tuple("12345"), begin=begin))


SEARCHED = {"waypoints": {"intervals": 5}, "sines": {"harmonics": 4}}


@pytest.fixture(params=NONLINEAR)
def nonlinear(request: pytest.FixtureRequest) -> NonlinearFamily:
    return NONLINEAR[request.param]()


def slope(function: Callable[[Array], Array], x: Array, step: float = 1e-6) -> Array:
    """Central differences, the last axis that of x."""
    return np.stack([(function(x + d) - function(x - d)) / (2 * step) for d in step * np.eye(x.size)], axis=-1)


# --- laws ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("derivative", range(4))
def test_slopes_by_x(nonlinear: NonlinearFamily, derivative: int) -> None:
    """At fixed instants, and at nodes that move with x."""
    x, t = motion(nonlinear, 3, 2), nonlinear.duration * np.random.default_rng(3).uniform(size=30)
    found = nonlinear.jacobian(x, t, derivative)
    expected = slope(lambda x: nonlinear.coordinate_motion(x, t, derivative), x)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    grid, some = nonlinear.on_grid(64), np.arange(0, 64, 5)
    tangent = grid.tangent(x, [derivative], some)
    expected = slope(lambda x: grid.values(x, derivative)[some], x)
    k, place = expected.shape[1], np.arange(some.size)
    found = np.stack([tangent(np.tile(unit, (some.size, 1, 1)), place) for unit in np.eye(k)], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


def test_joints_are_carried_by_coordinates(nonlinear: NonlinearFamily) -> None:
    """Over two maps, one after the other."""
    rng, t, x = np.random.default_rng(11), np.linspace(0, nonlinear.duration, 40), motion(nonlinear, 11, 2)
    (A, a), (B, b) = ((rng.normal(size=(rows, 3 if rows == 4 else 2)), rng.normal(size=rows)) for rows in (3, 4))
    carried = Trajectory(nonlinear, x).carried(A, a).carried(B, b)
    np.testing.assert_allclose(carried.samples(t).q, (nonlinear.motion(x, t, 0) @ A.T + a) @ B.T + b, atol=1e-10)
    jerk = np.abs(carried.family.motion(x, np.linspace(0, nonlinear.duration, 5001), 3)).max(axis=0)
    np.testing.assert_allclose(carried.jerk, jerk, rtol=2e-2)
    dq = carried.samples(np.array([0.0, nonlinear.duration])).dq
    np.testing.assert_array_equal(dq, np.zeros((2, 4)))


@pytest.mark.parametrize("derivative", range(4))
def test_extrema_of_carried_motions_are_those_of_dense_samples(nonlinear: NonlinearFamily, derivative: int) -> None:
    """Of combinations of joints that are carried by two coordinates."""
    rng = np.random.default_rng(5)
    carried = Trajectory(nonlinear, motion(nonlinear, 5, 2)).carried(rng.normal(size=(3, 2)), rng.normal(size=3))
    matrix, offset = rng.normal(size=(2, 3)), rng.normal(size=2)
    t = np.linspace(0, nonlinear.duration, 20_001)
    values = carried.family.motion(carried.x, t, derivative) @ matrix.T + (offset if derivative == 0 else 0.0)
    size = np.abs(values).max(axis=0)
    found = carried.family.combined_extrema(carried.x, matrix, offset, derivative)
    for exact, sampled in ((found.high, values.max(axis=0)), (-found.low, -values.min(axis=0))):
        assert np.all(exact >= sampled - 1e-9 * size)
        assert np.all(exact <= sampled + 3e-3 * size)


def test_the_nearest_motion_to_one_of_the_family_is_that_motion(nonlinear: NonlinearFamily) -> None:
    """From another shape, which has to be found."""
    rng = np.random.default_rng(7)
    x = nonlinear.resting(np.zeros(2), rng)
    count = nonlinear.split(x)[1].size
    x[-count:] = nonlinear.shape(2) + 0.3 * (x[-count:] - nonlinear.shape(2))
    nonlinear.split(x)[0][:] += rng.normal(size=(2, nonlinear.size))
    t = np.linspace(0, nonlinear.duration, 201)
    wanted = nonlinear.motion(x, t, 0)
    found = nonlinear.nearest(t, wanted)
    assert np.abs(nonlinear.motion(found, t, 0) - wanted).max() < 0.02 * np.ptp(wanted)
    assert np.abs(found[-count:] - nonlinear.shape(2)).max() > 0.01


# --- each family is what it says -------------------------------------------------------------------------------------


def test_waypoints_are_passed_as_stated() -> None:
    """SciPy's polynomial from derivatives at the file's knots."""
    nonlinear = Waypoints(6.0, 4)
    x, t = motion(nonlinear, 8, 2), np.linspace(0, 6, 200)
    series = nonlinear.to_dict(x)
    assert sum(series["durations"]) == pytest.approx(6.0)
    assert min(series["durations"]) > 6.0 / 4 / 4
    knots = np.concatenate([[0.0], np.cumsum(series["durations"])])
    states = np.array([series[part] for part in ("position", "velocity", "acceleration")])
    for d in range(3):
        for k in range(2):
            spline = BPoly.from_derivatives(knots, states[:, k].T.tolist()).derivative(d)
            np.testing.assert_allclose(nonlinear.motion(x, t, d)[:, k], spline(np.clip(t, 0, knots[-1])), atol=1e-9)


def test_sines_are_a_sum_of_sines_and_a_quintic() -> None:
    nonlinear = Sines(6.0, 3)
    x, t = motion(nonlinear, 9, 2), np.linspace(0, 6, 200)
    series = {key: np.array(nonlinear.to_dict(x)[key]) for key in ("offset", "amplitude", "frequency", "phase")}
    assert np.all((series["frequency"] > np.pi / 6) & (series["frequency"] < np.pi))
    for k, (c, A, w, phase) in enumerate(zip(*series.values(), strict=True)):
        rest = nonlinear.motion(x, t, 0)[:, k] - c - np.sin(np.outer(t, w) + phase) @ A
        fit = np.polynomial.Polynomial.fit(t, rest, 5)
        np.testing.assert_allclose(fit(t), rest, atol=1e-9)
        assert fit(0.0) == pytest.approx(0.0, abs=1e-9)


def test_sines_of_whole_frequencies_are_a_series_with_a_quintic() -> None:
    """The linear family is part of the nonlinear one: the polynomial is the only one that brings both to rest."""
    linear, nonlinear = FourierQuintic(5.0, 3), Sines(5.0, 3)
    y, t = np.random.default_rng(10).normal(size=(2, linear.size)), np.linspace(0, 5, 100)
    series = linear.to_dict(y)
    wave = np.array(series["sine"]) + 1j * np.array(series["cosine"])
    frequency = np.tile([1, 2, 3], (2, 1)) * 0.4 * np.pi
    waves = {"amplitude": np.abs(wave), "phase": np.angle(wave), "frequency": frequency}
    x = nonlinear.restored({"offset": [0.0, 0.0], **waves})
    expected, found = linear.motion(y, t, 0), nonlinear.motion(x, t, 0)
    np.testing.assert_allclose(found - found[0], expected - expected[0], atol=1e-9)


# --- the search ------------------------------------------------------------------------------------------------------


def problem_of(name: str, **options: object) -> Problem:
    return formulate(load_robot("irp6"), Task("irp6", trajectory=name, **SEARCHED[name], **options)).problem


@pytest.fixture(scope="module", params=SEARCHED)
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


def test_what_is_beyond_a_limit_is_drawn_to_it(problem: Problem) -> None:
    x = random_motion(problem, np.random.default_rng(4))
    assert problem.inside(x) is x
    beyond = problem.drawn(x, 3.0)
    assert problem.violation(beyond) > 0.1
    drawn = problem.inside(beyond)
    assert problem.violation(drawn) == pytest.approx(0.0, abs=1e-8)
    np.testing.assert_array_equal(problem.family.split(drawn)[1], problem.family.split(x)[1])
