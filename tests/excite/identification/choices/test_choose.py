"""Choices in an identification: what is planted in a log is found, what is not is left alone, nothing fails."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.signal
from motions import Sines
from played import LOAD, curves, irp6, noisy, periodic, played, three_joints
from recordings import real_log
from refused import refusal
from written_files import saved

import excite
from excite.errors import ConicSolverError
from excite.identification.allowances import delay_columns
from excite.identification.choices import all_choices as choose, scoring as trial
from excite.identification.choices.all_choices import free_settings
from excite.identification.choices.friction_terms import TERM_SETTINGS
from excite.identification.equations import measured_regressor
from excite.identification.estimator import Context
from excite.identification.estimators.physical import Physical
from excite.identification.identification import Identification
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe, Sizes
from excite.identification.result_json import load_result
from excite.logs.log import Log
from excite.registry import CHOSEN
from excite.tasks.model_choice import ModelChoice
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.differential import DifferentialModel
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array, Samples

ALL_OF_TORQUES = ["cutoff", "signals", "terms", "delay", "presliding", "standstill", "estimator"]
OF_ENERGY = ["cutoff", "signals", "terms", "delay", "estimator"]
PLAIN = ("X1", "X2", "X3", "X4", "X5", "X6", "X7", "F1c", "F2c", "F3c", "F1v", "F2v", "F3v")


@cache
def clean(seconds: float = 8.0, rate: float = 200.0, seed: int = 1) -> Log:
    return noisy(played(three_joints(seed), 3, rate, seconds), 0.2, 1e-6, seed)


@cache
def plain() -> Identification:
    """Of the clean log, with every choice."""
    return excite.identify("irp6", clean())


@cache
def late(delay: float, rate: float = 200.0, seconds: float = 8.0) -> Log:
    """The log with torques that were recorded later than the positions."""
    motion = three_joints()
    before = Sines(motion.centre, motion.amplitude, motion.frequency, motion.phase - motion.frequency * delay)
    effort = played(before, 3, rate, seconds).effort
    return noisy(replace(played(motion, 3, rate, seconds), effort=effort), 0.2, 1e-6, 1)


def choice_of(result: Identification, name: str) -> choose.Choice:
    (found,) = [choice for choice in result.choices if choice.name == name]
    return found


# ---------------------------------------------------------------- what is found


def test_a_clean_log_needs_nothing_more() -> None:
    result = plain()
    assert (result.names, result.recipe.delay) == (PLAIN, 0.0)
    assert (result.recipe.sign_width, result.recipe.breakaway) == (0.0, 0.0)
    assert [choice.name for choice in result.choices] == ALL_OF_TORQUES
    assert choice_of(result, "terms").value == ()
    assert len(choice_of(result, "terms").candidates) > 10
    cutoff = choice_of(result, "cutoff")
    assert result.recipe.cutoff == cutoff.value
    assert 5 < cutoff.value < 25  # the motion ends at 1.5 Hz, its friction jumps
    assert not any("chosen" in note for note in result.estimate.notes)


def test_without_choices_an_identification_is_what_it_was() -> None:
    result = excite.identify("irp6", clean(), choose=False)
    before = estimate_parameters(irp6(), Task("irp6"), [clean()])
    assert (result.choices, result.recipe) == ((), before.recipe)
    np.testing.assert_array_equal(result.coefficients, before.coefficients)
    assert "setting to choose" in refusal(excite.identify, "irp6", clean(), choose=("speed",))
    log = clean().of(["q1", "q3"])
    for choose_them in (True, False):
        with pytest.raises(InputError, match="LOG has the joints q1, q3, but not q2, which the model moves; record"):
            excite.identify("irp6", log, choose=choose_them)


@cache
def delayed(delay: float) -> Identification:
    """Of the log with late torques."""
    return excite.identify("irp6", late(delay), choose=("cutoff", "delay"))


@pytest.mark.parametrize("delay", [0.004, pytest.param(-0.003, marks=pytest.mark.slow)])
def test_a_planted_delay_is_found_within_its_interval(delay: float) -> None:
    result, beta = delayed(delay), plain().coefficients
    choice = choice_of(result, "delay")
    assert result.recipe.delay == choice.value
    assert choice.interval[0] < delay < choice.interval[1]
    assert abs(choice.value - delay) < 1e-4
    assert result.recipe.cutoff == pytest.approx(plain().recipe.cutoff, rel=0.5)
    np.testing.assert_allclose(result.coefficients, beta, atol=0.02 * np.abs(beta).max())
    other = excite.verify(result, replace(late(delay), sha256="another"))
    assert other.relative_error < 0.01


OF_EACH = (1e-3, 5e-3, 2.5e-3)


@pytest.mark.parametrize(
    ("delay", "over"), [(0.0, 2e-3), pytest.param(0.01, 2e-3, marks=pytest.mark.slow), (0.0, OF_EACH), (0.01, OF_EACH)]
)
def test_presliding_is_not_taken_for_a_delay_nor_a_delay_for_presliding(delay: float, over: Sizes) -> None:
    """Friction that changes its direction over a distance [rad], alike for all drives or not."""
    effort, told_apart = turned(delay, over), f"presliding {delay} {over}"
    turning = noisy(replace(late(delay), effort=effort, sha256=told_apart), 1.0, 0.0, 2)
    result = excite.identify("irp6", turning, choose=("cutoff", "delay"))
    low, high = choice_of(result, "delay").interval
    assert low < delay < high < low + 5e-3
    assert bool(result.recipe.delay) == bool(delay)
    np.testing.assert_allclose(result.recipe.breakaway, over, rtol=0.03)


def turned(delay: float, over: Sizes) -> Array:
    """Late torques whose friction changes its direction over a distance, shape (N, 3)."""
    motion = three_joints()
    acted = Sines(motion.centre, motion.amplitude, motion.frequency, motion.phase - motion.frequency * delay)
    moved = acted.samples(late(0.0).time)
    samples = Samples(moved.time, *(x[:, :3] for x in (moved.q, moved.dq, moved.ddq, moved.dddq)))
    return (measured_regressor(plain().target, samples, over) @ plain().coefficients).reshape(-1, 3)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_late_joint_shows_beside_presliding_and_correlated_noise(seed: int) -> None:
    """Another presliding goes with each delay, so that coarse delays of joints hardly show at first."""
    effort = np.column_stack([turned(0.012, 2e-3)[:, 0], turned(0.0, 2e-3)[:, 1:]])
    white = np.random.default_rng(seed).normal(size=(len(effort) + 200, 3))
    noise = scipy.signal.lfilter([np.sqrt(0.19)], [1.0, -0.9], white, axis=0)[200:]
    effort += 0.02 * np.sqrt(np.mean(effort**2, axis=0)) * noise
    log = noisy(replace(late(0.0), effort=effort, sha256=f"late joint {seed}"), 0.0, 1e-6, 2)
    choice = choice_of(excite.identify("irp6", log, choose=("cutoff", "delay")), "delay")
    assert choice.value[1:] == (0.0, 0.0)
    assert all(low < x < high < low + 5e-3 for x, (low, high) in zip((0.012, 0.0, 0.0), choice.intervals, strict=True))


def test_delays_of_single_joints_and_logs_are_found_applied_stated_and_read_back(tmp_path: Path) -> None:
    effort = np.column_stack([late(0.0).effort[:, 0], late(0.012).effort[:, 1], late(0.0).effort[:, 2]])
    asked = {"choose": ("delay",), "recipe": Recipe(cutoff=plain().recipe.cutoff)}
    joint = excite.identify("irp6", replace(late(0.0), effort=effort, sha256="joint"), **asked)
    other = replace(noisy(played(three_joints(3), 3, 200.0, 8.0), 0.2, 1e-6, 3), source="B", sha256="B")
    rows = round(0.01 * 200.0)
    other = replace(other.rows(slice(rows, None)), effort=other.effort[:-rows])
    logs = excite.identify("irp6", [late(0.0), other], **asked)
    for result, true, names in ((joint, (0.0, 0.012, 0.0), ("q1", "q2", "q3")), (logs, (0.0, 0.01), ("LOG", "B"))):
        choice = choice_of(result, "delay")
        np.testing.assert_allclose(choice.value, true, atol=4e-4)
        assert all(low <= x <= high for x, (low, high) in zip(true, choice.intervals, strict=True))
        assert all(f"{name} {1e3 * x:.3g} ms (" in choice.reason for name, x in zip(names, choice.value, strict=True))
        assert result.training_error < 0.05  # of torques whose friction jumps, interpolated or shifted by rows
        assert load_result(saved(tmp_path / names[0], result)).recipe == result.recipe
    assert joint.recipe.delay == choice_of(joint, "delay").value
    assert (logs.recipe.delay, dict(logs.recipe.log_delays)) == (0.0, {"B": choice.value[1]})
    for result, rows in ((joint, joint.observations.equation != 1), (logs, logs.observations.log == 0)):
        column = delay_columns(Context(result.target, result.prepared, result.recipe), result.coefficients)
        assert column.shape[1] == 1
        assert np.all(column[rows] == 0.0)


def test_planted_terms_are_chosen_for_their_drive() -> None:
    C = np.array(irp6().transmission.coupling)[:3, :3]
    first, second, third = C @ clean().dq.T
    torque = np.array([8.0 * np.abs(first), 5.0 + 0 * second, 6.0 * np.sign(third) * np.sqrt(np.abs(third))])
    log = replace(clean(), effort=clean().effort + torque.T @ C, sha256="changed")
    result = excite.identify("irp6", log, estimator="weighted")
    chosen = choice_of(result, "terms").value
    assert {"asymmetry 1", "offset 2", "root 3"} <= set(chosen)
    assert len(chosen) <= 4
    for drive, value in (("1", 8.0), ("2", 5.0), ("3", 6.0)):
        (new,) = [k for k, n in enumerate(result.names) if n not in PLAIN and n[1] == drive]
        assert result.coefficients[new] == pytest.approx(value, rel=0.05)


# ---------------------------------------------------------------- what is given


# ---------------------------------------------------------------- what is written


def test_choices_are_written_and_read_back(tmp_path: Path) -> None:
    result = delayed(0.004)
    stored = load_result(saved(tmp_path / "out", result))
    content = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [choice["name"] for choice in content["choices"]] == ["cutoff", "delay", "presliding"]
    for written, choice in zip(content["choices"], result.choices, strict=True):
        assert (written["value"], written["reason"]) == (choice.value, choice.reason)
        assert len(written["candidates"]) >= 2
        assert all(set(candidate) == {"value", "error", "score"} for candidate in written["candidates"])
    other, undelayed = replace(late(0.004), sha256="another"), replace(stored, recipe=replace(stored.recipe, delay=0.0))
    error, without = (excite.verify(each, other).relative_error for each in (stored, undelayed))
    assert error == pytest.approx(excite.verify(result, other).relative_error)
    assert without > 2 * error


# ---------------------------------------------------------------- other logs and models


KINDS = [
    ({"model": "energy"}, OF_ENERGY),
    ({"model": "springs"}, ALL_OF_TORQUES),
    ({"drives": ("1", "2", "3")}, ALL_OF_TORQUES),
    # so wide that rows near standstill are predicted badly
    ({"sign_width": 0.1}, ["cutoff", "rows", "signals", "delay", "terms", "standstill", "estimator"]),
    ({"average": True, "period": 2.0}, ["terms", "presliding", "standstill", "estimator"]),
    ({"estimator": "huber"}, ALL_OF_TORQUES[:-1]),
]


@pytest.mark.parametrize(
    ("options", "names"), [KINDS[0], *(pytest.param(*kind, marks=pytest.mark.slow) for kind in KINDS[1:])]
)
def test_kinds_of_identifications(options: dict, names: list[str]) -> None:
    result = excite.identify("irp6", clean(4.0 if options.get("model") == "energy" else 6.0), **options)
    assert [choice.name for choice in result.choices] == names
    assert not any("not everything" in note for note in result.estimate.notes)
    assert not {"load_share"} & set(choice_of(result, "terms").value)
    for name, value in options.items():
        if hasattr(result.recipe, name):
            assert getattr(result.recipe, name) == value


def test_the_wrench_of_a_load_has_a_cutoff_a_delay_and_an_estimator() -> None:
    log = noisy(played(periodic(np.eye(5), 3), 5, load=LOAD, seconds=6.0), 0.0, 1e-6, 1)
    result = excite.identify("irp6", log, model="load")
    assert [choice.name for choice in result.choices] == ["cutoff", "signals", "delay", "bias", "estimator"]
    assert result.recipe.estimator == "physical"
    np.testing.assert_allclose(result.coefficients, LOAD, atol=0.01)
    with pytest.raises(InputError, match="a wrench does not contain friction"):
        excite.identify("irp6", log, model="load", friction_curves=FrictionCurves(curves()))


@pytest.mark.slow
def test_known_friction_has_no_terms_but_rotors_may_be_added() -> None:
    result = excite.identify("irp6", clean(), friction_curves=FrictionCurves(curves()))
    assert result.names == PLAIN[:7]
    terms = choice_of(result, "terms")
    assert "rotor inertia" in terms.reason
    assert {candidate.value for candidate in terms.candidates} <= {"none", "rotor"}
    assert result.estimate.notes.count("offset columns are left out: friction is known") == 0


@pytest.mark.slow
@pytest.mark.parametrize(("seconds", "rate"), [(0.2, 200.0), (1.5, 200.0), (8.0, 10.0)])
def test_short_and_slow_logs_go_on(seconds: float, rate: float) -> None:
    result = excite.identify("irp6", clean(seconds, rate), choose=("cutoff", "delay"))
    assert result.recipe.cutoff is None or seconds > 0.2
    noted = [note for note in result.estimate.notes if "the cutoff is chosen from the motion" in note]
    assert len(noted) == (result.recipe.cutoff is None)


def fails(*_: object, **__: object) -> None:
    raise InputError("too few rows of LOG")


def stuck(*_: object, **__: object) -> None:
    raise ConicSolverError("stuck")


def test_what_cannot_be_chosen_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choose, "choose_terms", fails)
    result = excite.identify("irp6", clean(4.0))
    assert [choice.name for choice in result.choices] == ["cutoff", "signals", "delay", "presliding"]
    assert result.estimate.notes[-1] == "not everything is chosen by cross-validation: too few rows of LOG"


def test_pieces_of_very_long_logs_span_them() -> None:
    for count in (100_001, 2_000_000):
        time = np.arange(count) / 1000
        log = Log("LOG", "", ("a",), time, np.zeros((count, 1)), None, np.zeros((count, 1)))
        found = trial.pieces_of(SimpleNamespace(log=log, left_out=((1.0, 2.0),)))
        assert [part.count for part, _ in found] == 5 * [10_000]
        assert found[0][0].time[0] == 0.0
        assert time[-1] - found[-1][0].time[-1] <= 0.005
        gaps = np.diff([part.time[0] for part, _ in found])
        np.testing.assert_allclose(gaps, gaps[0])
        assert all(left_out == ((1.0, 2.0),) for _, left_out in found)


def test_least_squares_stands_in_where_the_conic_solver_fails_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Physical, "estimate", stuck)
    result = excite.identify("irp6", clean(4.0), choose=("estimator",))
    choice = choice_of(result, "estimator")
    assert result.estimate.method == choice.value == "weighted"
    assert "the conic solver found none for all rows" in choice.reason
    with pytest.raises(ConicSolverError, match="stuck"):
        excite.identify("irp6", clean(4.0), choose=False, estimator="physical")


EVERY = frozenset(CHOSEN)
VALUES = {
    "cutoff": 10.0, "signals": "fourier", "measured_velocity": True, "average": True, "period": 2.0, "harmonics": 3,
    "friction_scale": True, "delay": 0.004, "estimator": "huber",
}  # fmt: skip


def free(choose=True, recipe=None, model=None, given=()) -> frozenset[str]:
    return free_settings(choose, Recipe(**(recipe or {})), ModelChoice(**(model or {})), given)


GIVEN = {
    **{name: {name} for name in EVERY},
    "signals": {"signals", "cutoff"},
    "measured_velocity": {"signals", "cutoff"},
    "average": {"signals", "cutoff", "delay"},
    "period": {"signals"},
    "harmonics": {"signals"},
    "described_within": {"estimator"},
}


def test_settings_that_are_given_are_kept() -> None:
    assert free(recipe={"rows": "all", "low_pass": 5.0, "every": 2, "sign_width": 0.1, "covariance": "white"}) == EVERY
    for name, value in VALUES.items():
        assert free(recipe={name: value}) == EVERY - GIVEN[name]
    assert free(recipe={"estimator": "physical", "described_within": 1.0}) == EVERY - {"estimator"}
    assert free(model={"joints": ("1", "2"), "reflected_rotors": False, "stribeck_speed": 0.2}) == EVERY
    for name in TERM_SETTINGS:
        assert free(model={name: True}) == EVERY - {name}
    assert free(model={"offset": ("2",)}) == EVERY - {"offset"}
    for given, kept in GIVEN.items():  # by name, whatever its value; some settings decide on others
        assert free(given=(given,)) == EVERY - kept
    model = DifferentialModel(irp6())
    assert free_settings(True, Recipe(), ModelChoice(model=model), ()) == EVERY - TERM_SETTINGS


def test_only_what_is_asked_for_is_chosen() -> None:
    both = {"cutoff", "delay"}
    for asked, names in ((True, EVERY), ((), set()), (("cutoff", "delay"), both)):
        assert free(asked) == names
    assert free(("cutoff", "delay"), recipe={"cutoff": 3.0}) == {"delay"}
    for name in ("cut-off", "average", "rotor", ""):
        with pytest.raises(UnknownName, match=r"setting to choose.*cutoff, signals, delay"):
            free(("cutoff", name))


@pytest.mark.slow
def test_rows_that_alone_show_a_chosen_term_are_not_left_out() -> None:
    result = excite.identify("ur10e", real_log("ur-20_02_05-20sec_8harm"), rows="1:2000")
    chosen = {choice.name: choice for choice in result.choices}
    assert "stribeck 1" in chosen["terms"].value
    assert "do not show how friction depends on the speed" in chosen["standstill"].reason
    assert result.estimate.unseen == ()
    assert excite.verify(result, real_log("ur-20_02_10-30sec_12harm")).relative_error < 0.07  # 0.43 without these rows
