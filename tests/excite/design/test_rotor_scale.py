"""Designs whose rotor inertias are parameters at the drive coordinates, and files that were made before they were."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import excite
from excite.cli.summary import print_view
from excite.design.design import Design
from excite.design.design_json import load_design
from excite.design.optimisation import design_trajectory
from excite.design.task_checks import check_required
from excite.identification.identification import Identification
from excite.identification.result_json import load_result, result_content, save_result
from excite.information.prior import prior_of
from excite.information.target import target_of
from excite.information.weighting import weighting_of
from excite.tasks.objective import Belief
from excite.tasks.task import Task
from excite.views.design_view import design_view
from excite.views.identification_view import identification_view
from regressors.errors import InputError
from regressors.models.base import random_states
from regressors.models.differential import DifferentialModel
from regressors.readers.library import built_in
from regressors.robot.robot import Robot

QUICK = {"period": 5.0, "starts": 1, "executor": "serial"}


@cache
def irp6_full() -> Robot:
    """The built-in robot, with inertias for the bars of its parallelogram, of which nothing is published."""
    robot = built_in("irp6-full")
    bar = np.array([1.5, 0.02, 0.01, 0.0, 0.01, 0.0, 0.0, 0.02, 0.0, 0.02])
    bars = tuple(replace(branch, link=replace(branch.link, theta=bar)) for branch in robot.branches)
    return robot.replace(branches=bars)


@cache
def designed(reflected: bool) -> Design:
    return design_trajectory(Task(irp6_full(), reflected_rotors=reflected, **QUICK))


@cache
def identified(reflected: bool) -> Identification:
    """Joints 2 and 5 of one simulated log, in either form."""
    task = Task(irp6_full(), joints=("2", "5"), **QUICK)
    run = excite.simulate(design_trajectory(task), noise=0.2, seed=2)
    return excite.identify(task.changed(reflected_rotors=reflected), run)


@pytest.mark.slow
def test_units_of_rotors_do_not_make_a_default_design_ill_conditioned() -> None:
    assert designed(True).condition_number < 1000.0
    assert designed(False).condition_number > 1e5


def test_nor_that_of_an_arm_with_coupled_drives() -> None:
    for options in ({"joints": tuple("12345")}, {}):
        assert design_trajectory(Task("irp6", **options, **QUICK)).condition_number < 1000.0


def test_predictions_are_written_on_both_sides(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    design = designed(True)
    files = design.save(tmp_path / "design")
    stored = {entry["name"]: entry for entry in json.loads(files[0].read_text())["predicted"]["parameters"]}
    entry = stored["Iar5"]
    own = entry["motor_side"]
    assert (entry["expression"], own["name"], own["unit"]) == ("n5^2 Ia5", "Ia5", "kg m^2")
    assert own["standard_deviation"] == pytest.approx(entry["standard_deviation"] / 76.8**2)
    assert stored["I1zz"]["motor_side"] is None
    print_view(design_view(design), files)
    shown = capsys.readouterr().out
    assert "at the motor" in shown
    assert f"Ia5: {own['standard_deviation']:.3g}" in shown


@pytest.mark.slow
def test_rotor_inertias_are_found_on_both_sides(capsys: pytest.CaptureFixture[str]) -> None:
    found = identified(True)
    content = result_content(found)
    rotors = {p["name"]: p for p in content["parameters"] if "motor_side" in p}
    assert set(rotors) == {"Iar2", "Iar3"}  # motor 3 turns along with joint 2
    truth = 7.658e-5
    for entry in rotors.values():
        own = entry["motor_side"]
        assert own["reference"] == pytest.approx(truth)
        assert own["interval"][0] <= truth <= own["interval"][1]
        assert entry["interval"][0] <= truth * own["factor"] <= entry["interval"][1]
        assert own["value"] * own["factor"] == pytest.approx(entry["value"])
    print_view(identification_view(found), [Path("results/result.json")])
    assert f"Ia3: {rotors['Iar3']['motor_side']['value']:.4g}" in capsys.readouterr().out


def as_written_before(path: Path) -> None:
    """The file without the options and entries that files did not have."""
    content = json.loads(path.read_text())
    del content["task"]["reflected_rotors"]
    path.write_text(json.dumps(content))
    path.with_name("manifest.json").unlink()


def test_a_design_of_before_keeps_the_parameters_that_it_was_made_for(tmp_path: Path) -> None:
    design = designed(False)
    files = design.save(tmp_path / "old")
    as_written_before(files[0])
    old = load_design(tmp_path / "old")
    assert old.task.model.reflected_rotors is False
    target = target_of(old.robot, old.task)
    assert target.base.names == design.base.names
    assert "Ia5" in target.base.names
    own, other = excite.compare([old, designed(True)])
    assert own.criteria["condition_number"] > 1e5  # judged under the terms of the first
    assert other.criteria["condition_number"] > 1e5


@pytest.mark.slow
def test_a_result_of_before_means_what_it_meant(tmp_path: Path) -> None:
    result = identified(False)
    files = save_result(result, tmp_path / "old")
    as_written_before(files[0])
    old = load_result(tmp_path / "old")
    target = target_of(old.robot, old.task)
    assert "Ia3" in old.names
    assert old.names == target.base.names
    states = random_states(target.robot, 20, seed=1)
    torques = target.model.instants(states)[:, target.base.index] @ old.coefficients
    ours, now = identified(True), identified(True).target
    expected = now.model.instants(states)[:, now.base.index] @ ours.estimate.coefficients
    np.testing.assert_allclose(torques, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_criteria_of_scaled_columns_do_not_know_the_form() -> None:
    matrices = []
    for reflected in (True, False):
        task = Task(irp6_full(), prior=0.2, scale="prior", reflected_rotors=reflected)
        target = target_of(irp6_full(), task)
        W = target.model.instants(random_states(target.robot, 100, seed=3))[:, target.base.index]
        matrices.append(weighting_of(target, task).matrix(W))
    np.testing.assert_allclose(matrices[0], matrices[1], rtol=1e-6, atol=1e-7 * np.abs(matrices[1]).max())


def test_a_parameter_is_known_beforehand_and_required_by_either_name() -> None:
    target, factor = designed(True).target, 76.8**2
    own = prior_of(target.model, target.base, (Belief("Ia5", 4e-5, 1e-5),))
    reflected = prior_of(target.model, target.base, (Belief("Iar5", 4e-5 * factor, 1e-5 * factor),))
    k = target.base.names.index("Iar5")
    np.testing.assert_allclose(reflected.precision, own.precision, rtol=1e-9)
    assert own.precision[k, k] == pytest.approx((1e-5 * factor) ** -2)
    whole = DifferentialModel(irp6_full())
    for name in ("Iar5", "Ia5"):
        check_required(target, whole, Task(irp6_full(), require=(name,)))
    with pytest.raises(InputError, match="no parameter named 'Ia9'"):
        check_required(target, whole, Task(irp6_full(), require=("Ia9",)))
