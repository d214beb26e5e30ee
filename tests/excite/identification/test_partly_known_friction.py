"""Friction that is known of some drives: the others keep their columns, and are never frictionless unless asked."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from played import EXACT, TASK, curves, described, found, irp6, played, three_joints

from excite.design.task_file import task_content, task_from_options
from excite.identification.equations import measured_direction
from excite.identification.result_json import load_result, result_content
from excite.information.target import target_of
from excite.logs.log import Log
from excite.tasks.task import Task
from excite.verification.verify import verify
from regressors.errors import UnknownName
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves

EXACTLY = replace(EXACT, sign_width=0.0)
KNOWN = FrictionCurves({"z2": curves()["z2"]})
OWN = ("F1c", "F3c", "F1v", "F3v")


@pytest.fixture(scope="module")
def log() -> Log:
    return played(three_joints(), 3)


@pytest.mark.parametrize("model", ["differential", "energy"])
def test_the_other_drives_keep_their_columns(model: str, log: Log) -> None:
    """And the truth comes back."""
    result = found(Task("irp6", model=model), log, recipe=EXACTLY, friction=KNOWN)
    assert set(result.estimate.names[-4:]) == set(OWN)
    assert result.task.model.friction == ("z1", "z3")
    windows = model == "energy"  # which are integrated by the trapezoidal rule
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.03 if windows else 1e-9)
    np.testing.assert_allclose(result.estimate.values[-4:], described(result)[-4:], rtol=1e-3)


def test_offsets_are_those_of_the_other_drives(log: Log) -> None:
    result = found(TASK.changed(offset=True), log, recipe=EXACTLY, friction=KNOWN)
    assert result.estimate.names[7:] == (*OWN, "F1o", "F3o")
    np.testing.assert_allclose(result.estimate.values, described(result), atol=1e-8)


def test_a_task_with_curves_gives_the_same(log: Log) -> None:
    with_curves, named = found(TASK.changed(friction_curves=KNOWN), log), found(TASK, log, friction=KNOWN)
    np.testing.assert_array_equal(with_curves.estimate.values, named.estimate.values)


@pytest.mark.parametrize(
    ("friction", "names"), [(False, ()), (("z1",), ("F1c", "F1v")), (("3", "z1"), OWN), (("2",), ())]
)
def test_columns_only_where_they_are_asked_for(friction: bool | tuple[str, ...], names: tuple[str, ...]) -> None:
    task = TASK.changed(friction=friction, friction_curves=KNOWN)
    model = task.model.built(irp6())
    assert set(names) == {name for name in model.names if name.startswith("F")}
    stored = json.loads(json.dumps(task_content(task)))
    assert task_from_options(stored, stored=True) == task


def test_drives_that_do_not_exist_are_refused() -> None:
    with pytest.raises(UnknownName, match=r"no drive named 'z9'; available: 1 \(z1\), 2 \(z2\)"):
        target_of(irp6(), TASK.changed(friction=("z9",)))


def test_joints_are_the_drives_of_a_robot_without_a_transmission() -> None:
    curve = FrictionCurves({"panda_joint1": CoulombViscous(1.0)})
    names = (
        Task("panda", friction=("panda_joint1", "2", "7"), friction_curves=curve).model.built(built_in("panda")).names
    )
    assert [name for name in names if name.startswith("F")] == ["F2c", "F7c", "F2v", "F7v"]


def test_presliding_is_that_of_curves_and_columns_alike(log: Log) -> None:
    C = irp6().transmission.coupling[:3, :3]
    change = measured_direction(log.q @ C.T, 0.0005) - np.sign(log.dq @ C.T)
    coulomb = [curves()[name].coulomb for name in ("z1", "z2", "z3")]
    moved = replace(log, effort=log.effort + (coulomb * change) @ C)
    result = found(TASK, moved, friction=KNOWN)
    assert result.recipe.breakaway == pytest.approx(0.0005, rel=0.05)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


def test_results_are_verified_with_both(log: Log, tmp_path: Path) -> None:
    result = found(TASK, log, recipe=EXACTLY, friction=KNOWN)
    result.save(tmp_path)
    assert result_content(result)["task"]["friction"] == ("z1", "z3")
    other = played(three_joints(7), 3, seconds=6.0, source="OTHER")
    assert verify(load_result(tmp_path), other, rows="all", signals="fourier").relative_error < 1e-6
