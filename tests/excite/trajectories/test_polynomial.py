"""Chebyshev polynomials as a family: its basis against NumPy's, rest, exact extrema, the grid's guarantee, designs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

import excite
from excite.registry import TRAJECTORIES
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
