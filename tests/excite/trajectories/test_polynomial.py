"""Chebyshev polynomials as a family: its basis against NumPy's, rest, exact extrema, the grid's guarantee, designs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

import excite
from constraints.linear import LinearConstraint
from excite.design.grid_limits import GridConstraint
from excite.registry import TRAJECTORIES
from excite.trajectories import Trajectory, stored_trajectory
from excite.trajectories.polynomial import Polynomial
from regressors.errors import InputError
from regressors.samples import Array


@pytest.fixture(params=[(7.0, 1), (10.0, 5), (30.0, 20)], ids=str)
def family(request: pytest.FixtureRequest) -> Polynomial:
    return Polynomial(*request.param)


def motion(family: Polynomial, seed: int, joints: int = 3) -> Array:
    return np.random.default_rng(seed).normal(size=(joints, family.size))


@pytest.mark.parametrize("derivative", range(4))
def test_motions_are_numpys_polynomials(family: Polynomial, derivative: int) -> None:
    x = motion(family, 1)
    t = np.linspace(0.0, family.duration, 300)
    for column, series in zip(family.motion(x, t, derivative).T, family.coefficients(x), strict=True):
        polynomial = Chebyshev(series, domain=(0.0, family.duration))
        expected = (polynomial.deriv(derivative) if derivative else polynomial)(t)
        np.testing.assert_allclose(column, expected, atol=1e-9 * np.abs(expected).max())
        assert polynomial.degree() == 4 * family.harmonics + 5


def test_every_motion_rests_at_both_ends_and_returns(family: Polynomial) -> None:
    ends, inside = np.array([0.0, family.duration]), np.linspace(0.0, family.duration, 300)
    for d in (1, 2):
        assert np.abs(family.basis(ends, d)).max() <= 1e-11 * np.abs(family.basis(inside, d)).max()
    first, last = family.basis(ends, 0)
    np.testing.assert_allclose(first, last, atol=1e-12)
    assert family.size == family.degree - 4
    assert np.linalg.matrix_rank(family.basis(inside, 0)) == family.size


def test_the_constant_stays_at_one(family: Polynomial) -> None:
    t = np.linspace(0.0, family.duration, 50)
    np.testing.assert_allclose(family.basis(t, 0) @ family.constant, 1.0, atol=1e-12)
    x = motion(family, 2)
    np.testing.assert_allclose(family.from_coefficients(family.coefficients(x)), x, atol=1e-9)


@pytest.mark.parametrize("derivative", range(4))
def test_extrema_are_those_of_dense_samples(family: Polynomial, derivative: int) -> None:
    x = motion(family, 3)
    t = 0.5 * family.duration * (1.0 - np.cos(np.linspace(0.0, np.pi, 40_001)))
    values = family.motion(x, t, derivative)
    size = np.abs(values).max(axis=0)
    extrema = family.extrema(x, derivative)
    for exact, sampled in ((extrema.high, values.max(axis=0)), (-extrema.low, -values.min(axis=0))):
        assert np.all(exact >= sampled - 1e-9 * size)
        assert np.all(exact <= sampled + 1e-4 * size)


@pytest.mark.parametrize("derivative", range(4))
def test_what_stays_within_the_grid_bounds_stays_within_the_bounds(family: Polynomial, derivative: int) -> None:
    one = np.ones(1)
    limit = LinearConstraint(derivative, np.eye(1), np.zeros(1), -one, one, ("a",), ("rad",))
    grid = GridConstraint.on_coordinates(limit, family.on_grid(1024))
    assert grid.upper[0] > 0.98
    for seed in range(5):
        x = motion(family, seed, 1)
        x = x * float(grid.upper[0]) / np.abs(grid.values(x)).max()
        extrema = family.extrema(x, derivative)
        assert max(float(extrema.high[0]), -float(extrema.low[0])) <= 1.0 + 1e-9


def test_a_motion_read_back_is_the_same_motion(family: Polynomial) -> None:
    x = motion(family, 5)
    stored = stored_trajectory(json.loads(json.dumps(family.to_dict(x))), 3)
    t = np.linspace(0.0, family.duration, 100)
    np.testing.assert_allclose(stored.samples(t).q, Trajectory(family, x).samples(t).q, rtol=1e-12, atol=1e-12)
    assert type(stored.family) is Polynomial


@pytest.mark.parametrize(
    ("period", "harmonics", "message"),
    [(0.0, 3, "period must be a positive number of seconds, given 0"), (5.0, 0, "harmonics: expected 1 or more")],
)
def test_bad_input(period: float, harmonics: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Polynomial(period, harmonics)


def test_designs_by_name_keep_all_limits(tmp_path: Path) -> None:
    assert Polynomial.name in TRAJECTORIES
    task = excite.Task("irp6", trajectory="polynomial", harmonics=4, starts=1, executor="serial")
    design = excite.design_trajectory(task)
    assert design.feasible
    assert design.condition_number < 120
    design.save(tmp_path / "design")
    stored = excite.load_design(tmp_path / "design")
    assert stored.task == design.task
    np.testing.assert_allclose(stored.trajectory.x, design.trajectory.x, rtol=1e-9, atol=1e-9)
    finer = task.trajectory.finer()
    assert (finer.harmonics, finer.family().size) == (5, 21)
