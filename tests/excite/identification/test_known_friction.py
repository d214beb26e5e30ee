"""Friction known beforehand: subtracted with the direction that the data show, and predicted with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, TASK, curves, described, found, irp6, mixed, periodic, played, three_joints

from excite.identification.equations import measured_direction
from excite.identification.estimation import estimate_parameters
from excite.identification.known_friction import known_torque
from excite.identification.prediction import prediction
from excite.information.target import target_of
from excite.logs.log import Log
from excite.study.repetitions import repetitions
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.friction.curve import CoulombViscous, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.samples import Array, Samples

CURVES = FrictionCurves(curves())
C = irp6().transmission.coupling[:3, :3]


@pytest.fixture(scope="module")
def log() -> Log:
    return played(three_joints(), 3)


def turned(log: Log, direction: Array) -> Log:
    """The log with Coulomb friction whose direction is not the sign of the velocity."""
    coulomb = np.array([CURVES.curve(name).coulomb for name in ("z1", "z2", "z3")])
    return replace(log, effort=log.effort + (coulomb * (direction - np.sign(log.dq @ C.T))) @ C)


def test_a_planted_distance_is_found_with_known_curves(log: Log) -> None:
    moved = turned(log, measured_direction(log.q @ C.T, 0.0005))
    result = found(TASK, moved, friction=CURVES)
    assert result.recipe.breakaway == pytest.approx(0.0005, rel=0.05)
    assert any(
        note.startswith("known friction is presliding: it changes direction over 0.000")
        for note in result.estimate.notes
    )
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)
    exact = found(TASK, moved, recipe=replace(EXACT, sign_width=0.0), friction=CURVES)
    errors = [np.abs(one.estimate.values - described(one)).max() for one in (result, exact)]
    assert errors[1] > 10 * errors[0]


def test_a_planted_width_is_found_with_known_curves(log: Log) -> None:
    result = found(TASK, turned(log, np.tanh(log.dq @ C.T / 0.03)), friction=CURVES)
    assert result.recipe.sign_width == pytest.approx(0.03, rel=0.05)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


def test_known_curves_are_the_columns_that_were_identified(log: Log) -> None:
    recipe = replace(EXACT, breakaway=0.0005)
    moved = turned(log, measured_direction(log.q @ C.T, 0.0005))
    together, known = found(TASK, moved, recipe=recipe), found(TASK, moved, recipe=recipe, friction=CURVES)
    np.testing.assert_allclose(together.estimate.values[:7], known.estimate.values, rtol=1e-7)
    told = [
        prediction(
            one.target, replace(one.prepared[0], measured=moved.effort), one.recipe, one.estimate.coefficients, f
        )
        for one, f in ((together, None), (known, CURVES))
    ]
    np.testing.assert_allclose(told[0].predicted, told[1].predicted, atol=1e-6)


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
    transmission = irp6().transmission
    bare = irp6().replace(
        transmission=replace(
            transmission, drives=tuple(replace(d, coulomb=None, viscous=None) for d in transmission.drives)
        )
    )
    task = TASK.changed(friction=False)
    result = estimate_parameters(bare, task, [log], replace(EXACT, sign_width=0.0), friction=FrictionCurves({}))
    told = "no friction curve of z1, z2, z3, and no friction columns, as asked: assumed to have no friction"
    assert told in result.prepared[0].notes


def test_speeds_beyond_a_table_are_told(log: Log) -> None:
    """However the table is wrapped; nothing where it is fast enough."""
    slow, fast = (TableFriction([0.01, fastest], [20.0, 25.0]) for fastest in (0.05, 50.0))
    known = FrictionCurves(
        {
            "z1": slow,
            "z2": Loaded(Warm(slow, 30.0, Slope(-0.01)), 0.01),
            "z3": Loaded(Warm(fast, 30.0, Slope(-0.01)), 0.01),
        }
    )
    notes = [note for note in told(TASK, log, known).split(" | ") if "faster than its table" in note]
    beyond = np.count_nonzero(np.abs(log.dq @ C.T) > 0.05, axis=0)
    assert [int(note.split()[3]) for note in notes] == pytest.approx(beyond[:2], abs=4)
    assert [note.split()[2] for note in notes] == ["z1:", "z2:"]


def test_offsets_that_known_friction_leaves_out_are_told(log: Log) -> None:
    note = "offset columns are left out: friction is known"
    recipe = replace(EXACT, sign_width=0.0)
    for offset in (True, False):
        result = found(TASK.changed(offset=offset), log, recipe=recipe, friction=CURVES)
        assert (note in result.estimate.notes) == offset
        assert not any(name.startswith("F") for name in result.estimate.names)


def test_curves_are_not_for_wrenches(log: Log) -> None:
    with pytest.raises(InputError, match="a wrench does not contain friction"):
        found(Task("irp6", model="load"), log, friction=CURVES)


def test_identifications_with_known_friction_are_not_repeated(log: Log) -> None:
    with pytest.raises(InputError, match="repetitions cannot repeat friction that is subtracted"):
        repetitions(found(TASK, log, friction=CURVES), 10, 0)
