"""Choices in an identification: what is planted in a log is found, what is not is left alone, nothing fails."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from motions import Sines
from played import LOAD, curves, irp6, noisy, periodic, played, three_joints

import excite
from excite.errors import ConicSolverError
from excite.identification.choices import choose, trial
from excite.identification.choices import choose as choices_in_turn
from excite.identification.choices.choose import choose_settings
from excite.identification.choices.friction_terms import TERM_SETTINGS
from excite.identification.equations import nearest
from excite.identification.estimators.physical import Physical
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.identification.result_json import load_result
from excite.logs.log import Log
from excite.registry import CHOSEN
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array

SLOW = pytest.mark.slow
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
def delayed_by_four() -> Identification:
    """Of the log with torques 4 ms late."""
    return excite.identify("irp6", late(0.004), choose=("cutoff", "delay"))


@cache
def late(delay: float, rate: float = 200.0, seconds: float = 8.0) -> Log:
    """The log with torques that were recorded later than the positions."""
    motion = three_joints()
    before = Sines(motion.centre, motion.amplitude, motion.frequency, motion.phase - motion.frequency * delay)
    effort = played(before, 3, rate, seconds).effort
    return noisy(replace(played(motion, 3, rate, seconds), effort=effort), 0.2, 1e-6, 1)


def with_torque(torque: Array) -> Log:
    """The clean log with some torques of the first three drives besides, shape (N, 3)."""
    C = np.array(irp6().transmission.coupling)[:3, :3]
    log = clean()
    assert log.effort is not None
    return replace(log, effort=log.effort + torque @ C, sha256="changed")


def drive_speeds() -> Array:
    dq = clean().dq
    assert dq is not None
    return np.asarray(dq @ np.array(irp6().transmission.coupling)[:3, :3].T)


def choice_of(result: Identification, name: str) -> choose.Choice:
    (found,) = [choice for choice in result.choices if choice.name == name]
    return found


# ---------------------------------------------------------------- what is found


def test_a_clean_log_needs_nothing_more() -> None:
    assert plain().names == PLAIN
    assert plain().recipe.delay == 0.0
    assert (plain().recipe.sign_width, plain().recipe.breakaway) == (0.0, 0.0)
    assert [choice.name for choice in plain().choices] == [
        "cutoff",
        "signals",
        "terms",
        "delay",
        "presliding",
        "standstill",
        "estimator",
    ]
    assert choice_of(plain(), "terms").value == ()
    assert len(choice_of(plain(), "terms").candidates) > 10
    cutoff = choice_of(plain(), "cutoff")
    assert plain().recipe.cutoff == cutoff.value
    assert 5 < cutoff.value < 25  # the motion ends at 1.5 Hz, its friction jumps
    assert not any("chosen" in note for note in plain().estimate.notes)


def test_without_choices_an_identification_is_what_it_was() -> None:
    result = excite.identify("irp6", clean(), choose=False)
    before = found_before(clean())
    assert result.choices == ()
    assert result.recipe == before.recipe
    np.testing.assert_array_equal(result.coefficients, before.coefficients)


def found_before(log: Log) -> Identification:
    from excite.identification.estimation import estimate_parameters

    return estimate_parameters(irp6(), Task("irp6"), [log])


@pytest.mark.parametrize("delay", [0.004, pytest.param(-0.003, marks=SLOW), pytest.param(0.001, marks=SLOW)])
def test_a_planted_delay_is_found_within_its_interval(delay: float) -> None:
    result = delayed_by_four() if delay == 0.004 else excite.identify("irp6", late(delay), choose=("cutoff", "delay"))
    choice = choice_of(result, "delay")
    assert result.recipe.delay == choice.value
    assert choice.interval is not None
    assert choice.interval[0] < delay < choice.interval[1]
    assert abs(choice.value - delay) < 1e-4
    assert result.recipe.cutoff == pytest.approx(plain().recipe.cutoff, rel=0.5)
    np.testing.assert_allclose(
        result.coefficients, plain().coefficients, atol=0.02 * np.abs(plain().coefficients).max()
    )
    other = excite.verify(result, replace(late(delay), sha256="another"))
    assert other.relative_error < 0.01


@pytest.mark.slow
def test_a_delay_at_a_high_rate() -> None:
    result = excite.identify("irp6", late(0.004, 1000.0))
    assert result.names == PLAIN
    assert abs(result.recipe.delay - 0.004) < 5e-5


@pytest.mark.slow
def test_noise_of_the_motion_is_not_that_of_its_delay() -> None:
    pytest.importorskip("jax")
    from excite.study.repetitions import position_noise

    result = excite.identify("irp6", late(0.004), choose=("delay",), estimator="weighted", cutoff=20.0)
    np.testing.assert_allclose(position_noise(result), 1e-6, rtol=0.4)


@pytest.mark.parametrize(
    ("torque", "name", "value"),
    [
        pytest.param(lambda dz: np.array([0.0, 5.0, 0.0]) * np.ones_like(dz), "offset 2", 5.0, marks=SLOW),
        (lambda dz: np.array([0.0, 0.0, 6.0]) * np.sign(dz) * np.sqrt(np.abs(dz)), "root 3", 6.0),
        pytest.param(lambda dz: np.array([8.0, 0.0, 0.0]) * np.abs(dz), "asymmetry 1", 8.0, marks=SLOW),
    ],
    ids=["offset", "root", "asymmetry"],
)
def test_planted_terms_are_chosen_for_their_drive(torque, name: str, value: float) -> None:
    result = excite.identify("irp6", with_torque(torque(drive_speeds())), estimator="weighted")
    chosen = choice_of(result, "terms").value
    assert name in chosen
    assert len(chosen) <= 2
    (new,) = [k for k, n in enumerate(result.names) if n not in PLAIN and n[1] == name[-1]]
    assert result.coefficients[new] == pytest.approx(value, rel=0.05)


# ---------------------------------------------------------------- what is given


def test_what_is_given_is_not_chosen() -> None:
    result = excite.identify("irp6", clean(), cutoff=10.0, delay=0.0, estimator="weighted", offset=("1",), choose=True)
    assert result.recipe.cutoff == 10.0
    assert not {"cutoff", "delay", "estimator"} & {choice.name for choice in result.choices}
    assert result.task.model.offset == ("1",)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in CHOSEN if n in TERM_SETTINGS - {"stribeck"}])
def test_single_terms_can_be_asked_for(name: str) -> None:
    result = excite.identify("irp6", clean(4.0), choose=(name,))
    assert [choice.name for choice in result.choices] == ["terms", "presliding"]
    assert (result.recipe.estimator, result.recipe.cutoff, result.recipe.delay) == ("weighted", None, 0.0)


@pytest.mark.slow
def test_models_without_friction_and_model_objects_keep_their_terms() -> None:
    for model, options in ((DifferentialModel(irp6()), {}), ("irp6", {"friction": False})):
        result = excite.identify(model, clean(), **options)
        assert not {"terms"} & {choice.name for choice in result.choices}
        assert "estimator" in {choice.name for choice in result.choices}


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="setting to choose"):
        excite.identify("irp6", clean(), choose=("speed",))


# ---------------------------------------------------------------- what is written


def test_choices_are_written_and_read_back(tmp_path: Path) -> None:
    result = delayed_by_four()
    result.save(tmp_path / "out")
    content = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [choice["name"] for choice in content["choices"]] == ["cutoff", "delay", "presliding"]
    for written, choice in zip(content["choices"], result.choices, strict=True):
        assert (written["value"], written["reason"]) == (choice.value, choice.reason)
        assert len(written["candidates"]) >= 2
        for candidate in written["candidates"]:
            assert set(candidate) == {"value", "error", "score"}
    stored = load_result(tmp_path / "out")
    assert (stored.recipe.delay, stored.recipe.cutoff) == (result.recipe.delay, result.recipe.cutoff)
    other = replace(late(0.004), sha256="another")
    assert excite.verify(stored, other).relative_error == pytest.approx(excite.verify(result, other).relative_error)
    undelayed = replace(stored, recipe=replace(stored.recipe, delay=0.0))
    assert excite.verify(undelayed, other).relative_error > 2 * excite.verify(stored, other).relative_error


# ---------------------------------------------------------------- other logs and models


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ({"model": "energy"}, OF_ENERGY),
        pytest.param({"model": "energy", "window": "long"}, OF_ENERGY, marks=SLOW),
        pytest.param(
            {"model": "springs"},
            ALL_OF_TORQUES,
            marks=SLOW,
        ),
        pytest.param(
            {"drives": ("1", "2", "3")},
            ALL_OF_TORQUES,
            marks=SLOW,
        ),
        pytest.param(
            {"joints": ("1", "2", "3")},
            ALL_OF_TORQUES,
            marks=SLOW,
        ),
        pytest.param(  # so wide that rows near standstill are predicted badly
            {"sign_width": 0.1},
            ["cutoff", "rows", "signals", "delay", "terms", "standstill", "estimator"],
            marks=SLOW,
        ),
        pytest.param(
            {"signals": "fourier", "period": 2.0},
            ["terms", "delay", "presliding", "standstill", "estimator"],
            marks=SLOW,
        ),
        pytest.param({"average": True, "period": 2.0}, ["terms", "presliding", "standstill", "estimator"], marks=SLOW),
        pytest.param(
            {"low_pass": 10.0},
            ALL_OF_TORQUES,
            marks=SLOW,
        ),
        pytest.param({"estimator": "huber"}, ALL_OF_TORQUES[:-1], marks=SLOW),
    ],
    ids=lambda value: " ".join(f"{k}={v}" for k, v in value.items()) if isinstance(value, dict) else "",
)
def test_kinds_of_identifications(options: dict, names: list[str]) -> None:
    result = excite.identify("irp6", clean(), **options)
    assert [choice.name for choice in result.choices] == names
    assert not any("not everything" in note for note in result.estimate.notes)
    assert not {"load_share"} & set(choice_of(result, "terms").value)
    for name, value in options.items():
        if hasattr(result.recipe, name):
            assert getattr(result.recipe, name) == value


def test_the_wrench_of_a_load_has_a_cutoff_a_delay_and_an_estimator() -> None:
    log = noisy(played(periodic(np.eye(5), 3), 5, load=LOAD, seconds=6.0), 0.0, 1e-6, 1)
    result = excite.identify("irp6", log, model="load")
    assert [choice.name for choice in result.choices] == ["cutoff", "signals", "delay", "estimator"]
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
def test_known_friction_acts_with_the_delay() -> None:
    result = excite.identify("irp6", late(0.004), friction_curves=FrictionCurves(curves()), choose=("cutoff", "delay"))
    assert abs(result.recipe.delay - 0.004) < 1e-4


@pytest.mark.slow
def test_several_logs() -> None:
    result = excite.identify("irp6", [clean(4.0), clean(5.0, seed=2)])
    assert result.names == PLAIN
    assert len(result.choices) == 7


@pytest.mark.slow
@pytest.mark.parametrize(("seconds", "rate"), [(0.2, 200.0), (1.0, 200.0), (1.5, 200.0), (8.0, 10.0), (8.0, 20.0)])
def test_short_and_slow_logs_go_on(seconds: float, rate: float) -> None:
    result = excite.identify("irp6", clean(seconds, rate), choose=("cutoff", "delay"))
    assert result.recipe.cutoff is None or seconds > 0.2
    noted = [note for note in result.estimate.notes if "the cutoff is chosen from the motion" in note]
    assert len(noted) == (result.recipe.cutoff is None)


def test_what_cannot_be_chosen_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise InputError("too few rows of LOG")

    monkeypatch.setattr(choices_in_turn, "choose_terms", fails)
    result = excite.identify("irp6", clean())
    assert [choice.name for choice in result.choices] == ["cutoff", "signals", "delay", "presliding"]
    assert result.recipe.cutoff == plain().recipe.cutoff
    assert result.estimate.notes[-1] == "not everything is chosen by left-out torques: too few rows of LOG"


def test_logs_that_do_not_fit_are_refused_as_without_choices() -> None:
    log = clean().of(["q1", "q3"])
    for choose_them in (True, False):
        with pytest.raises(InputError, match="LOG has the joints q1, q3, but not q2, which the model moves"):
            excite.identify("irp6", log, choose=choose_them)


@pytest.mark.slow
def test_very_long_logs_are_tried_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "_LONGEST", 1000)
    tried = []
    monkeypatch.setattr(choose, "trial_of", lambda *a: tried.append(trial_of(*a)) or tried[-1])
    chosen = choose_settings(irp6(), Task("irp6"), [clean()], Recipe(), frozenset({"cutoff", "delay"}))
    (chosen_trial,) = tried
    assert [log.count for log in chosen_trial.logs] == 5 * [200]
    assert [log.time[0] for log in chosen_trial.logs] == pytest.approx([0.0, 1.75, 3.5, 5.25, 7.0], abs=0.01)
    assert chosen.recipe.delay == 0.0


trial_of = choose.trial_of


@pytest.mark.parametrize("count", [100_001, 2_000_000])
def test_pieces_of_very_long_logs_span_them(count: int) -> None:
    time = np.arange(count) / 1000
    log = Log("LOG", "", ("a",), time, np.zeros((count, 1)), None, np.zeros((count, 1)))

    class Part:
        left_out = ((1.0, 2.0),)

    Part.log = log
    found = trial.pieces_of(Part())
    assert [log.count for log, _ in found] == 5 * [10_000]
    assert found[0][0].time[0] == 0.0
    assert time[-1] - found[-1][0].time[-1] <= 0.005
    gaps = np.diff([log.time[0] for log, _ in found])
    np.testing.assert_allclose(gaps, gaps[0])
    assert all(left_out == Part.left_out for _, left_out in found)


def test_nearest_instants() -> None:
    known = np.arange(50) * 0.1
    rng = np.random.default_rng(0)
    rows = rng.integers(0, 50, 30)
    np.testing.assert_array_equal(nearest(known, known[rows] + rng.uniform(-0.04, 0.04, 30)), rows)


def test_least_squares_stands_in_where_the_conic_solver_fails_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise ConicSolverError("stuck")

    monkeypatch.setattr(Physical, "estimate", fails)
    result = excite.identify("irp6", clean(4.0), choose=("estimator",))
    assert result.estimate.method == "weighted"
    choice = next(one for one in result.choices if one.name == "estimator")
    assert choice.value == "weighted"
    assert "the conic solver found none for all rows" in choice.reason
    with pytest.raises(ConicSolverError, match="stuck"):
        excite.identify("irp6", clean(4.0), choose=False, estimator="physical")
