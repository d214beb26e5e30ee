"""Friction known beforehand, of all drives or some, as it is or times a fitted factor: subtracted, and predicted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from friction_curves import without_friction as without_curves
from played import EXACT, TASK, curves, described, found, irp6, mixed, noisy, periodic, played
from refused import refusal
from written_files import saved

from excite.design.task_file import task_content, task_from_options
from excite.identification.allowances import friction_columns
from excite.identification.equations import measured_direction
from excite.identification.estimator import Context
from excite.identification.prediction import known_torque, prediction, without_friction
from excite.identification.procedure import estimate_parameters
from excite.identification.result_json import load_result, result_content
from excite.information.target import target_of
from excite.logs.log import Log
from excite.study.repetitions import experiment_of
from excite.tasks.friction_file import friction_of, friction_text
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, Scaled, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.robot.friction.uncertainty import multiplied
from regressors.samples import Array, Samples

CURVES = FrictionCurves(curves())
C = irp6().transmission.coupling[:3, :3]


def turned(log: Log, direction: Array) -> Log:
    """The log with Coulomb friction whose direction is not the sign of the velocity."""
    coulomb = np.array([CURVES.curve(name).coulomb for name in ("z1", "z2", "z3")])
    return replace(log, effort=log.effort + (coulomb * (direction - np.sign(log.dq @ C.T))) @ C)


def test_a_planted_distance_and_a_planted_width_are_found_with_known_curves(log: Log) -> None:
    moved = turned(log, measured_direction(log.q @ C.T, 0.0005, log.dq @ C.T / log.rate))
    result = found(TASK, moved, friction=CURVES)
    assert result.recipe.breakaway == pytest.approx(0.0005, rel=0.05)
    said = "known friction reverses over a travel of 0.000"
    assert any(note.startswith(said) for note in result.estimate.notes)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)
    exact = found(TASK, moved, recipe=replace(EXACT, sign_width=0.0), friction=CURVES)
    errors = [np.abs(one.estimate.values - described(one)).max() for one in (result, exact)]
    assert errors[1] > 10 * errors[0]
    softened = found(TASK, turned(log, np.tanh(log.dq @ C.T / 0.03)), friction=CURVES)
    assert softened.recipe.sign_width == pytest.approx(0.03, rel=0.05)
    np.testing.assert_allclose(softened.estimate.values, described(softened), rtol=0.01, atol=0.1)


def test_known_curves_are_the_columns_that_were_identified(log: Log) -> None:
    recipe = replace(EXACT, breakaway=0.0005)
    moved = turned(log, measured_direction(log.q @ C.T, 0.0005, log.dq @ C.T / log.rate))
    together, known = found(TASK, moved, recipe=recipe), found(TASK, moved, recipe=recipe, friction=CURVES)
    np.testing.assert_allclose(together.estimate.values[:7], known.estimate.values, rtol=1e-7)
    predicted = []
    for one, curves_of in ((together, None), (known, CURVES)):
        part = replace(one.prepared[0], measured=moved.effort)
        predicted.append(prediction(one.target, part, one.recipe, one.coefficients, curves_of).predicted)
    np.testing.assert_allclose(*predicted, atol=1e-6)


def test_known_torque_keeps_its_direction_where_the_motion_rests() -> None:
    target = target_of(irp6(), TASK)
    z = np.concatenate([np.linspace(0.0, 0.1, 50), np.full(50, 0.1)])
    q = np.outer(z, [0.0, 1.0, -1.0])
    still = np.zeros_like(q)
    samples = Samples(np.arange(100) / 100.0, q, still, still, still)
    tustin = FrictionCurves({"z2": Stribeck(Side(11.0, 26.0, 16.8), Side(7.0, 26.0, 10.6))})
    at_rest = [known_torque(tustin, target, samples, replace(EXACT, breakaway=d), still)[-1] for d in (0.001, None)]
    np.testing.assert_allclose(at_rest[0], [0.0, 16.8, 0.0], atol=1e-12)
    np.testing.assert_allclose(at_rest[1], [0.0, 0.5 * (16.8 - 10.6), 0.0], atol=1e-12)


def told(task: Task, log: Log, known: FrictionCurves) -> str:
    return " | ".join(found(task, log, recipe=replace(EXACT, sign_width=0.0), friction=known).prepared[0].notes)


def test_drives_that_turn_without_a_curve_are_told(log: Log) -> None:
    """And that the robot's description, which simulations and torque limits go by, states friction for them."""
    only = "no friction curve of {0}: identified with the rest"
    bare = (
        "no friction curve of {0}, and no friction columns, as asked: assumed to have no friction, though the robot's "
        "description states friction for {0}: give `friction=True` to identify it"
    )
    partly = FrictionCurves({"z1": CoulombViscous(28.0, 25.0), "z3": CoulombViscous(30.0, 26.0)})
    assert bare.format("z2") in told(TASK.changed(friction=("1",)), log, partly)
    alone = played(periodic(mixed([0.0, 1.0, -1.0]), 2), 3)
    for task in (TASK, Task("irp6", drives=("2",))):
        assert only.format("z2") in told(task, alone, partly)
        assert "no friction curve" not in told(task, alone, FrictionCurves({"z2": CoulombViscous(28.75, 26.0)}))


