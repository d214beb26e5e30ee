"""Samples of the posterior: of the right distribution, by an oracle that rejects, and every one a possible robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from identified import FREEDOM, result_of, two_links, with_estimate

import excite
from excite.identification.identification import Identification, torque_target
from excite.study import chains as chains
from excite.study.posterior_samples import PosteriorSamples
from regressors.models.nominal import standard_values
from regressors.robot.columns import COULOMB, ROTOR, VISCOUS
from regressors.robot.inertia import from_pseudo_inertia, parameter_names, pseudo_inertia

TO_PSEUDO = np.stack([pseudo_inertia(unit) for unit in np.eye(10)], axis=-1)  # (4, 4, 10)
FROM_PSEUDO = np.column_stack([from_pseudo_inertia(unit.reshape(4, 4)) for unit in np.eye(16)])  # (10, 16)
KEPT = 1e-3  # of the described pseudo-inertia
PRIOR = 0.4
POSITIVE = (ROTOR, COULOMB, VISCOUS)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    return two_links(tmp_path_factory.mktemp("result"))


@pytest.fixture(scope="module")
def samples(result: Identification) -> PosteriorSamples:
    return excite.sample_posterior(result, 2000, seed=1, prior=PRIOR)


def possible(result: Identification, theta: np.ndarray) -> np.ndarray:
    """Whether robots are possible, from the definition: no coordinates, no scaling."""
    target = torque_target(result)
    names = [column.name for column in target.model.standard_columns]
    positive = [k for k, column in enumerate(target.model.standard_columns) if column.kind in POSITIVE]
    inside = np.all(theta[:, positive] >= 0, axis=1)
    for number, body in zip(target.robot.body_numbers, target.robot.bodies, strict=True):
        part = theta[:, [names.index(name) for name in parameter_names(number)]] - KEPT * body.theta
        inside &= np.linalg.eigvalsh(np.moveaxis(TO_PSEUDO @ part.T, -1, 0))[:, 0] > 0
    return inside


def oracle(result: Identification, count: int) -> tuple[np.ndarray, float]:
    """Draws by Matheron's rule, of which impossible ones are rejected, and the share that is accepted."""
    target, rng = torque_target(result), np.random.default_rng(5)
    definition, names = target.model.definition()
    A, stated = target.base.D @ definition, standard_values(target.robot)
    prior = np.zeros((count, len(names)))
    for k, column in enumerate(target.model.standard_columns):
        size = stated.get(column.name, 0.0)
        deviation = PRIOR * abs(size) if size else (1e-4 if column.kind == ROTOR else 1.0)
        prior[:, k] = (size or (1e-4 if column.kind == ROTOR else 0.0)) + deviation * rng.normal(size=count)
    for number, body in zip(target.robot.body_numbers, target.robot.bodies, strict=True):
        index = [names.index(name) for name in parameter_names(number)]
        L = np.linalg.cholesky(pseudo_inertia(body.theta))
        E = PRIOR * rng.normal(size=(count, 4, 4))
        E = (E + E.swapaxes(1, 2)) / 2  # off the diagonal with the deviation over sqrt 2
        prior[:, index] = (L @ (np.eye(4) + E) @ L.T).reshape(count, 16) @ FROM_PSEUDO.T
    V = np.cov(prior, rowvar=False)
    C = result.estimate.covariance
    t = rng.multivariate_normal(np.zeros(len(C)), C, count) / np.sqrt(rng.chisquare(FREEDOM, (count, 1)) / FREEDOM)
    theta = prior + (result.coefficients + t - prior @ A.T) @ np.linalg.solve(A @ V @ A.T, A @ V)
    inside = possible(result, theta)
    return theta[inside], float(inside.mean())


