"""Rotors at their drives' coordinates and at joints, and springs in the joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from slow_dynamics import random_chain, three_axes
from written_files import saved

import excite
from excite.information.target import target_of
from excite.registry import MODELS
from excite.study.repetitions import experiment_of, repeat_experiment
from excite.tasks.task import Task
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel, SpringModel
from regressors.models.energy import EnergyModel
from regressors.models.nominal import MotorSide, motor_sides, parameter_values, standard_values
from regressors.models.partial import of_drives
from regressors.readers.library import built_in, load_robot
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.locked_joints import with_joint_rotors, with_locked_joints
from regressors.robot.robot import Drive, Limits, Robot, Transmission
from regressors.samples import Array

SCREWS = {
    "arm": BallScrew(pitch=0.005, square=0.07789525, cosine=-0.02934668, sine=-0.06090255),
    "forearm": BallScrew(pitch=0.005, square=0.07789525, cosine=-0.0441, sine=-0.05124),
    "short": BallScrew(pitch=0.01, square=0.05, cosine=0.01, sine=0.002),
}
MOTOR = Terms(reflected=False)


class OwnGear(GearFunction):
    def ratio(self, z: ca.SX) -> ca.SX:
        return 30.0 + z


def full() -> Robot:
    return built_in("irp6-full")


def ratios(robot: Robot) -> list[float]:
    return [drive.ratio.reference_ratio for drive in robot.transmission.drives]


@pytest.mark.parametrize("screw", SCREWS.values(), ids=SCREWS.keys())
def test_reference_ratio_of_a_ball_screw_is_its_largest(screw: BallScrew) -> None:
    z = ca.SX.sym("z")
    ratio = ca.Function("ratio", [z], [screw.ratio(z)]).map(100_001)
    scanned = np.abs(np.array(ratio(np.linspace(-np.pi, np.pi, 100_001)))).max()
    assert screw.reference_ratio == pytest.approx(float(scanned), rel=1e-8)


@pytest.mark.parametrize("kind", [DifferentialModel, EnergyModel])
def test_reflected_columns_are_the_motors_own_over_the_squared_ratio(kind: type) -> None:
    robot = full()
    reflected, own = kind(robot), kind(robot, MOTOR)
    n = dict(zip((f"Iar{k}" for k in range(1, 6)), ratios(robot), strict=True))
    assert reflected.names == tuple(name.replace("Ia", "Iar") for name in own.names)
    assert [c.name for c in reflected.standard_columns] == list(own.names)
    states = random_states(robot, 50, seed=2)
    factors = np.array([n.get(name, 1.0) ** 2 for name in reflected.names])
    np.testing.assert_allclose(reflected.instants(states) * factors, own.instants(states), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(reflected.definition()[0], np.diag(factors))


def test_parameters_explain_the_same_torques_on_both_sides() -> None:
    robot, states = full(), random_states(full(), 40, seed=5)
    torques = []
    for terms in (Terms(), MOTOR):
        model = DifferentialModel(robot.replace(branches=()), terms)
        base = base_parameters(model)
        beta = parameter_values(model, base, standard_values(robot))
        torques.append(model.instants(states)[:, base.index] @ beta)
    np.testing.assert_allclose(torques[0], torques[1], rtol=1e-9, atol=1e-9 * np.abs(torques[1]).max())


def test_base_parameters_are_written_and_valued_on_both_sides() -> None:
    model = DifferentialModel(full())
    base = base_parameters(model)
    written = dict(zip(base.names, base.expressions, strict=True))
    assert written["Iar5"] == "n5^2 Ia5"
    assert "n1^2 Ia1" in written["I1zz"]  # not a parameter of its own
    sides = motor_sides(model, base)
    assert set(sides) == {"Iar2", "Iar3", "Iar5"}
    assert sides["Iar5"] == MotorSide("Ia5", "kg m^2", pytest.approx(76.8**2))
    values = dict(zip(base.names, parameter_values(model, base, standard_values(full())), strict=True))
    assert values["Iar5"] == pytest.approx(76.8**2 * 4.0e-5)
    assert not motor_sides(DifferentialModel(full(), MOTOR), base_parameters(DifferentialModel(full(), MOTOR)))


def test_a_rotor_behind_a_slider_is_a_mass_and_one_without_a_gear_keeps_its_name() -> None:
    gears = (ConstantRatio(20.0), ConstantRatio(300.0), OwnGear())
    drives = tuple(Drive(f"d{k}", gear, 1e-4) for k, gear in enumerate(gears))
    transmission = Transmission(np.eye(3), drives, Limits.none(3))
    robot = random_chain("rpr", np.random.default_rng(3)).replace(transmission=transmission)
    rotors = {c.name: c.unit for c in DifferentialModel(robot).columns if c.kind == "rotor"}
    assert rotors == {"Iar1": "kg m^2", "Iar2": "kg", "Ia3": "kg m^2"}


def test_meaning_of_a_parameter_does_not_hang_on_limits() -> None:
    robot = full()
    narrow = robot.replace(transmission=replace(robot.transmission, limits=Limits.none(5)))
    for one, other in zip(DifferentialModel(robot).definition(), DifferentialModel(narrow).definition(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_parameters_that_the_description_names_are_left_as_they_are() -> None:
    robot = built_in("irp6")
    paper = [target_of(robot, Task("irp6", reflected_rotors=wanted)) for wanted in (True, False)]
    assert paper[0].model.columns == paper[1].model.columns
    np.testing.assert_array_equal(paper[0].base.D, paper[1].base.D)
    np.testing.assert_array_equal(paper[0].model.definition()[0], paper[1].model.definition()[0])


INERTIA = Terms(coulomb=False, viscous=False)


def test_a_rotor_at_a_joint_resists_its_own_acceleration_only() -> None:
    robot = load_robot("ur10e")
    model = DifferentialModel(with_joint_rotors(robot), INERTIA)
    states = random_states(robot, 5, seed=3)
    Y = model.instants(states).reshape(5, 6, -1)
    rotors = [k for k, column in enumerate(model.columns) if column.group == "rotor"]
    assert [model.names[k] for k in rotors] == [f"Ia{k}" for k in range(1, 7)]
    for instant, ddq in zip(Y, states.ddq, strict=True):
        np.testing.assert_allclose(instant[:, rotors], np.diag(ddq), rtol=1e-14)


def test_what_is_known_of_drives_stays() -> None:
    robot = load_robot("irp6")
    assert with_joint_rotors(robot).sha256() == robot.sha256()


@pytest.mark.parametrize(("wanted", "rank"), [(False, 36 + 18), (True, 40 + 18)])
def test_ur10e_has_the_58_columns_of_the_published_identification(wanted: bool, rank: int) -> None:
    task = Task("ur10e", offset=True, joint_rotors=wanted)
    assert target_of(load_robot("ur10e"), task).base.rank == rank


REST = {"q2": 0.2, "q3": -0.1}
STIFFNESS = np.array([30.0, 40.0, 50.0])


def stiffness_columns(model: SpringModel) -> Array:
    samples = random_states(model.robot, 20, seed=1)
    return np.asarray(model.instants(samples).reshape(20, model.robot.n, -1)[:, :, -model.robot.n :])


def test_springs_are_the_gradient_of_their_energy() -> None:
    """``tau = d/dq sum_j k_j (q_j - rest_j)^2 / 2``, by CasADi."""
    robot = three_axes()
    q = ca.SX.sym("q", 3)
    energy = 0.5 * ca.sum1(STIFFNESS * (q - ca.DM([0.0, 0.2, -0.1])) ** 2)
    torque = ca.Function("torque", [q], [ca.gradient(energy, q)])
    samples = random_states(robot, 20, seed=1)
    expected = np.array([np.asarray(torque(x)).ravel() for x in samples.q])
    np.testing.assert_allclose(stiffness_columns(SpringModel(robot, rest=REST)) @ STIFFNESS, expected, atol=1e-12)


def test_other_columns_are_those_of_the_differential_model() -> None:
    robot, samples = three_axes(), random_states(three_axes(), 30, seed=2)
    bare, sprung = DifferentialModel(robot, Terms(offset=True)), SpringModel(robot, Terms(offset=True), rest=REST)
    np.testing.assert_array_equal(sprung.instants(samples)[:, : len(bare.columns)], bare.instants(samples))
    added = sprung.columns[len(bare.columns) :]
    assert [(c.name, c.unit, c.kind) for c in added] == [(f"k{j}", "Nm/rad", "stiffness") for j in (1, 2, 3)]
    assert base_parameters(sprung).names == (*base_parameters(bare).names, "k1", "k2", "k3")


def test_an_offset_takes_up_an_unknown_rest() -> None:
    """Rows with a rest position are those without it less a constant, which lies in the columns of the offsets."""
    robot, samples = three_axes(), random_states(three_axes(), 30, seed=3)
    known, unknown = SpringModel(robot, rest=REST), SpringModel(robot, Terms(offset=True))
    torque = known.instants(samples)[:, -3:] @ STIFFNESS
    W = unknown.instants(samples)
    np.testing.assert_allclose(W @ np.linalg.lstsq(W, torque)[0], torque, atol=1e-9)


def test_joints_that_are_locked_lose_their_springs() -> None:
    whole = SpringModel(three_axes(), rest=REST)
    robot = with_locked_joints(three_axes(), [0, 2])
    model = whole.on(robot)
    assert (model.rest, model.names[-2:]) == ({"q3": -0.1}, ("k1", "k3"))
    assert whole.softened(0.1).options == {**whole.options, "sign_width": 0.1}
    moved = of_drives(whole.robot, ["2"])
    samples = random_states(whole.robot, 10, seed=4)
    expected = np.einsum("j,ijp->ip", moved.matrix[:, 0], whole.instants(samples).reshape(10, 3, -1))
    np.testing.assert_allclose(whole.restricted(moved).instants(samples), expected, atol=1e-9)


@pytest.mark.slow
def test_by_name_from_the_design_to_the_verdict(tmp_path: Path) -> None:
    """The simulated robot has no springs, and so do its parameters."""
    assert "springs" in MODELS
    task = excite.Task("irp6", model="springs", harmonics=3, starts=2, executor="serial")
    design = excite.design_trajectory(task)
    assert design.feasible
    stored = excite.load_design(saved(tmp_path / "design", design))
    assert stored.task.model.model == "springs"
    logs = [excite.simulate(stored, noise=1.0, seed=seed, rate=200.0) for seed in (1, 2)]
    result = excite.identify("irp6", logs[0], design=stored)
    assert result.names[-3:] == ("k1", "k2", "k3")
    assert np.all(np.abs(result.coefficients[-3:]) < 5 * result.estimate.deviation[-3:] + 1.0)
    assert excite.verify(result, logs[1]).holds
    weighted = excite.identify("irp6", logs[0], design=stored, estimator="weighted")
    assert repeat_experiment(experiment_of(weighted, 10), 10, seed=0).estimates.shape == (10, len(weighted.names))
