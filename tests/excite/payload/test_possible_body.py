"""The possible body nearest to an estimate, forms of bodies, and frames."""

from __future__ import annotations

import numpy as np
import pytest

from excite.payload.held_body import Frame, HeldBody, is_possible, nearest_possible, spread_of
from regressors.robot.inertia import from_centre_of_mass, pseudo_inertia, rotation_from_rpy

BODY = from_centre_of_mass(2.0, [0.02, -0.03, 0.1], np.diag([0.01, 0.02, 0.025]))


def test_a_possible_body_stays_as_it_is() -> None:
    np.testing.assert_array_equal(nearest_possible(BODY, np.eye(10)), BODY)


def test_an_impossible_body_becomes_the_nearest_possible_one() -> None:
    """No random possible body is nearer in the metric of the covariance."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(10, 10)) * np.array([0.01, *(0.01,) * 3, *(0.02,) * 6])[:, None]
    C = A @ A.T
    estimate = BODY - np.array([0, 0, 0, 0, 0.05, 0, 0, 0, 0, 0.0])
    assert not is_possible(estimate)
    found = nearest_possible(estimate, C)
    assert np.linalg.eigvalsh(pseudo_inertia(found))[0] > 0

    def distance(phi: np.ndarray) -> float:
        d = phi - estimate
        return float(d @ np.linalg.solve(C, d))

    tried = found + rng.normal(size=(4000, 10)) * np.geomspace(1e-6, 1e-2, 4000)[:, None] * np.sqrt(np.diag(C))
    possible = [phi for phi in tried if is_possible(phi)]
    assert len(possible) > 100
    assert min(map(distance, possible)) > distance(found) * (1 - 1e-3)


@pytest.mark.parametrize(("moments", "possible"), [((0.3, 0.4, 0.5), True), ((0.3, 0.1, 0.5), False)])
def test_principal_axes_and_moments_belong_together(moments: tuple[float, ...], possible: bool) -> None:
    """Of axes near those of the frame, whatever the order of the moments; none may exceed the sum of the others."""
    R = rotation_from_rpy([0.1, -0.2, 0.15])
    body = HeldBody.of(from_centre_of_mass(2.0, [0.1, 0.0, 0.2], R @ np.diag(moments[::-1]) @ R.T))
    found, axes = body.principal
    np.testing.assert_allclose(found, moments[::-1])
    np.testing.assert_allclose(axes, R, atol=1e-12)  # a rotation, not a mirror
    assert is_possible(body.parameters) == possible


def test_a_body_is_its_parameters() -> None:
    body = HeldBody.of(BODY)
    np.testing.assert_allclose(body.centre, [0.02, -0.03, 0.1])
    np.testing.assert_allclose(body.inertia, np.diag([0.01, 0.02, 0.025]), atol=1e-15)
    np.testing.assert_allclose(body.parameters, BODY, atol=1e-15)
    assert is_possible(body.parameters)


def test_a_frame_moves_a_body() -> None:
    frame = Frame("flange", rotation_from_rpy([0.1, 0.2, 0.3]), np.array([0.0, 0.1, 0.2]))
    seen = HeldBody.of(frame.from_link @ BODY)
    link = HeldBody.of(BODY)
    assert seen.mass == pytest.approx(link.mass)
    np.testing.assert_allclose(frame.rotation @ seen.centre + frame.translation, link.centre)
    np.testing.assert_allclose(frame.rotation @ seen.inertia @ frame.rotation.T, link.inertia, atol=1e-15)
    np.testing.assert_allclose(frame.to_link @ frame.from_link, np.eye(10), atol=1e-13)


def test_the_spread_of_a_function_is_that_of_samples() -> None:
    rng = np.random.default_rng(1)
    C = np.diag((1e-3 * np.abs(BODY) + 1e-5) ** 2)
    samples = BODY + rng.normal(size=(20000, 10)) * np.sqrt(np.diag(C))
    scatter = np.std([HeldBody.of(phi).listed for phi in samples], axis=0)
    np.testing.assert_allclose(spread_of(lambda phi: HeldBody.of(phi).listed, BODY, C), scatter, rtol=0.03)