def test_nothing_is_said_of_a_description_without_friction(log: Log) -> None:
    bare, task, recipe = without_curves(irp6()), TASK.changed(friction=False), replace(EXACT, sign_width=0.0)
    result = estimate_parameters(bare, task, [log], recipe, friction=FrictionCurves({}))
    told = "no friction curve of z1, z2, z3, and no friction columns, as asked: assumed to have no friction"
    assert told in result.prepared[0].notes


def test_speeds_beyond_a_table_are_told(log: Log) -> None:
    """However the table is wrapped; nothing where it is fast enough."""
    slow, fast = (TableFriction([0.01, fastest], [20.0, 25.0]) for fastest in (0.05, 50.0))
    wrapped = [Loaded(Warm(table, 30.0, Slope(-0.01)), 0.01) for table in (slow, fast)]
    known = FrictionCurves({"z1": slow, "z2": wrapped[0], "z3": wrapped[1]})
    notes = [note for note in told(TASK, log, known).split(" | ") if "faster than its table" in note]
    beyond = np.count_nonzero(np.abs(log.dq @ C.T) > 0.05, axis=0)
    assert [note.split()[2] for note in notes] == ["z1:", "z2:"]
    assert [int(note.split()[3]) for note in notes] == pytest.approx(beyond[:2], abs=4)


def test_identifications_with_known_friction_have_no_offsets_and_are_not_repeated(log: Log) -> None:
    result = found(TASK.changed(offset=True), log, recipe=replace(EXACT, sign_width=0.0), friction=CURVES)
    assert "offset columns are left out: friction is known" in result.estimate.notes
    assert not any(name.startswith("F") for name in result.names)
    assert "repetitions cannot repeat friction that is subtracted" in refusal(experiment_of, result, 10)


EXACTLY = replace(EXACT, sign_width=0.0)
KNOWN = FrictionCurves({"z2": curves()["z2"]})
OWN = ("F1c", "F3c", "F1v", "F3v")


@pytest.mark.parametrize("model", ["differential", "energy"])
def test_the_other_drives_keep_their_columns(model: str, log: Log) -> None:
    """And the truth comes back."""
    result = found(Task("irp6", model=model), log, recipe=EXACTLY, friction=KNOWN)
    assert set(result.estimate.names[-4:]) == set(OWN)
    assert result.task.model.friction == ("z1", "z3")
    windows = model == "energy"  # which are integrated by the trapezoidal rule
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.03 if windows else 1e-9)
    np.testing.assert_allclose(result.estimate.values[-4:], described(result)[-4:], rtol=1e-3)


def test_columns_only_where_they_are_asked_for() -> None:
    for friction, names in ((False, ()), (("z1",), ("F1c", "F1v")), (("3", "z1"), OWN), (("2",), ())):
        task = TASK.changed(friction=friction, friction_curves=KNOWN)
        assert set(names) == {name for name in task.model.built(irp6()).names if name.startswith("F")}
        stored = json.loads(json.dumps(task_content(task)))
        assert task_from_options(stored, stored=True) == task
    with pytest.raises(UnknownName, match=r"no drive named 'z9'; available: 1 \(z1\), 2 \(z2\)"):
        target_of(irp6(), TASK.changed(friction=("z9",)))