def test_mean_and_covariance_are_those_of_rejection(result: Identification, samples: PosteriorSamples) -> None:
    expected, accepted = oracle(result, 40_000)
    assert 0.02 < accepted < 0.3  # most of the posterior without bounds is impossible
    size = expected.std(axis=0)
    free = size > 0
    error = np.sqrt(1 / len(expected) + 1 / samples.effective)
    np.testing.assert_array_less(np.abs(samples.mean - expected.mean(axis=0))[free] / size[free], 4.5 * error)
    ratio = samples.values.std(axis=0)[free] / size[free]
    np.testing.assert_array_less(np.abs(np.log(ratio)), 6 * error)
    correlations = [np.corrcoef(values[:, free], rowvar=False) for values in (samples.values, expected)]
    assert np.abs(correlations[0] - correlations[1]).max() < 6 * error


def test_truncation_matters(result: Identification, samples: PosteriorSamples) -> None:
    """Without bounds the mean of a friction coefficient would be its estimate."""
    k = samples.base_names.index("F2c")
    assert samples.base_values[:, k].mean() > 3 * result.coefficients[k]


def test_every_sample_is_a_possible_robot(result: Identification, samples: PosteriorSamples) -> None:
    assert possible(result, samples.values).all()
    assert possible(result, samples.mean[None]).all()


def test_base_parameters_are_those_of_the_samples(result: Identification, samples: PosteriorSamples) -> None:
    target = torque_target(result)
    definition, names = target.model.definition()
    assert samples.names == names
    np.testing.assert_allclose(samples.base_values, samples.values @ (target.base.D @ definition).T, atol=1e-12)


def test_a_sample_is_the_same_however_many_are_drawn(result: Identification, samples: PosteriorSamples) -> None:
    few = excite.sample_posterior(result, 40, seed=1, prior=PRIOR)
    np.testing.assert_array_equal(few.values, samples.values[:40])
    other = excite.sample_posterior(result, 40, seed=2, prior=PRIOR)
    assert not np.any(other.values[:, 0] == few.values[:, 0])


@pytest.mark.slow
def test_what_the_data_do_not_determine_is_spread_as_the_description_says(tmp_path: Path) -> None:
    """Exact base parameters: what remains follows the prior, whose deviation it is proportional to."""
    result = two_links(tmp_path, share=1e-6)
    result = with_estimate(result, degrees_of_freedom=10**6)
    narrow, wide = (excite.sample_posterior(result, 600, prior=prior) for prior in (0.02, 0.06))
    k = narrow.names.index("m2")
    deviations = [one.values[:, k].std() / one.mean[k] for one in (narrow, wide)]
    assert 0.004 < deviations[0] < 0.023  # the mass itself has 0.02, less what the first moments tell of it
    assert deviations[1] == pytest.approx(3 * deviations[0], rel=0.15)
    np.testing.assert_allclose(wide.base_values.std(axis=0), 0, atol=1e-4 * np.abs(result.coefficients).max())


def test_parameters_without_information_are_spread_by_the_description(tmp_path: Path) -> None:
    result = two_links(tmp_path, share=0.003)
    covariance = result.estimate.covariance.copy()
    covariance[0], covariance[:, 0] = 0.0, 0.0
    covariance[0, 0] = np.inf
    loose = excite.sample_posterior(with_estimate(result, covariance=covariance), 300)
    tight = excite.sample_posterior(result, 300)
    assert loose.base_values[:, 0].std() > 3 * tight.base_values[:, 0].std()
    assert any("1 parameters that the data do not determine" in note for note in loose.notes)


@pytest.mark.slow
def test_zeros_of_the_structure_hold_exactly(tmp_path: Path) -> None:
    result = result_of(excite.load_robot("irp6"), tmp_path)
    covariance = np.diag((0.01 * np.abs(result.coefficients)) ** 2)
    (tmp_path / "result.json").write_text("{}")
    samples = excite.sample_posterior(with_estimate(result, covariance=covariance, degrees_of_freedom=1000), 64)
    zero = [k for k, name in enumerate(samples.names) if name in torque_target(result).robot.structure.zero]
    assert len(zero) > 10
    assert not np.any(samples.values[:, zero])
    assert np.all(np.ptp(np.delete(samples.values, zero, axis=1), axis=0) > 0)


