"""Inertial parameters of a body, against the sums over the point masses that it is made of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_dynamics import random_rotation

from regressors.robot.inertia import (
    PARAMETER_UNITS,
    from_centre_of_mass,
    from_pseudo_inertia,
    inertia_tensor,
    parameter_names,
    pseudo_inertia,
    skew,
    transport,
)

SEED = st.integers(0, 2**32 - 1)


def point_masses(seed: int, count: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Masses and positions; more than four points are never in one plane."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 3.0, count), rng.normal(0.0, 0.4, (count, 3))


def tensor_of(m: np.ndarray, r: np.ndarray) -> np.ndarray:
    """``I = int (|r|^2 E - r r') dm``."""
    return sum(mass * (p @ p * np.eye(3) - np.outer(p, p)) for mass, p in zip(m, r, strict=True))


def theta_of(m: np.ndarray, r: np.ndarray) -> np.ndarray:
    I = tensor_of(m, r)
    return np.array([m.sum(), *(m @ r), I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2]])


def test_order_names_and_units() -> None:
    names = ("m7", "m7c7x", "m7c7y", "m7c7z", "I7xx", "I7xy", "I7xz", "I7yy", "I7yz", "I7zz")
    assert parameter_names(7) == names
    assert list(PARAMETER_UNITS) == ["kg", *["kg m"] * 3, *["kg m^2"] * 6]


@given(SEED)
def test_skew_is_the_cross_product(seed: int) -> None:
    v, w = np.random.default_rng(seed).normal(size=(2, 3))
    np.testing.assert_allclose(skew(v) @ w, np.cross(v, w), atol=1e-15)


@given(SEED)
def test_from_centre_of_mass(seed: int) -> None:
    m, r = point_masses(seed)
    centre = m @ r / m.sum()
    theta = from_centre_of_mass(m.sum(), centre, tensor_of(m, r - centre))
    np.testing.assert_allclose(theta, theta_of(m, r), rtol=1e-12, atol=1e-12)


def test_rod_about_its_end() -> None:
    """A thin rod of mass m and length l: m l^2 / 12 about its centre, m l^2 / 3 about its end."""
    m, l = 3.0, 0.8
    theta = from_centre_of_mass(m, [l / 2, 0, 0], np.diag([0, m * l**2 / 12, m * l**2 / 12]))
    np.testing.assert_allclose(theta, [m, m * l / 2, 0, 0, 0, 0, 0, m * l**2 / 3, 0, m * l**2 / 3], atol=1e-15)


@given(SEED)
def test_inertia_tensor(seed: int) -> None:
    m, r = point_masses(seed)
    np.testing.assert_allclose(inertia_tensor(theta_of(m, r)), tensor_of(m, r), rtol=1e-14)


@given(SEED)
def test_pseudo_inertia_is_the_second_moment_of_the_mass(seed: int) -> None:
    m, r = point_masses(seed)
    h = np.column_stack([r, np.ones(len(r))])
    np.testing.assert_allclose(pseudo_inertia(theta_of(m, r)), (m * h.T) @ h, rtol=1e-11, atol=1e-12)


@given(st.lists(st.floats(-10, 10), min_size=10, max_size=10))
def test_pseudo_inertia_and_back_for_any_ten_numbers(theta: list[float]) -> None:
    np.testing.assert_allclose(from_pseudo_inertia(pseudo_inertia(theta)), theta, atol=1e-14)


@given(SEED)
def test_pseudo_inertia_and_back_for_any_symmetric_matrix(seed: int) -> None:
    A = np.random.default_rng(seed).normal(size=(4, 4))
    np.testing.assert_allclose(pseudo_inertia(from_pseudo_inertia(A + A.T)), A + A.T, atol=1e-14)


@given(SEED)
@settings(max_examples=50)
def test_pseudo_inertia_of_a_body_is_positive_definite(seed: int) -> None:
    assert np.linalg.eigvalsh(pseudo_inertia(theta_of(*point_masses(seed))))[0] > 0


@pytest.mark.parametrize(
    ("what", "theta"),
    [
        ("negative mass", [-1, 0, 0, 0, 1, 0, 0, 1, 0, 1]),
        ("moments of inertia that break the triangle inequality", [1, 0, 0, 0, 1, 0, 0, 1, 0, 3]),
        ("a centre of mass too far out for its inertia", [1, 2, 0, 0, 1, 0, 0, 1, 0, 1]),
        ("products of inertia too large", [1, 0, 0, 0, 1, 1.5, 0, 1, 0, 1]),
    ],
)
def test_pseudo_inertia_of_no_body_is_not_positive_definite(what: str, theta: list[float]) -> None:
    assert np.linalg.eigvalsh(pseudo_inertia(theta))[0] < 0, what


@given(SEED)
def test_a_flat_body_is_on_the_border(seed: int) -> None:
    m, r = point_masses(seed)
    r[:, 2] = 0.0
    eigenvalues = np.linalg.eigvalsh(pseudo_inertia(theta_of(m, r)))
    assert abs(eigenvalues[0]) <= 1e-12 * eigenvalues[-1]


@given(SEED)
def test_transport_moves_the_points(seed: int) -> None:
    m, r = point_masses(seed)
    rng = np.random.default_rng(seed)
    R, p = random_rotation(rng), rng.normal(size=3)
    moved = transport(R, p) @ theta_of(m, r)
    np.testing.assert_allclose(moved, theta_of(m, r @ R.T + p), rtol=1e-11, atol=1e-11)


@given(SEED)
def test_transports_compose_and_invert(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (R, S), (p, s) = [random_rotation(rng) for _ in range(2)], rng.normal(size=(2, 3))
    np.testing.assert_allclose(transport(R, p) @ transport(S, s), transport(R @ S, R @ s + p), atol=1e-11)
    np.testing.assert_allclose(transport(R, p) @ transport(R.T, -R.T @ p), np.eye(10), atol=1e-11)


def test_transport_without_motion_is_the_identity() -> None:
    np.testing.assert_array_equal(transport(np.eye(3), np.zeros(3)), np.eye(10))
