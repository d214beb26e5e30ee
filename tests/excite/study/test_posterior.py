"""Samples of the posterior: of the right distribution, every one a possible robot, and as files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from identified import FREEDOM, result_of, two_links, with_estimate

import excite
from excite.export.models.robot_yaml import ranges_text
from excite.identification.estimators.possible_set import PossibleSet
from excite.identification.identification import Identification, torque_target
from excite.study import chains as chains
from excite.study.chains import PosteriorCoordinates, ReflectedPaths, next_points
from excite.study.posterior_samples import PosteriorSamples, load_posterior
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


def test_every_sample_is_a_possible_robot(result: Identification, samples: PosteriorSamples) -> None:
    assert possible(result, samples.values).all()
    assert possible(result, samples.mean[None]).all()


def test_a_sample_is_the_same_however_many_are_drawn(result: Identification, samples: PosteriorSamples) -> None:
    steps: list[tuple[int, int]] = []
    few = excite.sample_posterior(result, 40, seed=1, prior=PRIOR, progress=lambda *step: steps.append(step))
    np.testing.assert_array_equal(few.values, samples.values[:40])
    assert steps == [(k + 1, len(steps)) for k in range(len(steps))]
    assert "40 possible robots" in repr(few)
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


def test_bad_input_is_refused(result: Identification, samples: PosteriorSamples) -> None:
    for name, value in (("samples", 0), ("samples", 1.5), ("seed", -1), ("prior", 0.0), ("prior", float("nan"))):
        with pytest.raises(excite.InputError, match=name):
            excite.sample_posterior(result, **{name: value})
    size = len(result.names)
    unknown = np.where(np.eye(size), result.estimate.covariance, np.nan)
    for given, message in (
        (3, "result: expected a result of `identify`, text or a path"),
        ("nowhere", "nowhere holds no result"),
        (with_estimate(result, covariance=unknown), "states no covariance"),
        (with_estimate(result, covariance=np.ones((size, size))), "not positive definite"),
    ):
        with pytest.raises(excite.InputError, match=message):
            excite.sample_posterior(given)
    for level, message in ((0.4, "level"), (1.0, "level"), (0.9995, "at least 20001 samples, given 2000")):
        with pytest.raises(excite.InputError, match=message):
            samples.ranges(level)


SIZE, CHAINS = 6, 400


def small_set(width: float = 1.0) -> PossibleSet:
    """Two bodies and a positive parameter about the origin, with walls at distances of about the width."""
    rng = np.random.default_rng(0)
    B = rng.normal(size=(2, 4, 4, SIZE))
    return PossibleSet(
        np.array([width * np.eye(4)] * 2), B + B.swapaxes(1, 2), np.array([width]), rng.normal(size=(1, SIZE))
    )


def isotropic(freedom: float = 1e9) -> PosteriorCoordinates:
    return PosteriorCoordinates(np.zeros(SIZE), np.eye(SIZE), SIZE, freedom)


@pytest.mark.parametrize("round_", [True, False])
def test_a_drift_keeps_speed_stays_inside_and_can_be_walked_back(round_: bool) -> None:
    rng, possible = np.random.default_rng(1), small_set()
    shape = np.eye(SIZE) if round_ else np.linalg.cholesky(np.cov(rng.normal(size=(SIZE, 20))))
    start, n = np.zeros((CHAINS, SIZE)), rng.normal(size=(CHAINS, SIZE))
    there = ReflectedPaths(possible, shape, start.copy(), n.copy(), np.ones(CHAINS, dtype=bool))
    there.drift(1.0)
    assert there.sound.mean() > 0.99
    assert np.abs(there.z - n @ shape.T).max() > 1  # walls were met
    assert possible.margins(there.z[there.sound]).min() > -1e-12
    np.testing.assert_allclose(np.linalg.norm(there.n, axis=1), np.linalg.norm(n, axis=1), rtol=1e-10)
    back = ReflectedPaths(possible, shape, there.z.copy(), -there.n, there.sound.copy())
    back.drift(1.0)
    returned = np.abs(back.z[back.sound] - start[back.sound]).max(axis=1)
    assert np.quantile(returned, 0.95) < 1e-4  # reflections at corners magnify rounding


def test_acceptance_corrects_long_drifts() -> None:
    """Without walls, drifts of 1.2 deviations alone would give a variance of 1 / (1 - 0.36)."""
    rng, far = np.random.default_rng(2), small_set(1e6)
    z, kept, accepted = rng.normal(size=(CHAINS, SIZE)), [], []
    for _ in range(60):
        z, moved = next_points(isotropic(), far, z, rng, np.eye(SIZE), 1.2)
        kept.append(z)
        accepted.append(moved.mean())
    assert 0.4 < np.mean(accepted) < 0.95
    assert np.var(kept) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("freedom", [1e9, 5.0])
def test_the_slope_is_that_of_the_energy(freedom: float) -> None:
    coordinates, z = isotropic(freedom), np.random.default_rng(3).normal(size=(1, SIZE))
    for k, unit in enumerate(1e-6 * np.eye(SIZE)):
        difference = (coordinates.energy(z + unit) - coordinates.energy(z - unit)) / 2e-6
        assert difference[0] == pytest.approx(coordinates.slope_of_energy(z)[0, k], rel=1e-6)


SAMPLES = Path(__file__).resolve().parents[2] / "samples" / "posterior-1"
FIELDS = ("robot", "result_sha256", "seed", "prior", "names", "units", "base_names", "base_units", "distance", "notes")


def same(read: PosteriorSamples, known: PosteriorSamples) -> None:
    np.testing.assert_array_equal(read.values, known.values)
    np.testing.assert_array_equal(read.base_matrix, known.base_matrix)
    assert [getattr(read, name) for name in FIELDS] == [getattr(known, name) for name in FIELDS]
    assert np.isnan(read.split_deviation)


def drawn(count: int = 1200) -> PosteriorSamples:
    rng = np.random.default_rng(0)
    values = np.column_stack([rng.normal(5, 1e-9, count), rng.lognormal(0, 3, count) * 1e-7, np.zeros(count)])
    return PosteriorSamples(
        robot='an "arm", with a comma',
        result_sha256="ab" * 32,
        seed=7,
        prior=0.3,
        names=("m1", "I1xx", "m1c1x"),
        units=("kg", "kg m^2", "kg m"),
        values=values,
        base_names=("X1",),
        base_units=("kg",),
        base_matrix=np.array([[1.0, 1 / 3, 0.0]]),
        distance=0.1,
        effective=900.0,
        split_deviation=np.nan,
        notes=("one, note",),
    )


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_samples_read_back_to_the_same_bits_and_as_by_the_first_schema(suffix: str, tmp_path: Path) -> None:
    written = drawn()
    path = written.save(tmp_path / f"samples{suffix}")
    same(load_posterior(path), written)
    same(load_posterior(SAMPLES / f"samples{suffix}"), drawn(12))
    first = path.read_bytes()
    with pytest.raises(excite.InputError, match="already there; `replace`"):
        written.save(path)
    written.save(path, replace=True)
    assert path.read_bytes() == first


def test_other_files_are_refused(tmp_path: Path) -> None:
    with np.load(drawn().save(tmp_path / "whole.npz")) as file:
        arrays = dict(file)
    other_schema = {"facts": np.array(json.dumps({"schema": "excite.other/1"}))}
    for name, content, message in (
        ("nowhere.npz", None, "cannot read .*nowhere.npz"),
        ("samples.txt", None, "read from .npz or .csv, given .*samples.txt"),
        ("samples.csv", "", "holds no samples"),
        ("samples.csv", "m1,m2\n1,2\n", "no facts in its first line"),
        ("none.npz", {key: value for key, value in arrays.items() if key != "values"}, "holds no samples"),
        ("few.npz", {**arrays, "values": arrays["values"][:, :2]}, "arrays of other sizes"),
        ("other.npz", {**arrays, **other_schema}, "holds no samples"),
    ):
        if isinstance(content, str):
            (tmp_path / name).write_text(content)
        elif content is not None:
            np.savez(tmp_path / name, **content)
        with pytest.raises(excite.InputError, match=message):
            load_posterior(tmp_path / name)


def test_a_range_leaves_as_many_samples_below_as_above() -> None:
    many = replace(drawn(10_001), values=np.arange(10_001.0)[:, None] * [1.0, 2.0, 3.0])
    for one, size in zip(many.ranges(0.9), (1.0, 2.0, 3.0), strict=False):
        assert (one.low, one.high) == pytest.approx((500.0 * size, 9500.0 * size))


def test_ranges_read_back_by_another_yaml_reader() -> None:
    text = ranges_text(drawn(), 0.99, ("a comment",))
    content = yaml.safe_load(text)
    assert content["level"] == 0.99
    assert content["robot"] == drawn().robot
    for one in drawn().ranges(0.99):
        stated = content["parameters"][one.name]
        assert stated["unit"] == one.unit
        for name in ("low", "high", "mean", "deviation"):
            assert stated[name] == getattr(one, name)