@pytest.mark.slow
def test_mismatch_of_friction_widens(tmp_path: Path) -> None:
    result = two_links(tmp_path, share=0.01)
    change = np.zeros(len(result.names))
    change[0] = 0.1 * abs(result.coefficients[0])
    wider = with_estimate(result, mismatch=np.outer(change, change))
    plain, wide = excite.sample_posterior(result, 300), excite.sample_posterior(wider, 300)
    assert wide.base_values[:, 0].std() > 3 * plain.base_values[:, 0].std()
    assert any("friction of the log differs" in note for note in wide.notes)


def test_an_estimate_far_from_every_possible_robot_is_said(tmp_path: Path) -> None:
    result = two_links(tmp_path, share=0.01)
    signs = [-1.0 if name == "F2v" else 1.0 for name in result.names]
    samples = excite.sample_posterior(with_estimate(result, fit=signs * result.coefficients), 64)
    assert samples.distance > 50
    assert any("no possible robot is within the 99 % region" in note for note in samples.notes)
    assert possible(result, samples.values).all()


def test_chains_that_do_not_move_are_not_believed(result: Identification, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chains, "next_points", lambda _, __, z, *___: (z, np.zeros(len(z), dtype=bool)))
    with pytest.raises(excite.errors.ConicSolverError, match="hardly any room for possible robots"):
        excite.sample_posterior(result, 64)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 0}, "samples"),
        ({"samples": 1.5}, "samples"),
        ({"seed": -1}, "seed"),
        ({"prior": 0.0}, "prior"),
        ({"prior": float("nan")}, "prior"),
    ],
)
def test_numbers_out_of_range_are_refused(options: dict[str, Any], message: str, result: Identification) -> None:
    with pytest.raises(excite.InputError, match=message):
        excite.sample_posterior(result, **options)


def _singular(result: Identification) -> Any:
    return with_estimate(result, covariance=np.ones((len(result.names),) * 2))


def _without_covariance(result: Identification) -> Any:
    covariance = np.where(np.eye(len(result.names)), result.estimate.covariance, np.nan)
    return with_estimate(result, covariance=covariance)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda _: 3, "result: expected a result of `identify`, text or a path"),
        (lambda _: "nowhere", "nowhere holds no result"),
        (_without_covariance, "states no covariance"),
        (_singular, "not positive definite"),
    ],
)
def test_bad_results_are_refused(change: Any, message: str, result: Identification) -> None:
    with pytest.raises(excite.InputError, match=message):
        excite.sample_posterior(change(result))


@pytest.mark.parametrize(
    ("level", "message"), [(0.4, "level"), (1.0, "level"), (0.9995, "at least 20001 samples, given 2000")]
)
def test_levels_that_cannot_be_stated_are_refused(level: float, message: str, samples: PosteriorSamples) -> None:
    with pytest.raises(excite.InputError, match=message):
        samples.ranges(level)


def test_ranges_hold_their_share_of_the_samples(samples: PosteriorSamples) -> None:
    for level in (0.5, 0.99):
        ranges = {one.name: one for one in samples.ranges(level)}
        assert set(ranges) == {*samples.names, *samples.base_names}
        for values, name in zip(samples.values.T, samples.names, strict=True):
            share = np.mean((values >= ranges[name].low) & (values <= ranges[name].high))
            assert share == pytest.approx(level, abs=0.002)
            assert ranges[name].mean == pytest.approx(values.mean())


def test_progress_reaches_its_end(result: Identification) -> None:
    steps: list[tuple[int, int]] = []
    excite.sample_posterior(result, 1, progress=lambda done, total: steps.append((done, total)))
    assert steps == [(k + 1, len(steps)) for k in range(len(steps))]
    assert "1 possible robots" in repr(excite.sample_posterior(result, 1))
