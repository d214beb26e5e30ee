"""Rotor inertias at the drive coordinates: the same torques, columns of links' size, meanings that stay."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from slow_dynamics import random_chain

from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.nominal import MotorSide, motor_sides, parameter_values, standard_values
from regressors.readers.library import built_in
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio, GearFunction
from regressors.robot.robot import Drive, Limits, Robot, Transmission

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
    assert robot.transmission is not None
    return [drive.ratio.reference_ratio for drive in robot.transmission.drives]


@pytest.mark.parametrize("screw", SCREWS.values(), ids=SCREWS.keys())
def test_reference_ratio_of_a_ball_screw_is_its_largest(screw: BallScrew) -> None:
    z = ca.SX.sym("z")
    ratio = ca.Function("ratio", [z], [screw.ratio(z)]).map(100_001)
    scanned = np.abs(np.array(ratio(np.linspace(-np.pi, np.pi, 100_001)))).max()
    assert screw.reference_ratio == pytest.approx(float(scanned), rel=1e-8)


def test_levers_of_the_irp6_make_the_ratio_that_was_published() -> None:
    assert SCREWS["arm"].reference_ratio == pytest.approx(2 * np.pi / 0.005 * 0.14, rel=1e-6)
    assert (ConstantRatio(-158.0).reference_ratio, OwnGear().reference_ratio) == (158.0, 1.0)


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
    robot = random_chain("rpr", np.random.default_rng(3)).replace(
        transmission=Transmission(np.eye(3), drives, Limits.none(3))
    )
    rotors = {c.name: c.unit for c in DifferentialModel(robot).columns if c.kind == "rotor"}
    assert rotors == {"Iar1": "kg m^2", "Iar2": "kg", "Ia3": "kg m^2"}


def test_meaning_of_a_parameter_does_not_hang_on_limits() -> None:
    robot = full()
    assert robot.transmission is not None
    narrow = robot.replace(transmission=replace(robot.transmission, limits=Limits.none(5)))
    for one, other in zip(DifferentialModel(robot).definition(), DifferentialModel(narrow).definition(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_parameters_that_the_description_names_are_left_as_they_are() -> None:
    robot = built_in("irp6")
    paper = [target_of(robot, Task("irp6", reflected_rotors=wanted)) for wanted in (True, False)]
    assert paper[0].model.columns == paper[1].model.columns
    np.testing.assert_array_equal(paper[0].base.D, paper[1].base.D)
    np.testing.assert_array_equal(paper[0].model.definition()[0], paper[1].model.definition()[0])
