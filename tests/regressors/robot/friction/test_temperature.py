"""Friction that depends on temperature: its curves and their files."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np
import pytest
from friction_curves import TUSTIN
from hypothesis import given, strategies as st
from played import irp6
from refused import refusal

from regressors.errors import UnknownName
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, FunctionFriction, Scaled, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm, drive_temperatures, temperature_notes
from regressors.robot.locked_joints import with_locked_joints

ALIKE, AHEAD, BEHIND = Slope(-0.11, -0.3), Slope(-0.1, -0.25), Slope(0.05, -0.4)
COLD: dict[str, FrictionCurve] = {
    "coulomb-viscous": CoulombViscous(28.75, 26.0, -0.7),
    "tustin": TUSTIN,
    "table": TableFriction([-1.0, -0.2, 0.1, 0.5], [-30.0, -9.0, 12.0, 15.0]),
    "function": FunctionFriction(lambda v: 3.0 * np.sign(v) + v, 2.0),
}
SIDES = {"alike": (ALIKE,), "sided": (AHEAD, BEHIND)}
WARM = {
    f"{name} {kind}": Warm(COLD[name], 31.2, *SIDES[kind], range=(20.0, 45.0)) for name, kind in product(COLD, SIDES)
}
SPEED, TEMPERATURE = st.floats(-2.0, 2.0).filter(lambda v: abs(v) > 1e-6), st.floats(15.0, 60.0)


@pytest.fixture(params=WARM)
def warm(request: pytest.FixtureRequest) -> Warm:
    return WARM[request.param]


# --- one curve -------------------------------------------------------------------------------------------------------


@given(SPEED, TEMPERATURE)
def test_the_law(v: float, temperature: float) -> None:
    for curve in WARM.values():
        slope = curve.forward if v > 0 else curve.backward
        change = (temperature - 31.2) * (slope.coulomb + slope.viscous * abs(v)) * np.sign(v)
        assert curve.torque_at(v, temperature) == pytest.approx(curve.curve.torque(v) + change, abs=1e-12)


def test_one_temperature_is_a_curve_of_its_own(warm: Warm) -> None:
    v = np.array([-1.3, -0.4, -0.01, 0.02, 0.3, 2.0])
    for temperature in (20.0, 31.2, 45.0):
        held = warm.at(temperature)
        np.testing.assert_allclose(held.torque(v), warm.torque_at(v, temperature), atol=1e-12)
        np.testing.assert_allclose(held.torque(v, 0.3 * v), warm.torque_at(v, temperature, 0.3 * v), atol=1e-12)
        assert held.at(60.0) is held
    for reference in (warm, warm.at(None)):
        np.testing.assert_array_equal(reference.torque(v), warm.torque_at(v, 31.2))


def test_expressions_are_the_torques(warm: Warm) -> None:
    v, s = ca.SX.sym("v"), ca.SX.sym("s")
    for curve in (warm, warm.at(40.0)):
        function = ca.Function("f", [v, s], [curve.expression(v, s)])
        for speed, direction in ((-1.7, -0.9), (-0.3, 0.4), (0.6, 1.0), (0.25, -0.2)):
            expected = float(curve.torque(speed, direction))
            close = 1e-2 if isinstance(warm.curve, FunctionFriction) else 1e-9  # tabulated
            assert float(function(speed, direction)) == pytest.approx(expected, abs=close)


def test_known_models_stay_what_they_are() -> None:
    """So that the truth of a simulation, and a limit's bound, see parameters and not just numbers."""
    assert WARM["coulomb-viscous alike"].at(41.2) == CoulombViscous(28.75 - 1.1, 26.0 - 3.0, -0.7)
    warm = WARM["tustin sided"].at(41.2)
    assert warm.forward == Side(13.0, 23.5, 15.8, 0.05, 1.0)
    assert (warm.backward.coulomb, warm.backward.viscous) == pytest.approx((9.5, 16.0))
    assert warm.backward.stiction == pytest.approx(11.1)


def test_each_sample_has_its_own_temperature(warm: Warm) -> None:
    v, temperature = np.linspace(-1.0, 1.0, 6), np.linspace(20.0, 50.0, 6)
    found = warm.torque_at(v, temperature)
    for k in range(6):
        assert found[k] == pytest.approx(float(warm.torque_at(v[k], temperature[k])), abs=1e-12)
    doubled = Scaled(warm, 2.0)
    np.testing.assert_allclose(doubled.torque_at(v, temperature), 2 * found)
    np.testing.assert_allclose(doubled.at(33.0).torque(v), 2 * warm.at(33.0).torque(v))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Warm(TUSTIN, np.nan, ALIKE), r"reference temperature must be finite numbers \[deg C\], given nan"),
        (lambda: Warm(TUSTIN, 30.0, ALIKE, range=(45.0, 20.0)), "its lowest and its highest, given 45, 20"),
        (lambda: Slope(np.inf), "temperature slope coulomb must be a finite number, given inf"),
        (lambda: WARM["tustin alike"].torque_at([0.1, 0.2], [30.0, np.inf]), "temperature must be finite .* given inf"),
        (lambda: WARM["tustin alike"].torque_at([0.1, 0.2], [30.0, 140.0]), r"given -6\.64 at 140 deg C; it was meas"),
        (lambda: Warm(TUSTIN, 30.0, Slope(), Slope(0.0, 0.5)).at(-20.0), "viscous must be .* given -5 at -20 deg C"),
        (lambda: Warm(TableFriction([0.1, 0.5], [8.0, 12.0]), 30.0, Slope(-0.1)).at(200.0), "given -9 at 200 deg C"),
        (lambda: Warm(Scaled(TUSTIN, 2.0), 30.0, ALIKE), r"put it outermost, Scaled\(Warm\(\.\.\.\), \.\.\.\)"),
        (lambda: Warm(Loaded(TUSTIN, 0.1), 30.0, ALIKE), r"put it outermost, Loaded\(Warm\(\.\.\.\), \.\.\.\)"),
        (lambda: Warm(WARM["tustin alike"], 30.0, ALIKE), "a Warm curve must not be inside another one"),
    ],
)
def test_impossible_temperatures_are_refused(make: Callable[[], object], message: str) -> None:
    assert re.search(message, refusal(make))


