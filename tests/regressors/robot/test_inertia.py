"""Inertial parameters of a body, against sums over point masses; parameters that no body has."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from slow_dynamics import random_rotation

from regressors.readers.library import built_in
from regressors.robot.inertia import from_centre_of_mass, from_pseudo_inertia, inertia_tensor, pseudo_inertia, transport
from regressors.robot.plausibility import implausible_inertias, principal_moments
from regressors.robot.robot import Joint, Limits, Link, Robot

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


@given(SEED)
def test_from_centre_of_mass(seed: int) -> None:
    m, r = point_masses(seed)
    centre = m @ r / m.sum()
    theta = from_centre_of_mass(m.sum(), centre, tensor_of(m, r - centre))
    np.testing.assert_allclose(theta, theta_of(m, r), rtol=1e-12, atol=1e-12)


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
def test_transport_moves_the_points(seed: int) -> None:
    m, r = point_masses(seed)
    rng = np.random.default_rng(seed)
    R, p = random_rotation(rng), rng.normal(size=3)
    moved = transport(R, p) @ theta_of(m, r)
    np.testing.assert_allclose(moved, theta_of(m, r @ R.T + p), rtol=1e-11, atol=1e-11)


CENTRE = (0.1, -0.05, 0.2)


def robot(*thetas: np.ndarray | None) -> Robot:
    joints = tuple(Joint(f"j{k}", "revolute", np.eye(3), np.zeros(3)) for k in range(len(thetas)))
    links = tuple(Link(f"l{k}", theta) for k, theta in enumerate(thetas))
    return Robot("chain", joints, links, Limits.none(len(thetas)))


def body(mass: float, moments: tuple[float, float, float]) -> np.ndarray:
    return from_centre_of_mass(mass, CENTRE, np.diag(moments))


SOUND = body(3.0, (0.1, 0.2, 0.25))


@pytest.mark.parametrize(
    ("theta", "reason"),
    [
        (None, "no mass is stated"),
        (body(-1.0, (0.1, 0.2, 0.25)), "the mass is negative, -1 kg"),
        (body(2.0, (-0.1, 0.2, 0.25)), "a principal moment of inertia is negative, -0.1"),
        (body(2.0, (0.1, 0.2, 0.4)), "0.1, 0.2, 0.4 kg m.2 break the triangle inequality"),
    ],
)
def test_a_body_that_cannot_be_is_named_with_its_reason(theta: np.ndarray | None, reason: str) -> None:
    ((link, told),) = implausible_inertias(robot(SOUND, theta)).items()
    assert link == "l1"
    assert re.search(reason, told)


def test_three_equal_bodies_are_placeholders_and_two_are_not() -> None:
    assert implausible_inertias(robot(SOUND, SOUND, 2 * SOUND)) == {}
    assert list(implausible_inertias(robot(SOUND, SOUND, SOUND))) == ["l0", "l1", "l2"]


def test_a_robot_without_any_mass_is_not_described() -> None:
    assert set(implausible_inertias(robot(np.zeros(10), np.zeros(10))).values()) == {"the mass is zero"}
    assert implausible_inertias(robot(SOUND, np.zeros(10))) == {}  # frames without mass are common


def test_published_robots_are_plausible() -> None:
    assert all(implausible_inertias(built_in(name)) == {} for name in ("irp6", "panda", "ur10e"))


@given(arrays(float, (6, 3), elements=st.floats(-2.0, 2.0)), arrays(float, 6, elements=st.floats(0.1, 5.0)))
def test_point_masses_are_a_body_whatever_their_place(points: np.ndarray, masses: np.ndarray) -> None:
    tensor = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    theta = np.concatenate([[masses.sum()], masses @ points, tensor[np.triu_indices(3)]])
    centred = points - masses @ points / masses.sum()
    about = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, centred, strict=True))
    np.testing.assert_allclose(principal_moments(theta), np.linalg.eigvalsh(about), atol=1e-9)
    if np.linalg.eigvalsh(about)[2] > 1e-6:
        assert implausible_inertias(robot(theta)) == {}
