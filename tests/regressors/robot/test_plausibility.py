"""Inertial parameters that no body has, beside those of real bodies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from regressors.readers.library import built_in
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.plausibility import implausible_inertias, principal_moments
from regressors.robot.robot import Joint, Limits, Link, Robot

CENTRE = (0.1, -0.05, 0.2)


def robot(*thetas: np.ndarray | None) -> Robot:
    n = len(thetas)
    return Robot(
        name="chain",
        joints=tuple(Joint(f"j{k}", "revolute", np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0])) for k in range(n)),
        links=tuple(Link(f"l{k}", theta) for k, theta in enumerate(thetas)),
        limits=Limits.none(n),
    )


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
    reasons = implausible_inertias(robot(SOUND, theta))
    assert list(reasons) == ["l1"]
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(reasons["l1"])


def test_three_equal_bodies_are_placeholders_and_two_are_not() -> None:
    assert implausible_inertias(robot(SOUND, SOUND, 2 * SOUND)) == {}
    assert list(implausible_inertias(robot(SOUND, SOUND, SOUND))) == ["l0", "l1", "l2"]


def test_a_robot_without_any_mass_is_not_described() -> None:
    assert set(implausible_inertias(robot(np.zeros(10), np.zeros(10))).values()) == {"the mass is zero"}
    assert implausible_inertias(robot(SOUND, np.zeros(10))) == {}  # frames without mass are common


@pytest.mark.parametrize("name", ["irp6", "panda", "ur10e"])
def test_published_robots_are_plausible(name: str) -> None:
    assert implausible_inertias(built_in(name)) == {}


@given(
    points=arrays(float, (6, 3), elements=st.floats(-2.0, 2.0)), masses=arrays(float, 6, elements=st.floats(0.1, 5.0))
)
def test_point_masses_are_a_body_whatever_their_place(points: np.ndarray, masses: np.ndarray) -> None:
    tensor = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    theta = np.concatenate([[masses.sum()], masses @ points, tensor[np.triu_indices(3)]])
    centred = points - masses @ points / masses.sum()
    about = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, centred, strict=True))
    np.testing.assert_allclose(principal_moments(theta), np.linalg.eigvalsh(about), atol=1e-9)
    if np.linalg.eigvalsh(about)[2] > 1e-6:
        assert implausible_inertias(robot(theta)) == {}