def test_what_is_less_than_nothing_at_the_reference_may_stay_so() -> None:
    """A fit may have a falling viscous part, or an offset beyond a table's torques: temperature did not do that."""
    falling = Warm(CoulombViscous(10.0, -1.0), 30.0, Slope(-0.1, -0.01)).at(60.0)
    assert falling == CoulombViscous(7.0, -1.3)
    table = Warm(TableFriction([-0.5, -0.1, 0.1, 0.5], [-8.0, -5.0, -1.0, 2.0]), 30.0, Slope(-0.1), Slope(0.1))
    assert table.at(40.0).torque([0.1, 0.5]).tolist() == [-2.0, 1.0]
    assert "torque at speed 0.5 must be zero or more, given -1 at 60 deg C" in refusal(table.at, 60.0)


# --- of a robot ------------------------------------------------------------------------------------------------------


def test_drives_have_the_temperature_of_their_own_joint() -> None:
    """Motor 3 of the IRp-6 drives q2 + q3: its gear is that of the forearm."""
    temperature = np.arange(10.0).reshape(2, 5)
    np.testing.assert_array_equal(drive_temperatures(irp6(), temperature), temperature)
    part = with_locked_joints(irp6(), [1, 2])
    np.testing.assert_array_equal(drive_temperatures(part, [[20.0, 30.0]]), [[20.0, 30.0]])
    np.testing.assert_array_equal(drive_temperatures(built_in("panda"), np.ones((3, 7))), np.ones((3, 7)))


def test_drives_of_a_differential_wrist_have_a_temperature_each() -> None:
    """``z4 = q4 + q5, z5 = q4 - q5``; a drive that does not move its own joint has that of the last that it moves."""
    temperature = np.arange(10.0).reshape(2, 5)
    for wrist, own in (([[1.0, 1.0], [1.0, -1.0]], [3, 4]), ([[0.0, 1.0], [1.0, 0.0]], [4, 3])):
        transmission = irp6().transmission
        C = transmission.coupling.copy()
        C[3:, 3:] = wrist
        robot = irp6().replace(transmission=replace(transmission, coupling=C))
        np.testing.assert_array_equal(drive_temperatures(robot, temperature), temperature[:, [0, 1, 2, *own]])


def test_joints_bear_what_drives_take_at_their_temperatures() -> None:
    robot = with_locked_joints(irp6(), [0, 1, 2])
    curves = FrictionCurves({"z1": WARM["tustin alike"], "z3": WARM["table sided"], "z2": CoulombViscous(9.0)})
    rng = np.random.default_rng(1)
    dq, s, temperature = rng.normal(size=(20, 3)), rng.uniform(-1, 1, (20, 3)), rng.uniform(20, 45, (20, 3))
    found = curves.joint_torque(robot, 0 * dq, dq, s, temperature)
    for k in range(20):
        one = curves.at(dict(zip(("z1", "z2", "z3"), temperature[k].tolist(), strict=True)))
        expected = one.joint_torque(robot, 0 * dq[[k]], dq[[k]], s[[k]])
        np.testing.assert_allclose(found[[k]], expected, atol=1e-12)
    still = curves.at(None).joint_torque(robot, 0 * dq, dq)
    np.testing.assert_array_equal(curves.joint_torque(robot, 0 * dq, dq), still)


def test_curves_at_one_temperature_or_one_each() -> None:
    curves = FrictionCurves({"z1": WARM["tustin alike"], "z2": WARM["coulomb-viscous sided"], "z3": TUSTIN})
    assert curves.at(25.0).curve("z1") == WARM["tustin alike"].at(25.0)
    each = curves.at({"z1": 40.0})
    assert each.curve("z1") == WARM["tustin alike"].at(40.0)
    assert each.curve("z2") == COLD["coulomb-viscous"]
    assert each.curve("z3") is TUSTIN
    with pytest.raises(UnknownName, match="no friction curve named 'z9'; available: z1, z2, z3"):
        curves.at({"z9": 40.0})
    assert re.search(r"z1: friction: coulomb must be zero or more, given .* at 190 deg C", refusal(curves.at, 190.0))


def test_what_is_said_of_temperatures() -> None:
    curves = {"z1": Scaled(WARM["tustin alike"], 2.0), "z2": TUSTIN}
    assert temperature_notes(curves, {"z1": np.array([20.0, 45.0])}) == ("friction of z1 is taken at 20 to 45 deg C",)
    (unknown,) = temperature_notes(curves, None)
    assert unknown.startswith("friction of z1 depends on temperature, which is not known: taken at its reference, 31.2")
    (beyond,) = temperature_notes(curves, {"z1": 18.0})
    assert beyond == "friction of z1 is taken at 18 deg C, which is extrapolated: it was measured from 20 to 45 deg C"
