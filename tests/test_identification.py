"""The whole way from logs to parameters, on motions whose torques Pinocchio and hand arithmetic made."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_chains import chain_model, inertia
from played import EXACT, LOAD, PERIOD, curves, found, irp6, noisy, periodic, played, three_joints

from excite.files.result_json import Reference, read_result, result_content
from excite.identify.choice import chosen_estimator
from excite.identify.commanded import commanded, instruments
from excite.identify.equations import equations_of
from excite.identify.identification import Identification, condition_number, identified
from excite.identify.payload import NAMES, load_regressor
from excite.identify.prediction import instant_subject, prediction, relative_error
from excite.identify.preparation import Prepared, chosen_method, prepared
from excite.identify.recipe import Recipe
from excite.identify.reference import reference_of
from excite.identify.regressor import friction_drives, measured_regressor
from excite.identify.turning import Turning, best_turning
from excite.logs.log import Log
from excite.logs.sidecar import write_sidecar
from excite.montecarlo import estimators as batch
from excite.names import REPEATABLE
from excite.signals.fourier_fit import FourierFit
from excite.subject import subject_of
from excite.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.fourier import FourierFamily
from regressors.errors import InputError
from regressors.friction import FrictionCurves
from regressors.friction_curves import CoulombViscous
from regressors.library import built_in
from regressors.parameters import standard_values
from regressors.samples import Array, Samples

TASK = Task("irp6")
# [KD96]'s thirteen, from the numbers of the description: the arithmetic of its Table, written out
GEARED = {1: 7.658e-05 * 158.0**2, 2: 7.658e-05 * 167.5**2, 3: 7.658e-05 * 167.5**2}


def described(result: Identification) -> Array:
    return reference_of(result, [Path("nothing.csv")] * len(result.prepared)).values


def mixed(*rows: Array) -> Array:
    """Directions of motion of the first three joints, as directions of all five."""
    return np.column_stack([np.array(rows), np.zeros((len(rows), 2))])


@pytest.fixture(scope="module")
def log() -> Log:
    return played(three_joints(), 3)


@pytest.fixture(scope="module")
def noise() -> Log:
    return noisy(played(three_joints(), 3, seconds=4.005), 0.5, 1e-5, 1)


# ---------------------------------------------------------------- noise-free data give the truth back


def test_the_differential_model_gives_the_truth_back(log: Log) -> None:
    result = found(TASK, log)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-10)
    assert result.recipe.sign_width == result.recipe.breakaway == 0.0
    assert dict(zip(result.estimate.names, result.estimate.values, strict=True))["F2c"] == pytest.approx(28.75)
    np.testing.assert_allclose(described(result)[:7].sum(), result.estimate.values[:7].sum(), rtol=1e-10)


def test_the_truth_is_the_arithmetic_of_the_description(log: Log) -> None:
    known = standard_values(built_in("irp6"))
    truth = dict(zip((result := found(TASK, log)).estimate.names, described(result), strict=True))
    held = known["m4"] + known["m5"]  # at the tip of the forearm, to which the wrist is fixed
    assert (truth["F1c"], truth["F3v"]) == (28.0, 26.0)
    # rotors are in the diagonal terms, and a mass that is held far out makes them larger
    assert truth["X4"] > known["I3zz"] + GEARED[3]
    assert truth["X4"] < known["I3zz"] + GEARED[3] + 2.0 * held
    assert truth["X3"] - truth["X4"] == pytest.approx(
        known["I2zz"] + GEARED[2] + 0.455**2 * (known["m3"] + held), rel=1e-9
    )


@pytest.mark.parametrize("window", ["short", "long"])
@pytest.mark.parametrize(("friction", "tolerance"), [(None, 2e-4), (FrictionCurves(curves()), 2e-7)])
def test_the_energy_model_gives_the_truth_back(window: str, friction: FrictionCurves | None, tolerance: float) -> None:
    # with friction in it, power jumps between two samples
    result = found(Task("irp6", model="energy", window=window), played(three_joints(), 3, 1000.0), friction=friction)
    truth = described(result)
    np.testing.assert_allclose(result.estimate.values, truth, atol=tolerance * np.abs(truth).max())
    assert len(truth) == (13 if friction is None else 7)


@pytest.mark.parametrize(
    ("task", "tolerance"),
    [
        (Task("irp6", model="load"), 1e-12),
        (Task("irp6", model="load-integral", window="long"), 1e-8),
        (Task("irp6", model="load-integral", window_length=0.01), 1e-8),
        (Task("irp6", model="load", equations=("fx", "fy", "fz", "ny", "nz")), 1e-11),
    ],
)
def test_a_load_is_given_back(task: Task, tolerance: float) -> None:
    result = found(task, played(periodic(np.eye(5), 3), 5, 500.0, load=LOAD))
    np.testing.assert_allclose(result.estimate.values, LOAD, atol=tolerance)


@pytest.mark.parametrize(
    ("chosen", "directions", "names"),
    [
        ({"drives": ("2",)}, mixed([0.0, 1.0, -1.0]), ("X3", "X7", "F2c", "F2v")),
        (
            {"joints": ("1", "3")},
            mixed([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
            ("X1", "X4", "X5", "X6", "F1c", "F3c", "F1v", "F3v"),
        ),
    ],
)
def test_partial_motions_give_their_part_of_the_truth_back(
    chosen: dict[str, tuple[str, ...]], directions: Array, names: tuple[str, ...]
) -> None:
    result = found(Task("irp6", **chosen), played(periodic(directions, 2), 3))
    assert result.estimate.names == names
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-9)


def test_subtracted_friction_leaves_the_inertial_parameters(log: Log) -> None:
    result = found(TASK, log, friction=FrictionCurves(curves()))
    assert result.estimate.names == tuple(f"X{k}" for k in range(1, 8))
    whole = found(TASK, log)
    np.testing.assert_allclose(result.estimate.values, whole.estimate.values[:7], rtol=1e-10)


def test_drives_without_a_curve_are_told(log: Log) -> None:
    result = found(TASK, log, friction=FrictionCurves({"z1": CoulombViscous(28.0, 25.0)}))
    assert "no friction curve of z2, z3: taken to have no friction" in result.prepared[0].notes
    assert result_content(result)["relative_error"] > 0.5


def test_a_common_low_pass_leaves_the_truth_where_it_is() -> None:
    log = played(three_joints(), 3, 500.0, 6.0)
    whole, filtered = (found(TASK, log, recipe=replace(EXACT, low_pass=hz)) for hz in (None, 4.0))
    assert len(filtered.observations.y) < len(whole.observations.y) / 10
    np.testing.assert_allclose(filtered.estimate.values, whole.estimate.values, rtol=1e-9)


@pytest.mark.parametrize("estimator", ["huber", "least-squares", "physical", "recursive", "total", "weighted"])
def test_every_estimator_finds_it(log: Log, estimator: str) -> None:
    recipe = replace(EXACT, estimator=estimator)
    known = standard_values(irp6())
    result = identified(irp6(), TASK, [log], recipe, chosen_estimator(estimator, known=known))
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=2e-4)


# ---------------------------------------------------------------- laws


def test_rows_of_a_log_are_a_shorter_log(noise: Log) -> None:
    recipe = Recipe(rows="101:500")
    cut = replace(noise.rows(slice(100, 500)), source="cut")
    of_rows = found(TASK, noise, recipe=recipe)
    of_cut = found(TASK, cut, recipe=replace(recipe, rows="all"))
    np.testing.assert_array_equal(of_rows.estimate.values, of_cut.estimate.values)


def test_two_logs_are_their_equations_together(noise: Log) -> None:
    recipe = Recipe(rows="all", estimator="least-squares", sign_width=0.0)
    parts = [replace(noise.rows(part), source=f"log{k}") for k, part in enumerate((slice(0, 420), slice(420, 800)))]
    both = found(TASK, *parts, recipe=recipe)
    alone = [found(TASK, part, recipe=recipe).observations for part in parts]
    W, y = (np.concatenate([getattr(o, name) for o in alone]) for name in ("W", "y"))
    np.testing.assert_allclose(both.estimate.values, np.linalg.solve(W.T @ W, W.T @ y), rtol=1e-9)
    assert both.observations.logs == ("log0", "log1")


def test_torques_in_other_units_scale_the_estimate(noise: Log) -> None:
    recipe = Recipe(rows="all", sign_width=0.0)
    assert noise.effort is not None
    once, doubled = (found(TASK, replace(noise, effort=k * noise.effort), recipe=recipe) for k in (1.0, 2.0))
    np.testing.assert_allclose(doubled.estimate.values, 2.0 * once.estimate.values, rtol=1e-10)
    np.testing.assert_allclose(doubled.estimate.deviation, 2.0 * once.estimate.deviation, rtol=1e-6)


def test_averaged_periods_are_as_one_quieter_period(noise: Log) -> None:
    result = found(TASK, noise, recipe=Recipe(rows="all", average=True, signals="fourier"))
    assert result.prepared[0].samples.time.size == round(200.0 * PERIOD)
    assert any("mean of 2 periods of 2 s (estimated)" in note for note in result.prepared[0].notes)
    whole = found(TASK, noise, recipe=replace(EXACT, sign_width=0.0))
    np.testing.assert_allclose(result.estimate.values, whole.estimate.values, rtol=0.05)


def test_a_series_settles_its_period_and_its_harmonics(noise: Log) -> None:
    for period in (None, PERIOD):
        settled = chosen_method(Recipe(signals="fourier", period=period)).settled(noise.time, noise.q)
        assert isinstance(settled, FourierFit)
        assert settled.period == pytest.approx(PERIOD, rel=1e-4)
        assert settled.harmonics == 3


def test_intervals_hold_the_truth(noise: Log) -> None:
    result = found(TASK, noise, recipe=Recipe(rows="all"))
    truth = described(result)
    assert np.all((result.estimate.interval[:, 0] < truth) & (truth < result.estimate.interval[:, 1]))
    assert np.all(result.estimate.deviation < 0.05 * np.abs(truth).max())


def test_condition_number_is_that_of_the_stacked_equations(log: Log) -> None:
    result = found(TASK, log)
    assert result.condition_number == pytest.approx(np.linalg.cond(result.observations.W), rel=1e-9)
    W = result.observations.W.copy()
    W[:, 3] = W[:, 0] - 2.0 * W[:, 1]
    assert condition_number(replace(result.observations, W=W)) == np.inf
    W[:, 3] = 0.0
    assert condition_number(replace(result.observations, W=W)) == np.inf


def test_equations_hold_for_the_truth_row_by_row(log: Log) -> None:
    subject = subject_of(irp6(), TASK)
    part = prepared(log, irp6(), subject, EXACT)
    equations = equations_of(subject, part, EXACT)
    beta = found(TASK, log).estimate.values
    np.testing.assert_allclose(equations.W @ beta, equations.y, atol=1e-9)
    np.testing.assert_array_equal(equations.y.reshape(-1, 3), log.effort)
    np.testing.assert_array_equal(equations.time[::3], log.time)
    np.testing.assert_array_equal(equations.equation[:6], [0, 1, 2, 0, 1, 2])


# ---------------------------------------------------------------- friction that turns


def turned(log: Log, direction: Array) -> Log:
    """The log with friction whose direction is not the sign of the velocity."""
    C = irp6().transmission.coupling[:3, :3]
    coulomb = np.array([28.0, 28.75, 30.0])
    assert log.effort is not None
    assert log.dq is not None
    extra = (coulomb * (direction - np.sign(log.dq @ C.T))) @ C
    return replace(log, effort=log.effort + extra)


def test_a_planted_width_is_found(log: Log) -> None:
    assert log.dq is not None
    z = log.dq @ irp6().transmission.coupling[:3, :3].T
    result = found(TASK, turned(log, np.tanh(z / 0.02)))
    assert result.recipe.sign_width == pytest.approx(0.02, rel=0.1)
    assert result.recipe.breakaway == 0.0
    assert any("turns over 0.0" in note and "rad/s" in note for note in result.estimate.notes)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


def test_a_planted_distance_is_found(log: Log) -> None:
    # Dahl's equation by small steps of Euler along a fine path
    motion, fine = three_joints(), 200
    time = np.arange(400 * fine + 1) / (200.0 * fine)
    z = motion.at(time, 0)[:, :3] @ irp6().transmission.coupling[:3, :3].T
    s, kept, d = np.zeros(3), [], 0.001
    for way in np.diff(z, axis=0, prepend=z[:1]):
        s = s + way * (1.0 - s * np.sign(way)) / d
        kept.append(s)
    result = found(TASK, turned(log, np.array(kept)[:-1:fine]))
    assert result.recipe.breakaway == pytest.approx(0.001, rel=0.1)
    assert result.recipe.sign_width == 0.0
    assert any("of travel, and keeps at standstill" in note for note in result.estimate.notes)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


def test_a_turning_that_is_given_is_taken(log: Log) -> None:
    given = found(TASK, log, recipe=replace(EXACT, sign_width=0.3))
    assert (given.recipe.sign_width, given.recipe.breakaway) == (0.3, 0.0)
    given = found(TASK, log, recipe=replace(EXACT, breakaway=0.01))
    assert (given.recipe.sign_width, given.recipe.breakaway) == (0.0, 0.01)


def test_models_without_friction_turn_nothing(log: Log) -> None:
    for task in (replace(TASK, friction=False), replace(TASK, model="energy")):
        subject = subject_of(irp6(), task)
        part = prepared(log, irp6(), subject, EXACT)
        assert best_turning(subject, [(part.samples, equations_of(subject, part, EXACT))]) == Turning()


@pytest.mark.parametrize("task", [TASK, Task("irp6", joints=("1", "3")), Task("irp6", drives=("2", "3"))])
def test_friction_columns_are_directions_spread_by_the_coupling(task: Task) -> None:
    subject = subject_of(irp6(), task)
    model, n = subject.model, subject.robot.n
    rng = np.random.default_rng(4)
    time, shape = np.arange(50) / 100.0, (50, len(subject.motion.labels))
    moved = [rng.normal(size=shape) @ subject.motion.matrix.T for _ in range(4)]
    samples = Samples(time, *moved)
    columns, z, rows = friction_drives(subject, samples)
    C = irp6().transmission.coupling[:n, :n]
    which = [int(subject.base.names[k][1:-1]) - 1 for k in columns]
    np.testing.assert_allclose(z, samples.q @ C[which].T, atol=1e-12)
    W = measured_regressor(subject, samples).reshape(50, -1, subject.base.rank)
    signs = np.sign(samples.dq @ C[which].T)
    for k, column in enumerate(columns):
        np.testing.assert_allclose(W[:, :, column], signs[:, [k]] * rows[k], atol=1e-12)
    assert len(model.row_labels) == rows.shape[1]


# ---------------------------------------------------------------- a load seen by the joints


@pytest.mark.parametrize("name", ["irp6", "panda"])
def test_the_load_regressor_is_what_the_load_adds_to_the_torques(name: str) -> None:
    robot = built_in(name)
    rng = np.random.default_rng(5)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 7, robot.n))
    K = load_regressor(robot, Samples(np.arange(7.0), q, dq, ddq, np.zeros_like(q)))
    bare, loaded = chain_model(robot), chain_model(robot)
    loaded.appendBodyToJoint(loaded.njoints - 1, inertia(LOAD), pin.SE3.Identity())
    extra = [
        pin.rnea(loaded, loaded.createData(), *x) - pin.rnea(bare, bare.createData(), *x)
        for x in zip(q, dq, ddq, strict=True)
    ]
    np.testing.assert_allclose((K @ LOAD).reshape(-1, robot.n), extra, atol=1e-11)
    assert NAMES[:2] == ("load.m", "load.mcx")
    assert len(NAMES) == K.shape[1]


# ---------------------------------------------------------------- what was commanded


def commanded_motion() -> Trajectory:
    return Trajectory(FourierFamily(PERIOD, 3), 0.3 * np.random.default_rng(7).normal(size=(3, 5)))


def follower(delay: float, noise: float = 0.0) -> Prepared:
    """A log that plays a design so much later, and does not start at time zero."""
    time = 5.0 + np.arange(500) / 200.0
    samples = commanded_motion().samples(np.mod(time - delay, PERIOD))
    q = samples.q + noise * np.random.default_rng(8).normal(size=samples.q.shape)
    return Prepared(Log("LOG", "", ("q1", "q2", "q3"), time, q), replace(samples, time=time, q=q), q, ())


@pytest.mark.parametrize("delay", [0.0, 0.137, -0.4, 5.93])
def test_the_commanded_motion_is_found_whenever_it_began(delay: float) -> None:
    part = follower(delay, noise=1e-4)
    motion = commanded(commanded_motion(), part)
    exact = follower(delay).samples
    np.testing.assert_allclose(motion.q, exact.q, atol=2e-5)
    np.testing.assert_allclose(motion.ddq, exact.ddq, atol=2e-3)
    np.testing.assert_array_equal(motion.time, part.samples.time)


def test_another_motion_is_not_taken_for_the_commanded_one() -> None:
    part = follower(0.0)
    other = Trajectory(FourierFamily(PERIOD, 3), 0.3 * np.random.default_rng(9).normal(size=(3, 5)))
    with pytest.raises(InputError, match=r"^LOG does not follow the design's motion: it strays from it by \d+ %"):
        commanded(other, part)


def test_instruments_are_the_regressor_of_the_commanded_motion() -> None:
    subject, part = subject_of(irp6(), TASK), follower(0.2, noise=1e-4)
    Z = instruments(commanded_motion(), subject, (part, part), EXACT)
    W = subject.model.assemble(follower(0.2).samples)[:, subject.base.index]
    assert Z.shape == (2 * len(W), subject.base.rank)
    smooth = [k for k, name in enumerate(subject.base.names) if name.startswith("X")]
    np.testing.assert_allclose(Z[: len(W), smooth], W[:, smooth], atol=0.02)
    np.testing.assert_array_equal(Z[: len(W)], Z[len(W) :])


# ---------------------------------------------------------------- predictions, references, files


def test_the_truth_predicts_what_was_measured(log: Log) -> None:
    result = found(TASK, log)
    subject = instant_subject(irp6(), TASK, result.recipe)
    made = prediction(subject, result.prepared[0], result.recipe, result.estimate.values)
    np.testing.assert_allclose(made.predicted, log.effort, atol=1e-9)
    np.testing.assert_array_equal(made.measured, log.effort)
    np.testing.assert_allclose(made.speed, log.dq, atol=1e-9)
    assert relative_error(made.measured, 0 * made.predicted) == 1.0
    assert relative_error(0 * made.measured, made.predicted) == np.inf


@pytest.mark.parametrize("model", ["energy", "differential"])
def test_known_friction_is_added_to_predictions(log: Log, model: str) -> None:
    task, friction = Task("irp6", model=model), FrictionCurves(curves())
    result = found(task, log, friction=friction)
    subject = instant_subject(irp6(), result.task, result.recipe)
    made = prediction(subject, result.prepared[0], result.recipe, result.estimate.values, friction)
    np.testing.assert_allclose(made.predicted, log.effort, atol=1e-3)
    assert subject.model.row_labels[0] == ("q1", "Nm")


def test_simulated_logs_are_compared_with_their_truth(log: Log, tmp_path: Path) -> None:
    result = found(TASK, log, log)
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    truth = {**standard_values(irp6()), "F1c": 31.0}
    write_sidecar(paths[0], irp6(), truth=truth)
    assert reference_of(result, paths).kind == "description"  # of one of them the truth is not known
    write_sidecar(paths[1], irp6(), truth=truth)
    reference = reference_of(result, paths)
    assert reference.kind == "truth"
    assert reference.values[result.estimate.names.index("F1c")] == 31.0
    write_sidecar(paths[1], irp6(), truth={**truth, "F1c": 32.0})
    assert reference_of(result, paths).kind == "description"
    write_sidecar(paths[1], built_in("panda"), truth=truth)
    with pytest.raises(InputError, match=r"b\.csv is a log of panda \(description \w{12}\), not of irp6 \(\w{12}\)"):
        reference_of(result, paths)


def test_what_nobody_knows_is_no_number() -> None:
    result = found(replace(TASK, offset=True, joints=("1",)), played(periodic(mixed([1.0, 0.0, 0.0]), 2), 3))
    values = dict(zip(result.estimate.names, described(result), strict=True))
    assert values["F1o"] == 0.0
    robot = built_in("panda")
    subject = subject_of(robot, Task("panda"))
    result = replace(result, robot=robot, subject=subject)
    values = dict(zip(subject.base.names, described(result), strict=True))
    assert np.isnan(values["F7c"])


def test_a_result_reads_back_to_the_same_numbers(noise: Log, tmp_path: Path) -> None:
    result = found(TASK, noise, recipe=Recipe(rows="all"))
    values = described(result)
    values[2] = np.nan
    content = result_content(result, reference=Reference("description", values))
    (tmp_path / "result.json").write_text(json.dumps(content, allow_nan=False))
    read = read_result(tmp_path)
    np.testing.assert_array_equal(read.coefficients, result.estimate.coefficients)
    assert (read.names, read.units) == (result.estimate.names, result.estimate.units)
    assert (read.task, read.recipe) == (result.task, result.recipe)
    assert read.robot.sha256() == result.robot.sha256()
    assert read.training == {noise.sha256}
    assert (read.friction, read.content) == (None, json.loads(json.dumps(content)))
    np.testing.assert_array_equal(content["covariance"], result.estimate.covariance)
    assert [p["reference"] for p in content["parameters"]][1:4] == [values[1], None, values[3]]
    assert content["residuals"][0]["rms"] == pytest.approx(np.std(result.observations.y[::3] - (
        result.observations.W @ result.estimate.values)[::3]), rel=0.02)  # fmt: skip
    y, residual = result.observations.y, result.estimate.residual(result.observations)
    assert content["relative_error"] == pytest.approx(np.linalg.norm(residual) / np.linalg.norm(y))
    assert read.training_error == pytest.approx(content["relative_error"], rel=1e-6)  # unfiltered equations
    assert read_result(tmp_path / "result.json").names == read.names


def test_parameters_that_are_not_shown_are_null(tmp_path: Path) -> None:
    # of a motion of the second drive alone the whole model shows combinations only
    result = found(TASK, played(periodic(mixed([0.0, 1.0, -1.0]), 2), 3))
    content = json.loads(json.dumps(result_content(result), allow_nan=False))
    unseen = [p for p in content["parameters"] if not p["seen"]]
    assert {p["name"] for p in unseen} == set(content["unseen"]) >= {"X1", "F1c"}
    assert all(p["value"] is None and np.isfinite(p["fit"]) for p in unseen)
    assert content["condition_number"]["measured"] is None
    assert content["design"] is None
    assert content["friction"] is None


def test_a_filtered_identification_is_judged_on_what_was_recorded(noise: Log) -> None:
    result = found(TASK, noise, recipe=Recipe(rows="all", low_pass=5.0))
    content = result_content(result)
    plain = result_content(found(TASK, noise, recipe=Recipe(rows="all")))
    assert content["relative_error"] < 0.5 * plain["relative_error"]
    assert content["prediction_error"] == pytest.approx(plain["prediction_error"], rel=0.05)


# ---------------------------------------------------------------- bad input

BAD_RECIPES = (
    ({"signals": "magic"}, "no signals named 'magic'; available: butterworth, "),
    ({"estimator": "best"}, "no estimator named 'best'; available: huber, "),
    ({"covariance": "none"}, "no covariance named 'none'; available: auto, white, robust"),
    ({"cutoff": 0.0}, "cutoff must be a positive number, given 0"),
    ({"period": -1.0}, "period must be a positive number, given -1"),
    ({"low_pass": float("nan")}, "low_pass must be a positive number, given nan"),
    ({"sign_width": -0.1}, "sign_width must be zero or a positive number, given -0.1"),
    ({"breakaway": float("inf")}, "breakaway must be zero or a positive number, given inf"),
    ({"sign_width": 0.1, "breakaway": 0.1}, "give sign_width or breakaway, not both"),
    ({"every": 0}, "every must be 1 or more, given 0"),
    ({"rows": "first"}, "rows must be auto, all, or FIRST:LAST such as 100:2000; given 'first'"),
    ({"rows": "1:"}, "rows must be auto, all, or FIRST:LAST such as 100:2000; given '1:'"),
    ({"rows": "0:9"}, "the first must be 1 or more and below the last, given '0:9'"),
    ({"rows": "9:9"}, "the first must be 1 or more and below the last, given '9:9'"),
)


@pytest.mark.parametrize(("given", "message"), BAD_RECIPES)
def test_a_recipe_that_cannot_be_is_refused(given: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as refused:
        Recipe(**given)
    assert message in str(refused.value)


def test_rows_are_counted_from_one() -> None:
    assert Recipe(rows="1:3").stretch(10) == slice(0, 3)
    assert Recipe(rows="all").stretch(10) == slice(0, 10)
    assert Recipe().stretch(10) is None


LATER = (
    (Recipe(rows="1:999"), TASK, "LOG: rows: 1:999 asked for, but the log has 400 rows"),
    (Recipe(rows="1:9"), TASK, "LOG: butterworth needs 16 samples or more, given 9"),
    (replace(EXACT, every=1000), TASK, "LOG: 3 equations are too few for 13 parameters"),
    (Recipe(signals="fourier"), TASK, "LOG: no period: the motion does not repeat itself within 0.99"),
    (Recipe(average=True), TASK, "LOG: no period: the motion does not repeat itself"),
    (Recipe(rows="all", low_pass=101.0), TASK, "the cutoff 101 Hz must be below half the sample rate, 100 Hz"),
    (replace(EXACT, low_pass=5.0), Task("irp6", model="energy"), "low_pass and every are for models of single"),
    (replace(EXACT, breakaway=0.1), Task("irp6", model="energy"), "breakaway is for the differential model"),
    (EXACT, Task("irp6", model="load"), "LOG has the joints q1, q2, q3, but not q4, q5, which the model moves"),
    (EXACT, Task("irp6", joints=("1", "3")), "LOG: joint q2 strays by 0."),
    (EXACT, Task("irp6", drives=("2",)), " from a motion of z2 alone"),
    (EXACT, Task("irp6", joints=("9",)), "no joint named '9'"),
)  # fmt: skip


@pytest.mark.parametrize(("recipe", "task", "message"), LATER)
def test_a_log_that_does_not_fit_is_refused(log: Log, recipe: Recipe, task: Task, message: str) -> None:
    with pytest.raises(InputError) as refused:
        found(task, log, recipe=recipe)
    assert message in str(refused.value)


def test_joints_that_the_model_holds_must_rest_where_it_holds_them() -> None:
    five = played(periodic(np.eye(5), 3), 5)
    with pytest.raises(InputError, match=r"LOG: joint q4 moves by 0\.\d+ rad, but the model holds it; moving joints"):
        found(TASK, five)
    at = played(three_joints(), 5)
    q = at.q.copy()
    q[:, 4] = 0.3
    with pytest.raises(InputError, match=r"LOG: joint q5 rests at 0\.3 rad, but the model holds it at 0 rad"):
        found(TASK, replace(at, q=q))
    assert found(TASK, at).condition_number > 1.0


def test_channels_that_the_model_needs_must_be_there(log: Log) -> None:
    with pytest.raises(InputError, match=r"LOG has no effort: the model needs the columns NAME\.effort"):
        found(TASK, replace(log, effort=None))
    five = played(periodic(np.eye(5), 3), 5)
    with pytest.raises(InputError, match=r"LOG has no wrench: the model needs the columns wrench\.force\.x"):
        found(Task("irp6", model="load"), five)
    loaded = played(periodic(np.eye(5), 3), 5, load=LOAD)
    with pytest.raises(InputError, match="a wrench has no friction in it"):
        found(Task("irp6", model="load"), loaded, friction=FrictionCurves(curves()))


def test_something_must_be_given() -> None:
    with pytest.raises(InputError, match="no logs to identify from"):
        found(TASK)


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("instrumental", {}, "needs the commanded motion: name the design that was played"),
        ("weighted", {"pull": 1.0}, "a pull towards described values is for the estimator physical, not for weighted"),
        ("physical", {"pull": -1.0}, "pull must be zero or a positive number, given -1"),
        ("physical", {"pull": float("nan")}, "pull must be zero or a positive number, given nan"),
        ("magic", {}, "no estimator named 'magic'"),
    ],
)
def test_an_estimator_without_what_it_needs_is_refused(name: str, given: dict[str, float], message: str) -> None:
    with pytest.raises(InputError) as refused:
        chosen_estimator(name, **given)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("recipe", "count", "message"),
    [
        (Recipe(), 1, "repeat must be 2 or more, or 0 for none, given 1"),
        (Recipe(), -3, "repeat must be 2 or more, or 0 for none, given -3"),
        (Recipe(estimator="huber"), 5, "of the estimators instrumental, least-squares, weighted, not of huber"),
        (Recipe(average=True), 5, "not with average"),
        (Recipe(measured_velocity=True), 5, "not with measured_velocity"),
        (Recipe(signals="spline"), 5, "a fixed linear function of positions, not spline"),
    ],
)
def test_what_cannot_be_repeated_is_refused_before_any_work(recipe: Recipe, count: int, message: str) -> None:
    with pytest.raises(InputError) as refused:
        recipe.check_repeatable(count)
    assert message in str(refused.value)


def test_the_estimators_that_can_be_repeated_are_those_in_batches() -> None:
    assert set(REPEATABLE) == set(batch.ESTIMATORS)


def test_repetitions_have_the_noise_of_the_torques_whatever_the_equations_are(noise: Log) -> None:
    pytest.importorskip("jax")
    from excite.identify.repetition import effort_noise, position_noise

    for task, recipe in (
        (TASK, Recipe(rows="all")),
        (TASK, Recipe(rows="all", low_pass=5.0)),
        (Task("irp6", model="energy"), Recipe(rows="all")),
    ):
        result = found(task, noise, recipe=recipe)
        np.testing.assert_allclose(effort_noise(result), 0.5, rtol=0.15)
    np.testing.assert_allclose(position_noise(result), 1e-5, rtol=0.25)
