"""Results that cannot be right: what is doubted, which cause is named, and what is not doubted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from observed import observations_of, robot_model
from pinocchio_chains import chain_model
from played import EXACT, TASK, found, noisy, periodic, played, three_joints
from recordings import REAL, ROOT, real_log
from written_files import saved

import excite
from excite.identification.doubts import answers, expected_error, few_data, known_text, other_motion, unknown_texts
from excite.identification.equations import measured_regressor
from excite.identification.estimator import hide_parameters
from excite.identification.identify import identify
from excite.identification.impossible_parameters import (
    allowed_poses,
    beyond_plausible,
    cause_of_negative_inertia,
    impossible_parameters,
    mass_matrix_regressor,
    signs_of_bodies,
)
from excite.identification.large_residual import (
    cause_of_residual,
    large_residual,
    left_out_rows,
    missing_terms,
    noisy_derivatives,
)
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.models.nominal import parameter_values, standard_values
from regressors.readers.library import built_in
from regressors.robot.inertia import from_pseudo_inertia

NOISY = ("mostly noise", "`cutoff=5`")


# ---------------------------------------------------------------- what is right is not doubted


@pytest.mark.parametrize("described", [True, False])
@pytest.mark.parametrize(("widened", "of_value", "hidden"), [(99, 0.9, []), (101, 0.9, ["F1v"]), (101, 1.1, [])])
def test_no_value_where_the_interval_reaches_zero_and_is_far_too_wide(
    widened: float, of_value: float, hidden: list[str], described: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = found(TASK, noisy(played(three_joints(), 3, seconds=4.0), 0.3, 1e-5, 1))
    (part,), estimate, j = result.prepared, result.estimate, result.names.index("F1v")
    torque = np.sqrt(np.mean(result.observations.y.reshape(-1, 3) ** 2, axis=0))
    speed = np.sqrt(np.mean(part.samples.dq**2, axis=0))
    assert speed[0] < speed.max()
    size = 0.01 * torque[0] / speed.max()
    if described:
        size = max(size, standard_values(built_in("irp6"))["F1v"])
    else:
        monkeypatch.setattr("excite.identification.impossible_parameters.standard_values", lambda _: {})
    values, covariance = estimate.values.copy(), estimate.covariance.copy()
    values[j] = of_value * widened * size
    covariance[j] = covariance[:, j] = 0.0
    covariance[j, j] = (widened * size / estimate.half_width[j] * estimate.deviation[j]) ** 2
    wide = replace(estimate, values=values, covariance=covariance)
    too_wide = beyond_plausible(result.target, wide, part.samples, torque)
    shown = hide_parameters(wide, too_wide)
    assert list(shown.unseen) == hidden
    assert bool(np.isnan(shown.values[j])) == bool(hidden)
    np.testing.assert_array_equal(shown.coefficients, estimate.coefficients)
    assert [note for note in shown.notes if "not shown" in note] == [f"not shown by these logs: {n}" for n in hidden]


def test_neither_a_good_result_nor_noise_of_the_torques_is_doubted() -> None:
    result = found(TASK, noisy(played(three_joints(), 3, seconds=4.0), 0.3, 1e-5, 1), recipe=Recipe())
    assert (result.doubts, result.warnings) == ((), ())
    result = found(TASK, noisy(played(three_joints(), 3, seconds=8.0), 60.0, 0.0, 1), recipe=EXACT)
    residual = np.linalg.norm(result.estimate.residual(result.observations)) / np.linalg.norm(result.observations.y)
    assert residual > 0.5
    assert not any("residual" in doubt.what for doubt in result.doubts)


def test_offsets_that_may_be_zero_are_no_parameters_that_are_missing() -> None:
    log = noisy(played(three_joints(), 3, seconds=4.0), 1e-3, 1e-6, 3)
    result = found(Task("irp6", offset=True), log, recipe=EXACT)
    assert {"F1o", "F2o", "F3o"} < set(result.names)
    assert known_text(result) == "all 13 (offsets aside) are known to 5 %"
    assert not any("F1o" in text for text in answers(result))
    plain = found(TASK, log, recipe=EXACT)
    assert known_text(plain) == "all 13 are known to 5 %"
    for left, end in ((1, "12 of 13 are known to 5 %, 1 is not"), (2, "11 of 13 are known to 5 %, 2 are not")):
        values = np.where(np.arange(13) < left, 0.0, plain.estimate.values)
        held = replace(plain, estimate=replace(plain.estimate, values=values))
        assert known_text(held) == end
        assert list(unknown_texts(held)) == [f"may be zero, as far as these logs show: {', '.join(held.names[:left])}"]


def test_friction_whose_parts_make_up_for_each_other_is_known_as_a_whole(tmp_path: Path) -> None:
    plain = found(TASK, noisy(played(three_joints(), 3, seconds=4.0), 0.3, 1e-5, 1))
    speed, estimate = plain.prepared[0].samples.dq[:, 0], plain.estimate
    parts = [estimate.names.index(name) for name in ("F1c", "F1v")]
    coulomb = estimate.values[parts[0]]
    viscous = coulomb / np.sqrt(np.mean(speed**2))
    values, traded = estimate.values.copy(), np.zeros(13)
    values[parts], traded[parts] = (coulomb, viscous), (1.1 * coulomb, -1.1 * viscous)
    covariance = estimate.covariance + np.outer(traded, traded)
    wide = replace(plain, estimate=replace(estimate, values=values, fit=None, covariance=covariance))
    draws = np.random.default_rng(0).multivariate_normal(
        [coulomb, viscous], wide.estimate.covariance[parts][:, parts], 4000
    )
    torques = draws @ np.array([np.sign(speed), speed])
    spread = np.sqrt(np.mean(np.var(torques, axis=0)) / np.mean((coulomb * np.sign(speed) + viscous * speed) ** 2))
    assert wide.facts.friction_of_drives["F1c + F1v"] == pytest.approx(2.58 * spread, rel=0.04)
    (text,) = unknown_texts(wide)
    assert text.startswith("parts of friction may be zero, but not as a whole over speed, which is known: F1c + F1v ")
    assert list(unknown_texts(excite.load(saved(tmp_path, wide)))) == [text]
    hidden = replace(plain, estimate=hide_parameters(estimate, np.arange(13) == parts[1]))
    assert "F1c + F1v" not in hidden.facts.friction_of_drives


@pytest.mark.slow
def test_a_long_log_of_a_real_arm_has_none() -> None:
    result = identify("ur10e", real_log("ur-20_02_10-30sec_12harm"), joint_rotors=True, offset=True)
    assert (result.doubts, result.warnings) == ((), ())


@pytest.mark.slow
def test_a_short_log_of_a_real_arm_is_too_little() -> None:
    folder, mapping = REAL.parent / "kr300", ROOT / "benchmarks" / "real" / "kr300.yaml"
    if not folder.exists():
        pytest.skip("recorded logs are not beside the repository")
    options = {"mapping": mapping, "joint_rotors": True, "offset": True}
    plain = identify(str(folder / "kr300.urdf"), folder / "A.csv", estimator="weighted", **options)
    assert plain.doubts == ()
    assert [warning.about for warning in plain.warnings] == ["inertia"]
    assert answers(plain)[0].startswith("bodies: the data leave open whether a possible robot has these parameters")
    default = identify(str(folder / "kr300.urdf"), folder / "A.csv", mapping=mapping)
    assert default.doubts == ()
    (warning,) = default.warnings
    assert "this log is too little" in warning.text
    assert "of the same length, ranges and speeds" in warning.text


# ---------------------------------------------------------------- the mass matrix


def test_the_mass_matrix_is_pinocchios() -> None:
    robot = built_in("ur10e")
    target, model = target_of(robot, Task("ur10e")), chain_model(robot)
    data = model.createData()
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6))
    known = {column.name: 0.0 for column in target.model.columns} | standard_values(robot)
    K = mass_matrix_regressor(target, q)
    for pose, ours in zip(q, K @ parameter_values(target.model, target.base, known), strict=True):
        theirs = np.triu(pin.crba(model, data, pose))
        np.testing.assert_allclose(ours, theirs + np.triu(theirs, 1).T, atol=1e-10)


def test_an_inertia_that_no_robot_has_is_doubted() -> None:
    result = found(TASK, played(three_joints(), 3), recipe=EXACT)
    assert result.doubts == ()
    fit = result.coefficients.copy()
    fit[result.names.index("X1")] = -1.0  # its inertia about the first axis
    broken = replace(result, estimate=replace(result.estimate, values=fit, fit=fit))
    (doubt,) = (doubt for doubt in broken.doubts if "the mass matrix is not positive definite" in doubt.what)
    assert "the inertia along q1 is" in doubt.what


def test_its_cause_is_what_the_data_say() -> None:
    for half_width, method, noise, cause, cure in (
        (0.3, "weighted", None, "the data determine it only to +- 0.3", "`estimator='physical'`, or add a second log"),
        (np.inf, "weighted", None, "the data do not determine it", "`estimator='physical'`"),
        (0.3, "physical", None, "the data determine it only to +- 0.3", "add a second log or play a designed motion"),
        (0.05, "weighted", None, "beyond its 99 % interval", "check the units, the signs"),
        (0.05, "weighted", NOISY, "mostly noise", "`cutoff=5`"),
    ):
        told = cause_of_negative_inertia(-0.1, half_width, method, noise)
        assert cause in told[0]
        assert cure in told[1]


def test_poses_are_within_the_limits_and_reach_them() -> None:
    robot = built_in("panda")
    q = allowed_poses(robot, np.zeros((2, 7)))
    assert np.all((q >= robot.limits.lower - 1e-12) & (q <= robot.limits.upper + 1e-12))
    np.testing.assert_allclose(q.min(axis=0), robot.limits.lower)
    np.testing.assert_array_equal(q, allowed_poses(robot, np.zeros((2, 7))))


# ---------------------------------------------------------------- parameters


def test_signs_are_those_of_random_bodies() -> None:
    _, base, known = robot_model("ur10e")
    sign = signs_of_bodies(base)
    assert {name for name, s in zip(base.names, sign, strict=True) if s} >= {"I1zz", "F1c", "F1v"}
    rng = np.random.default_rng(0)
    owners = {column.owner for column in base.columns if column.kind == "mass"}
    for _ in range(50):
        values = dict(known)
        for owner in owners:
            A = rng.normal(size=(4, 4)) * rng.uniform(0.1, 2.0, (4, 1))
            names = [c.name for c in base.columns if c.owner == owner and c.kind in ("mass", "first moment", "inertia")]
            values |= dict(zip(names, from_pseudo_inertia(A @ A.T).tolist(), strict=True))
        beta = base.D @ np.array([values[column.name] for column in base.columns])
        assert np.all(sign * beta >= -1e-9)


def test_a_wrong_sign_of_friction_is_doubted() -> None:
    log = played(three_joints(), 3)
    braked = replace(log, effort=log.effort - 80.0 * np.sign(log.dq) * np.array([1.0, 0.0, 0.0]))
    result = found(TASK, noisy(braked, 0.1, 0.0, 1), recipe=EXACT)
    (doubt,) = result.doubts
    assert "the torques of q1 have the opposite sign" in doubt.what
    doubt = impossible_parameters(result.estimate, result.target.base, np.ones(len(result.names)), None)
    assert "no body and no drive has" in doubt.what
    assert "F1c" in doubt.what
    assert "wrong sign" in doubt.cause


# ---------------------------------------------------------------- rows


def test_too_many_rows_left_out_are_doubted() -> None:
    assert left_out_rows("LOG", 0.0) is left_out_rows("LOG", 0.05) is None
    for share in (0.051, 1.0):
        assert "of the exciting rows of LOG are left out, more than 5 %" in left_out_rows("LOG", share).what


# ---------------------------------------------------------------- the residual


def test_terms_that_a_model_lacks_are_found() -> None:
    t = np.arange(1000) / 100.0
    v, a = np.sin(t)[:, None], np.cos(t)[:, None]
    shares, per_joint = missing_terms(np.hstack([3 * np.sign(v), 0.1 * a]), np.hstack([v, v]), np.hstack([a, a]))
    assert shares["friction"] > 0.95
    assert shares["rotor"] < 0.05
    assert per_joint[0] > 100 * per_joint[1]


def test_noise_of_derivatives_is_found() -> None:
    time, fast = np.arange(1000) / 100.0, np.random.default_rng(0).normal(size=1000)
    slow, W = np.sin(2 * np.pi * time), np.ones((1000, 1))
    assert noisy_derivatives(observations_of(W, slow + 0.1 * fast), slow, 5.0) is None
    cause, cure = noisy_derivatives(observations_of(W, slow), slow + fast, 5.0)
    assert "mostly noise above 5 Hz" in cause
    assert "`cutoff=5`" in cure


TERMS = {"friction": 0.8, "rotor": 0.1, "offset": 0.0}


def test_the_cause_that_explains_most_is_named() -> None:
    for shares, without_curve, cause, cure in (
        ({**TERMS, "friction": 0.5}, [], "no single cause", "check in the mapping the units"),
        (TERMS, [], "friction of q1 explains 80 %", "`friction=True`"),
        (TERMS, ["z3"], "there is no friction curve for z3", "fit curves for these drives too"),
        ({**TERMS, "rotor": 0.9}, [], "an inertia of its own of q1", "`joint_rotors=True`"),
    ):
        known = cause_of_residual(shares, np.array([0.9, 0.0]), ["q1", "q2"], without_curve)
        doubt = large_residual(0.5, 0.0, known)
        assert "the residual is 50 % of what was measured, more than 30 %" in doubt.what
        assert cause in doubt.cause
        assert cure in doubt.cure
    for relative, noise, doubted in ((0.29, 0.0, False), (0.6, 0.55, False), (0.6, 0.4, True)):  # what is no noise
        assert (large_residual(relative, noise, ("", "")) is not None) is doubted


# ---------------------------------------------------------------- what one log determines


def test_the_expected_error_is_that_of_repeated_experiments() -> None:
    clean = found(TASK, played(three_joints(), 3), recipe=EXACT)
    rng = np.random.default_rng(5)
    motion = clean.prepared[0].samples
    rows = np.vstack([measured_regressor(clean.target, other_motion(motion, rng)) for _ in range(20)])
    squares, expected = [], []
    W, y = clean.observations.W, clean.observations.y
    for k in range(40):
        noisy_log = replace(clean.observations, y=y + rng.normal(0.0, 20.0, y.size))
        fit = np.linalg.lstsq(W, noisy_log.y, rcond=None)[0]
        squares.append(np.mean((rows @ (fit - clean.coefficients)) ** 2))
        if k % 4 == 0:
            estimate = replace(clean.estimate, values=fit, fit=fit)
            expected.append(expected_error(clean.target, noisy_log, estimate, motion)[0])
    measured = np.sqrt(np.mean(squares) / np.mean((rows @ clean.coefficients) ** 2))
    assert np.mean(expected) == pytest.approx(measured, rel=0.2)


def test_other_motions_stay_within_the_ranges() -> None:
    samples = played(three_joints(), 3)
    motion = found(TASK, samples, recipe=EXACT).prepared[0].samples
    for seed in range(5):
        other = other_motion(motion, np.random.default_rng(seed))
        assert np.all(other.q >= motion.q.min(axis=0) - 1e-9)
        assert np.all(other.q <= motion.q.max(axis=0) + 1e-9)
        for name in ("dq", "ddq"):
            size, given = (np.sqrt(np.mean(getattr(s, name) ** 2, axis=0)) for s in (other, motion))
            assert np.all(size <= given * (1 + 1e-9))


def test_a_joint_that_rests_is_why_a_log_is_too_little() -> None:
    log = noisy(played(periodic(np.eye(5)[:2], 1), 3, seconds=4.0), 0.3, 1e-5, 1)
    result = found(TASK, log, recipe=Recipe())
    said = [doubt.text for doubt in (*result.doubts, *result.warnings)]
    assert [text for text in said if text.startswith("q3 rests in all logs")]
    assert not any("too little" in text for text in said)


def test_one_log_that_is_too_little_is_said() -> None:
    for logs, designed, method, parts in (
        (0.09, 0.01, "weighted", ()),
        (0.19, 0.04, "weighted", ("19 % of the torque", "leaves 4 % instead of 19 %", "real bodies")),
        (0.19, 0.18, "physical", ("bodies are possible", "add a log of another motion")),
        (0.19, None, "weighted", ("errors of the model come on top of that", "add a log of another motion")),
    ):
        warning = few_data(1, logs, designed, method)
        assert (warning is not None) is bool(parts)
        assert warning is None or all(part in warning.text for part in parts)
    assert few_data(1, 0.05, 0.04, "physical", excess=0.09) is None
    warning = few_data(2, 0.05, 0.03, "physical", excess=0.2)
    assert "these 2 logs are too little" in warning.text
    assert "worse by 20 % of the torque" in warning.text
