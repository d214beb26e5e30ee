"""Families beside the Fourier series: cosines, a series with a quintic, B-splines; laws that every family keeps."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import Here, run
from hypothesis import given, settings
from hypothesis import strategies as st

from constraints.enclosure import (
    chebyshev_extrema,
    chebyshev_nodes,
    chebyshev_points,
    node_factor,
    piecewise_extrema,
)
from constraints.linear import LinearConstraint
from excite.design.design_json import load_design
from excite.design.formulation import formulate
from excite.design.grid_limits import GridConstraint
from excite.design.initial_guesses import candidates
from excite.tasks.task import Task
from excite.trajectories import Fourier, LinearFamily, Trajectory, stored_trajectory
from excite.trajectories.bspline import BSpline
from excite.trajectories.fourier import Cosine, FourierQuintic
from excite.trajectories.polynomial import Polynomial
from regressors.errors import InputError, UnknownName
from regressors.readers.library import load_robot

FAMILIES: dict[str, Callable[[], LinearFamily]] = {
    "fourier": lambda: Fourier(7.0, 5),
    "cosine": lambda: Cosine(7.0, 4),
    "fourier-quintic": lambda: FourierQuintic(7.0, 3),
    "fourier-quintic, many": lambda: FourierQuintic(20.0, 10),
    "one harmonic": lambda: FourierQuintic(0.5, 1),
    "cubic": lambda: BSpline(5.0, 8, 4),
    "quartic": lambda: BSpline(5.0, 9, 5),
    "quintic": lambda: BSpline(5.0, 12, 6),
    "fewest intervals": lambda: BSpline(60.0, 3, 6),
    "polynomial of degree 9": lambda: Polynomial(7.0, 1),
    "polynomial of degree 85": lambda: Polynomial(30.0, 20),
}


@pytest.fixture(params=FAMILIES)
def family(request: pytest.FixtureRequest) -> LinearFamily:
    return FAMILIES[request.param]()


def motion(family: LinearFamily, seed: int, joints: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(joints, family.size))


# --- laws of every family --------------------------------------------------------------------------------------------


def test_each_derivative_is_the_slope_of_the_one_before(family: LinearFamily) -> None:
    h = 1e-6 * family.duration
    t = np.random.default_rng(1).uniform(2 * h, family.duration - 2 * h, 40)
    for d in range(3):
        slope = (family.basis(t + h, d) - family.basis(t - h, d)) / (2 * h)
        expected = family.basis(t, d + 1)
        # the jerk of a cubic jumps at a knot: a step across one says nothing
        same = np.abs(slope - expected).max(axis=1) < 1e-4 * np.abs(expected).max()
        assert same.mean() > 0.9 if d == 2 else same.all()


def test_every_motion_rests_at_both_ends_and_returns(family: LinearFamily) -> None:
    ends, inside = np.array([0.0, family.duration]), np.linspace(0, family.duration, 300)
    rounding = 1e-11 if isinstance(family, Polynomial) else 1e-12
    for d in (1, 2):
        assert np.abs(family.basis(ends, d)).max() <= rounding * np.abs(family.basis(inside, d)).max()
    first, last = family.basis(ends, 0)
    np.testing.assert_allclose(first, last, atol=1e-12)


def test_the_constant_stays_at_one(family: LinearFamily) -> None:
    t = np.linspace(0, family.duration, 50)
    np.testing.assert_allclose(family.basis(t, 0) @ family.constant, 1.0, atol=1e-12)
    scale = np.abs(family.basis(t, 1)).max()
    np.testing.assert_allclose(family.basis(t, 1) @ family.constant, 0.0, atol=1e-11 * scale)


def test_free_coefficients_are_those_of_the_physical_ones(family: LinearFamily) -> None:
    x = motion(family, 2)
    assert np.linalg.matrix_rank(family.basis(np.linspace(0, family.duration, 500), 0)) == family.size
    np.testing.assert_allclose(family.from_coefficients(family.coefficients(x)), x, atol=1e-9)


@pytest.mark.parametrize("derivative", range(4))
def test_extrema_are_those_of_dense_samples(family: LinearFamily, derivative: int) -> None:
    x = motion(family, 3)
    t = 0.5 * family.duration * (1.0 - np.cos(np.linspace(0.0, np.pi, 40_001)))
    values = family.basis(t, derivative) @ x.T
    size = np.abs(values).max(axis=0)
    found = family.extrema(x, derivative)
    for exact, sampled in ((found.high, values.max(axis=0)), (-found.low, -values.min(axis=0))):
        assert np.all(exact >= sampled - 1e-9 * size)  # samples do not go beyond
        assert np.all(exact <= sampled + (1e-4 if isinstance(family, Polynomial) else 3e-3) * size)
    for value, time in ((found.high, found.high_time), (found.low, found.low_time)):
        inside = np.clip(time, 0, np.nextafter(family.duration, 0))
        reached = np.array([family.basis(inside[[k]], derivative)[0] @ x[k] for k in range(3)])
        jumps = isinstance(family, BSpline) and derivative == family.order - 2
        assert np.all(np.abs(reached - value) < 1e-8 * size) or jumps


@pytest.mark.parametrize("derivative", range(4))
def test_what_stays_within_the_grid_bounds_stays_within_the_bounds(family: LinearFamily, derivative: int) -> None:
    """The guarantee that the optimiser builds on, for motions that touch the tightened bounds."""
    for seed in range(5):
        x = motion(family, seed, 1)
        one = np.ones(1)
        limit = LinearConstraint(derivative, np.eye(1), np.zeros(1), -one, one, ("a",), ("rad",))
        grid = GridConstraint.on_coordinates(limit, family.on_grid(1024 if isinstance(family, Polynomial) else 512))
        x = x * float(grid.upper[0]) / np.abs(grid.values(x)).max()
        found = family.extrema(x, derivative)
        assert max(float(found.high[0]), -float(found.low[0])) <= 1.0 + 1e-9
        assert grid.upper[0] > 0.98


def test_a_motion_read_back_is_the_same_motion(family: LinearFamily) -> None:
    x = motion(family, 5)
    series = json.loads(json.dumps(family.to_dict(x)))
    again = stored_trajectory(series, 3)
    t = np.linspace(0, family.duration, 100)
    np.testing.assert_allclose(again.samples(t).q, Trajectory(family, x).samples(t).q, rtol=1e-12, atol=1e-12)
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


def test_a_quintic_leaves_the_series_its_harmonics() -> None:
    """Five conditions at the ends on 2K + 6 terms; a series of as many harmonics has 2K - 1 left."""
    for K in (2, 5, 9):
        assert FourierQuintic(4.0, K).size == 2 * K + 1
        assert Fourier(4.0, K).size == 2 * K - 1


def test_a_series_with_a_quintic_is_its_sum() -> None:
    family = FourierQuintic(4.0, 3)
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


# --- extrema of polynomials ------------------------------------------------------------------------------------------


@given(st.lists(st.floats(-2, 2), min_size=2, max_size=7), st.floats(0.1, 20))
@settings(max_examples=60)
def test_extrema_of_a_polynomial(coefficients: list[float], duration: float) -> None:
    values = np.polynomial.Polynomial(coefficients, domain=[0, duration], window=[-1, 1])
    t = np.linspace(0, duration, 5001)
    points = chebyshev_points(12, duration)
    found = chebyshev_extrema(values(points)[:, None], duration)
    size = max(np.abs(values(t)).max(), 1e-12)
    assert values(t).max() - 1e-9 * size <= found.high[0] <= values(t).max() + 1e-5 * size
    assert values(t).min() - 1e-5 * size <= found.low[0] <= values(t).min() + 1e-9 * size


def test_extrema_of_pieces() -> None:
    """t^2 - t on [0, 1], then 2 t (in its own variable) on [1, 3]."""
    pieces = np.array([[[1.0], [0.0]], [[-1.0], [2.0]], [[0.0], [0.0]]])
    found = piecewise_extrema(np.array([0.0, 1.0, 3.0]), pieces)
    assert (found.low[0], found.low_time[0]) == pytest.approx((-0.25, 0.5))
    assert (found.high[0], found.high_time[0]) == pytest.approx((4.0, 3.0))


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
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OPTIONS)
def test_designs_of_every_family_keep_all_limits(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = Here(tmp_path, monkeypatch, capfd).designed("irp6", "--trajectory", name, "--starts", "2", *OPTIONS[name])
    design = load_design(folder)
    assert design.feasible
    assert design.condition_number < 120
    samples = design.trajectory.samples(np.linspace(0, 10, 5001))
    limits = design.moving.transmission
    assert limits is not None
    z = samples.dq @ limits.coupling.T
    assert np.all(np.abs(z) <= limits.limits.velocity * (1 + 1e-9))
    assert design.trajectory.family.name == name


BAD = {
    "order": (("bspline", {"order": 3}), "order of the spline must be one of 4, 5, 6, given 3"),
    "intervals": (("bspline", {"intervals": 2}), "2 are too few for a motion at rest at both ends; expected 3 or more"),
    "no harmonics": (
        ("fourier-quintic", {"harmonics": 0}),
        "`harmonics` must be a whole number from 1 to",
    ),
    "one cosine": (("cosine", {"harmonics": 1}), "expected 2 or more"),
}


@pytest.mark.parametrize("case", BAD)
def test_families_that_cannot_be(case: str) -> None:
    (name, options), message = BAD[case]
    with pytest.raises(InputError, match=message):
        Task("irp6", trajectory=name, **options).trajectory.family()


def test_too_few_samples_for_a_spline() -> None:
    with pytest.raises(InputError, match="10 s at 1 Hz is 10 samples, too few for 15 intervals"):
        Task("irp6", trajectory="bspline", rate=1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"family": "wavelets"}, "no trajectory family named 'wavelets'"),
        ({"control": [[1.0, 2.0]]}, "expected 13 finite coefficients for each of 1 joints"),
        ({"control": [[float("nan")] * 13]}, "finite"),
    ],
)
def test_damaged_motions(change: dict[str, object], message: str) -> None:
    family = BSpline(5.0, 8, 6)
    series = {**family.to_dict(motion(family, 1, 1)), **change}
    with pytest.raises((InputError, UnknownName), match=message):
        stored_trajectory(series, 1)


# --- from one family to another --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def series_design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("begin")
    ended = run("design", "irp6", "--starts", "2", "--executor", "serial", "--out", "d", cwd=folder)
    assert ended.returncode == 0, ended.stderr
    return folder / "d"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bspline", "fourier-quintic", "cosine"])
def test_a_design_begins_with_the_motion_of_another_family(name: str, series_design: Path) -> None:
    """As near to it as the family comes, drawn inside the limits; what a spline is near to stays about as good."""
    old = load_design(series_design)
    made = formulate(load_robot("irp6"), Task("irp6", trajectory=name, begin=str(series_design)))
    (x,) = candidates(made.problem, 0, np.random.default_rng(0))
    assert made.problem.violation(x) <= 0.0
    t = np.linspace(0, 10, 400)
    q = made.problem.family.basis(t, 0) @ x.T
    wanted = old.trajectory.samples(t).q
    astray = np.linalg.norm(q - wanted) / np.linalg.norm(wanted - wanted.mean(axis=0))
    assert astray < 0.1 or name == "cosine"
    assert len(candidates(made.problem, 1, np.random.default_rng(0))) == 3


BEGINNINGS = {
    "no design": ("nowhere", "nowhere is no design folder"),
    "other joints": (None, "moves q1, q2, q3; the motion to begin with must move q1, q2, q3, q4, q5"),
}


@pytest.mark.parametrize("case", BEGINNINGS)
def test_beginnings_that_cannot_be(case: str, series_design: Path) -> None:
    folder, message = BEGINNINGS[case]
    task = Task("irp6", joints=("1", "2", "3", "4", "5"), begin=folder or str(series_design))
    with pytest.raises(InputError, match=message):
        formulate(load_robot("irp6"), task)