def test_joints_are_the_drives_of_a_robot_without_a_transmission() -> None:
    curve = FrictionCurves({"panda_joint1": CoulombViscous(1.0)})
    task = Task("panda", friction=("panda_joint1", "2", "7"), friction_curves=curve)
    names = [name for name in task.model.built(built_in("panda")).names if name.startswith("F")]
    assert names == ["F2c", "F7c", "F2v", "F7v"]


RECIPE = replace(EXACT, sign_width=0.0, friction_scale=True)
FACTORS = {"z1": 0.8, "z3": 1.25}
STATED = FrictionCurves({name: multiplied(curves()[name], 1 / factor) for name, factor in FACTORS.items()})


def test_planted_factors_come_back_with_the_parameters(log: Log, tmp_path: Path) -> None:
    result = found(TASK, log, recipe=RECIPE, friction=STATED)
    assert result.friction_scale.factors == pytest.approx(FACTORS, rel=1e-9)
    assert result.estimate.names[7:] == ("F2c", "F2v")
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-8)
    stored = load_result(saved(tmp_path, result))
    np.testing.assert_allclose(stored.friction.curve("z1").torque([0.1, -0.5]), curves()["z1"].torque([0.1, -0.5]))
    assert result_content(stored)["friction_scale"]["z3"]["factor"] == pytest.approx(1.25)
    assert result_content(found(TASK, log, friction=STATED))["friction_scale"] is None
    own = found(TASK.changed(friction_curves=STATED), log, recipe=RECIPE)
    np.testing.assert_array_equal(own.estimate.values, result.estimate.values)


def test_columns_are_what_is_subtracted(log: Log) -> None:
    plain = found(TASK, log, recipe=replace(RECIPE, friction_scale=False))
    (part,) = plain.prepared
    names, columns = friction_columns(Context(plain.target, (part,), plain.recipe), STATED)
    less = without_friction(part, plain.target, STATED, plain.recipe)
    assert names == ("z1", "z3")
    np.testing.assert_allclose(columns.sum(axis=1), (part.measured - less.measured).ravel(), atol=1e-12)


@pytest.mark.slow
def test_intervals_allow_for_the_factors(log: Log) -> None:
    """They are those of factors and parameters estimated at once."""
    hits, factors = [], []
    for seed in range(50):
        result = found(TASK, noisy(log, 1.0, 0.0, seed), recipe=RECIPE, friction=STATED)
        scale = result.friction_scale
        hits.append(np.abs(result.estimate.values - described(result)) <= result.estimate.half_width)
        factors.append(np.abs(scale.factor - list(FACTORS.values())) <= scale.half_width)
    assert np.mean(hits) > 0.97
    assert np.mean(factors) > 0.96


def test_nothing_to_scale_is_refused(log: Log) -> None:
    assert "`friction_scale` is for known friction" in refusal(found, TASK, log, recipe=RECIPE)
    with pytest.raises(InputError, match="no moving drive has one"):
        found(TASK, log, recipe=RECIPE, friction=FrictionCurves({"z4": CoulombViscous(1.0)}))


def test_multiplied_curves_are_of_their_kind() -> None:
    v = np.array([-2.0, -0.1, 0.1, 0.7])
    for curve in (
        CoulombViscous(2.0, 3.0, 0.1),
        Stribeck(Side(2.0, 3.0, 4.0, 0.1, 1.0), Side(1.0, 2.0, 3.0), offset=0.2),
        TableFriction([0.1, 1.0], [3.0, 5.0]),
        Scaled(CoulombViscous(2.0, 3.0), 1.5),
        Warm(CoulombViscous(2.0, 3.0), 30.0, Slope(-0.01, 0.02), Slope(0.03), range=(20.0, 40.0)),
        Loaded(CoulombViscous(2.0, 3.0), 0.1, 0.2),
    ):
        one = multiplied(curve, 1.3)
        np.testing.assert_allclose(one.torque(v), 1.3 * curve.torque(v), rtol=1e-12)
        np.testing.assert_allclose(one.torque_at(v, 45.0), 1.3 * curve.torque_at(v, 45.0), rtol=1e-12)
        kept = friction_of(friction_text(FrictionCurves({"z1": one})), "text").curve("z1")
        np.testing.assert_allclose(kept.torque(v), one.torque(v), rtol=1e-12)
    assert one.shares == pytest.approx((0.13, 0.26))
