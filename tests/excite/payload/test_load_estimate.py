"""The load and the gains from equations with and without it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from refused import refusal

from excite.identification.observations import Observations
from excite.payload.calibrate_gains import _factors
from excite.payload.known_gains import KnownGains, stated_gains
from excite.payload.load_estimate import LoadEquations, estimate_load
from regressors.errors import InputError

PHI = np.array([2.0, 0.1, -0.2, 0.3, 0.05, 0.0, 0.01, 0.06, 0.0, 0.04])
BETA = np.array([3.0, -1.0, 0.5, 2.0])
DRIVES, INSTANTS = 3, 300


def experiment(gains: np.ndarray, noise: float, seed: int, prior: np.ndarray, *, wide: float = 1.0) -> LoadEquations:
    rng = np.random.default_rng([3, seed])
    fixed = np.random.default_rng(4)
    m = 2 * INSTANTS * DRIVES
    W = fixed.normal(size=(m, BETA.size))
    loaded = np.repeat([0.0, 1.0], INSTANTS * DRIVES)
    K = fixed.normal(size=(m, 10)) * np.array([wide, *(1.0,) * 9]) * loaded[:, None]
    equation = np.tile(np.arange(DRIVES), 2 * INSTANTS)
    y = (W @ BETA + K @ PHI) / gains[equation] + noise * rng.normal(size=m)
    time = np.tile(np.repeat(np.arange(INSTANTS) / 100.0, DRIVES), 2)
    observations = Observations(
        W, y, tuple("abcd"), ("",) * 4, equation, tuple((f"z{k}", "Nm") for k in range(DRIVES)),
        loaded.astype(int), ("bare", "loaded"), time,
    )  # fmt: skip
    return LoadEquations(observations, K, np.zeros((m, 0)), np.zeros(0), prior)


def test_exact_torques_give_the_load_itself() -> None:
    estimate = estimate_load(experiment(np.ones(3), 1e-9, 0, 1e-4 * np.eye(3)))
    np.testing.assert_allclose(estimate.phi, PHI, atol=1e-7)
    np.testing.assert_allclose(estimate.beta, BETA, atol=1e-7)
    assert estimate.quantile == pytest.approx(scipy.stats.t.ppf(0.995, estimate.degrees_of_freedom))


def test_a_gain_that_differs_from_the_others_is_found() -> None:
    """The parameters are those of all drives, so that the data show ratios of gains; priors fix their mean."""
    gains = np.array([1.02, 0.98, 1.0])
    estimate = estimate_load(experiment(gains, 1e-6, 0, 1e-2 * np.eye(3)))
    ratio = (1 + estimate.gains) * gains
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-5)


def test_friction_that_may_have_changed_like_the_load_is_as_uncertain_as_stated() -> None:
    """A change that acts as the mass does leaves the mass its own standard deviation."""
    equations = experiment(np.ones(3), 1e-4, 0, 1e-12 * np.eye(3))
    changing = replace(equations, friction=equations.load[:, :1], changes=np.array([0.2]))
    assert np.sqrt(estimate_load(changing).covariance[0, 0]) == pytest.approx(0.2, rel=1e-3)


def test_a_drift_that_acts_like_the_load_widens_its_interval_and_leaves_its_value() -> None:
    equations = experiment(np.ones(3), 1e-4, 0, 1e-12 * np.eye(3))
    plain, drifting = (
        estimate_load(each) for each in (equations, replace(equations, drifts=0.2 * equations.load[:, :1]))
    )
    np.testing.assert_array_equal(drifting.phi, plain.phi)
    widened = (drifting.covariance - plain.covariance)[0, 0]
    assert np.sqrt(widened) == pytest.approx(0.2, rel=1e-6)


def test_covariance_of_factors_is_that_of_reciprocals() -> None:
    gains, covariance = np.array([0.25, -0.2]), np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
    estimate = replace(estimate_load(experiment(np.ones(3), 1e-4, 0, 1e-4 * np.eye(3))), gains=gains)
    found = _factors(("a", "b"), replace(estimate, gains_covariance=covariance), (), 1.0)
    J = np.diag([(1 / (1 + e + 1e-6) - 1 / (1 + e - 1e-6)) / 2e-6 for e in gains])
    np.testing.assert_allclose(found.factor, [0.8, 1.25])
    np.testing.assert_allclose(found.covariance, J @ covariance @ J.T, rtol=1e-8)
    np.testing.assert_allclose(found.relative, found.covariance / np.outer([0.8, 1.25], [0.8, 1.25]))


def test_a_known_mass_fixes_the_gains() -> None:
    gains = np.array([0.9, 0.8, 0.95])
    equations = experiment(gains, 1e-6, 0, stated_gains(("a", "b", "c"), 10.0, 1.0).relative)
    estimate = estimate_load(equations, mass=PHI[0], start=0.9)
    np.testing.assert_allclose(1 / (1 + estimate.gains), gains, rtol=1e-4)
    assert estimate.phi[0] == PHI[0]
    assert estimate.covariance[0, 0] == 0.0


def test_gains_that_are_all_off_alike_are_in_the_interval_of_the_mass() -> None:
    prior = stated_gains(("a", "b", "c"), 0.1, 0.0).relative + 1e-10 * np.eye(3)
    estimate = estimate_load(experiment(np.ones(3), 1e-3, 0, prior))
    assert np.sqrt(estimate.covariance[0, 0]) == pytest.approx(0.1 * PHI[0], rel=0.02)
    assert np.sqrt(estimate.by_gains[0, 0]) == pytest.approx(0.1 * PHI[0], rel=0.02)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Gains of 2 % each and white noise; of the normalised errors of ten parameters the mean square is one."""
    prior, rng, errors = 4e-4 * np.eye(3), np.random.default_rng(5), []
    for seed in range(60):
        equations = experiment(1 + 0.02 * rng.normal(size=3), 0.5, seed, prior)
        estimate = estimate_load(equations)
        errors.append((estimate.phi - PHI) / np.sqrt(np.diag(estimate.covariance)))
    assert 0.6 < np.mean(np.square(errors)) < 1.2
    assert np.mean(np.abs(errors) > 3.0) < 0.02


def test_what_the_motion_does_not_show_is_named() -> None:
    with pytest.raises(InputError, match=r"does not show m of the load; the mass .*`design_payload_motion`"):
        estimate_load(experiment(np.ones(3), 0.1, 0, 1e-4 * np.eye(3), wide=0.0))


def test_gains_that_cannot_be_are_refused() -> None:
    for factor, covariance, message in (
        ([1.0], np.eye(2), "need 2 factors"),
        ([1.0, -1.0], np.eye(2), "must be positive"),
        ([1.0, np.nan], np.eye(2), "must be positive"),
        ([1.0, 1.0], -np.eye(2), "without negative ones"),
        ([1.0, 1.0], np.full((2, 2), np.inf), "real numbers"),
    ):
        assert re.search(message, refusal(KnownGains, ("a", "b"), np.array(factor), covariance, ""))


def test_gains_drift_to_another_day_only() -> None:
    gains = KnownGains(("a",), np.ones(1), np.eye(1) * 1e-4, "", ("hash",))
    assert gains.later(["hash"]) is gains
    assert gains.later(["other"]).deviation[0] == pytest.approx(np.hypot(0.01, 0.007))
