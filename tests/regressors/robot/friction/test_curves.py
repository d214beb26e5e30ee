"""Friction curves: their laws, the joints' side of the coupling, and files of them."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from friction_curves import TUSTIN
from hypothesis import given, strategies as st
from refused import refusal

from excite.tasks.friction_file import friction_of, read_friction, write_friction
from regressors.models.base import random_states
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in
from regressors.robot.columns import Terms
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, FunctionFriction, Scaled, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm, smooth_direction
from regressors.robot.locked_joints import with_locked_joints

# the second joint of [KD96] section 5.2: break-away torques 16.8 and 10.6 Nm
CURVES: dict[str, FrictionCurve] = {
    "coulomb-viscous": CoulombViscous(28.75, 26.0, -0.7),
    "tustin": TUSTIN,
    "table-odd": TableFriction([0.1, 0.3, 1.0], [12.0, 10.0, 20.0]),
    "table-sided": TableFriction([-1.0, -0.2, 0.1, 0.5], [-30.0, -9.0, 12.0, 15.0]),
    "function": FunctionFriction(lambda v: 3.0 * np.tanh(10 * v) + v, 2.0),
    "scaled": Scaled(TUSTIN, 0.5),
}
VELOCITY = st.floats(-2.0, 2.0)


@pytest.fixture(params=CURVES)
def curve(request: pytest.FixtureRequest) -> FrictionCurve:
    return CURVES[request.param]


@cache
def smooth(curve: FrictionCurve, width: float) -> Callable[[float], float]:
    v = ca.SX.sym("v")
    function = ca.Function("f", [v], [curve.expression(v, ca.tanh(v / width))])
    return lambda value: float(function(value))


# --- one curve -------------------------------------------------------------------------------------------------------


def test_tustin_law_at_its_marks() -> None:
    near = 1e-9
    assert TUSTIN.torque(near) == pytest.approx(16.8 + 0.4, abs=1e-6)
    assert TUSTIN.torque(-near) == pytest.approx(-10.6 + 0.4, abs=1e-6)
    assert TUSTIN.torque(0.05) == pytest.approx(14.0 + 2.8 / np.e + 26 * 0.05 + 0.4)
    assert TUSTIN.torque(-0.16) == pytest.approx(-(9.0 + 1.6 * np.exp(-4)) - 20 * 0.16 + 0.4)
    far = TUSTIN.torque([1.5, 1.6, -1.5, -1.6])
    np.testing.assert_allclose([far[1] - far[0], far[2] - far[3]], [2.6, 2.0], atol=1e-9)


def slow_table(v: float, pairs: list[tuple[float, float]]) -> float:
    """Linear interpolation by search, for v > 0."""
    if v <= pairs[0][0]:
        return pairs[0][1]
    for (x0, y0), (x1, y1) in pairwise(pairs):
        if v <= x1:
            return y0 + (y1 - y0) * (v - x0) / (x1 - x0)
    return pairs[-1][1]


@given(VELOCITY)
def test_tables_by_search(v: float) -> None:
    odd = [(0.1, 12.0), (0.3, 10.0), (1.0, 20.0)]
    assert CURVES["table-odd"].torque(v) == pytest.approx(np.sign(v) * slow_table(abs(v), odd), abs=1e-12)
    if v != 0.0:
        side = [(0.1, 12.0), (0.5, 15.0)] if v > 0 else [(0.2, 9.0), (1.0, 30.0)]
        expected = np.sign(v) * slow_table(abs(v), side)
        assert CURVES["table-sided"].torque(v) == pytest.approx(expected, abs=1e-12)


def test_a_table_counts_what_it_does_not_cover() -> None:
    table = TableFriction([-1.0, -0.2, 0.1, 0.5], [-30.0, -9.0, 12.0, 15.0])
    assert table.extrapolated([0.5, 0.51, -1.0, -1.1, 0.0, 3.0]) == 3
    assert TableFriction([0.5], [2.0]).extrapolated([-0.6, 0.4]) == 1


@given(VELOCITY.filter(lambda v: abs(v) > 1e-9), st.floats(-1.0, 1.0))
def test_a_direction_blends_between_both_sides(v: float, s: float) -> None:
    for curve in CURVES.values():
        sides = curve.torque([v, v, v], [1.0, -1.0, s])
        assert sides[2] == pytest.approx((1 + s) / 2 * sides[0] + (1 - s) / 2 * sides[1], abs=1e-9)
        assert curve.torque(v, np.sign(v)) == pytest.approx(curve.torque(v), abs=1e-12)


def test_friction_at_rest_keeps_its_direction() -> None:
    np.testing.assert_allclose(TUSTIN.torque([0.0, 0.0], [1.0, -1.0]), [16.8 + 0.4, -10.6 + 0.4])
    np.testing.assert_allclose(CURVES["table-sided"].torque([0.0, 0.0], [1.0, -1.0]), [12.0, -9.0])
    np.testing.assert_allclose(FunctionFriction(np.sign).torque([0.0, 0.0], [1.0, -1.0]), [1.0, -1.0])


@given(VELOCITY.filter(lambda v: abs(v) > 1e-3))
def test_smooth_sign_is_exact_away_from_zero(v: float) -> None:
    for name, curve in CURVES.items():
        close = 2e-3 if name == "function" else 1e-9  # tabulated
        assert smooth(curve, 2e-5)(v) == pytest.approx(float(curve.torque(v)), abs=close), name


def test_smooth_sign_passes_through_the_mean_of_both_directions(curve: FrictionCurve) -> None:
    middle = (float(curve.torque(1e-12)) + float(curve.torque(-1e-12))) / 2
    assert smooth(curve, 1e-3)(0.0) == pytest.approx(middle, abs=1e-9)
    values = [smooth(curve, 1e-3)(v) for v in np.linspace(-2e-3, 2e-3, 41)]
    assert np.abs(np.diff(values)).max() < 0.2 * (values[-1] - values[0])


# --- of a robot ------------------------------------------------------------------------------------------------------


def test_joints_bear_the_transposed_coupling() -> None:
    """Motor 3 of the IRp-6 drives q2 + q3: its friction acts on both joints."""
    robot = built_in("irp6")
    curves = FrictionCurves({"z3": CoulombViscous(30.0, 26.0)})
    dq = np.array([[0.0, 0.1, 0.3, 0.0, 0.0], [0.0, 0.2, -0.5, 0.0, 1.0]])
    f = np.array([30 + 26 * 0.4, -30 - 26 * 0.3])
    expected = np.column_stack([0 * f, f, f, 0 * f, 0 * f])
    np.testing.assert_allclose(curves.joint_torque(robot, np.zeros_like(dq), dq), expected, atol=1e-12)


@pytest.mark.parametrize("joints", [[0, 1, 2], [0, 1, 2, 3, 4], [2], [1, 3]], ids=str)
def test_coulomb_and_viscous_are_columns_of_the_differential_model(joints: list[int]) -> None:
    robot = with_locked_joints(built_in("irp6"), joints)
    bare = robot.replace(structure=type(robot.structure)())
    states = random_states(bare, 20, seed=1)
    model = DifferentialModel(bare, Terms(rotor=False))
    known = standard_values(bare)
    values = np.array([known[name] if name.startswith("F") else 0.0 for name in model.names])
    expected = (model.assemble(states) @ values).reshape(20, -1)
    found = FrictionCurves.of_robot(bare).joint_torque(bare, states.q, states.dq)
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_expression_is_the_joints_torque() -> None:
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    curves = FrictionCurves({"z2": TUSTIN, "z3": CURVES["table-sided"], "z5": CoulombViscous(9.0)})  # z5 rests
    v = ca.SX.sym("dq", 3)
    function = ca.Function("f", [v], [curves.joint_expression(robot, v, smooth_direction(robot, v, 1e-6))])
    dq = np.random.default_rng(2).normal(size=(10, 3))
    found = np.array([np.array(function(row)).ravel() for row in dq])
    np.testing.assert_allclose(found, curves.joint_torque(robot, 0 * dq, dq), atol=1e-9)
    assert np.abs(found[:, 0]).max() == 0.0


def test_directions_are_of_the_drives_that_have_friction() -> None:
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    curves = FrictionCurves({"z2": TUSTIN, "z3": CoulombViscous(9.0)})
    still, s = np.zeros((1, 3)), np.array([[0.7, 0.5, -1.0]])
    two, three = TUSTIN.torque(0.0, 0.5), -9.0
    np.testing.assert_allclose(curves.joint_torque(robot, still, still, s), [[0.0, two + three, three]])


def test_joints_stand_for_drives_where_none_are_described() -> None:
    robot = built_in("panda")
    dq = np.full((1, 7), -0.5)
    found = FrictionCurves({"panda_joint4": CoulombViscous(1.0, 2.0)}).joint_torque(robot, dq, dq)
    np.testing.assert_allclose(found, [[0, 0, 0, -2.0, 0, 0, 0]])
    assert not FrictionCurves.of_robot(robot).curves


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CoulombViscous(-1.0), "coulomb must be zero or more, given -1"),
        (lambda: CoulombViscous(1.0, np.nan), "viscous must be a finite number, given nan"),
        (lambda: Side(1.0, stribeck=0.0), "stribeck must be greater than zero, given 0"),
        (lambda: TableFriction([0.1, 0.2], [1.0]), "2 speeds and 1 torques"),
        (lambda: TableFriction([0.2, 0.1], [1.0, 2.0]), "speeds must increase, given 0.2 before 0.1"),
        (lambda: TableFriction([0.0, 0.1], [1.0, 2.0]), "at speed zero"),
        (lambda: TableFriction([-2.0, -1.0], [1.0, 2.0]), "all speeds are negative"),
        (lambda: TableFriction([1.0], [np.inf]), "must be finite"),
        (lambda: FunctionFriction(np.sign).table(), "needs its fastest speed, given None"),
        (lambda: FunctionFriction(lambda v: 1.0).torque([1.0, 2.0]), r"returned shape \(\)"),
    ],
)
def test_impossible_curves_are_refused(make: Callable[[], object], message: str) -> None:
    assert re.search(message, refusal(make))


# --- files -----------------------------------------------------------------------------------------------------------


def test_files_read_back_to_the_same_curves(tmp_path: Path) -> None:
    path = tmp_path / "friction.yaml"
    names = ("z1", "shoulder pan", "no", "q3", "x:1", "half")
    curves = FrictionCurves(dict(zip(names, CURVES.values(), strict=True)))
    kept = {name: curve for name, curve in curves.curves.items() if not isinstance(curve, Scaled)}
    write_friction(FrictionCurves({**kept, "tiny": CoulombViscous(1e-05, 1 / 3)}), path)
    found = read_friction(path)
    assert list(found.curves) == [*kept, "tiny"]
    assert found.curve("tiny") == CoulombViscous(1e-05, 1 / 3)
    assert found.curve("shoulder pan") == TUSTIN
    v = np.linspace(-2, 2, 101)
    for name in ("z1", "no", "q3"):
        np.testing.assert_array_equal(found.curve(name).torque(v), curves.curve(name).torque(v))


HEAD = "schema: excite.friction/1\ndrives:\n"
PLAIN = HEAD + "  z1:\n    model: coulomb-viscous\n    coulomb: 14.1\n    viscous: 25\n"
TABLE = HEAD + "  z1:\n    model: table\n    speed: [1]\n    torque: [1]\n"


def test_a_file_written_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "friction.yaml"
    path.write_text(
        PLAIN + "    temperature: {reference: 31.2, coulomb: -1.1e-1, range: [20, 45]}\n"
        "    uncertainty: {parameters: [coulomb, viscous], covariance: [[4e-2, -1e-2], [-1e-2, 0.01]]}\n"
        "  z2:\n"
        "    model: stribeck\n"
        "    forward: {coulomb: 14, viscous: 26, stiction: 16.8, stribeck: 5e-2, exponent: 1}\n"
        "    backward: {coulomb: 9, viscous: 20, stiction: 10.6, stribeck: 0.08}\n"
        "    offset: 0.4\n"
        "  z3: {model: table, speed: [0.1, 0.5], torque: [18, 25]}\n"
        "  z4: {model: coulomb-viscous, coulomb: 1, viscous: 2, load: {forward: 0.1, backward: 0.2}, temperature: "
        "{reference: 30, forward: {coulomb: 0.1}, backward: {viscous: 0.2}}}\n",
        encoding="utf-8",
    )
    curves = read_friction(path)
    assert curves.curve("z1") == Warm(CoulombViscous(14.1, 25.0), 31.2, Slope(-0.11, 0.0), range=(20.0, 45.0))
    np.testing.assert_allclose(curves.uncertainty["z1"].deviation, [0.2, 0.1])
    assert curves.curve("z2") == TUSTIN
    assert curves.curve("z3").torque(-0.3) == pytest.approx(-21.5)
    sided = Warm(CoulombViscous(1.0, 2.0), 30.0, Slope(0.1), Slope(0.0, 0.2))
    assert curves.curve("z4") == Loaded(sided, 0.1, 0.2)


BAD = [
    ("drives: {}\n", r"schema \(line 1\): is missing"),
    ("schema: excite.friction/2\ndrives: {}\n", r"schema \(line 1\): .*'excite.friction/1', given 'excite.frictio"),
    (HEAD + "  z1: {model: magic}\n", r"drives\.z1\.model \(line 3\): .*'coulomb-viscous'"),
    (HEAD + "  z1:\n    model: coulomb-viscous\n    coulomb: 1\n", r"drives\.z1\.viscous \(line 3\): is missing;"),
    (TABLE + "    offset: 2\n", r"offset \(line 7\): does not"),
    (HEAD + "  z1: {model: stribeck, forward: {coulomb: 1, speed: 2}}\n", r"forward\.speed \(line 3\): no such fi"),
    (HEAD + "  z1: {model: table, speed: [2, 1], torque: [1, 2]}\n", r"drives\.z1 \(line 3\): .*speeds must incre"),
    (HEAD + "  z1: {model: coulomb-viscous, coulomb: .nan, viscous: 0}\n", r"coulomb \(line 3\): must be a number"),
    (HEAD + "  z1: [\n", "not valid YAML"),
]
BAD_ENTRIES = [
    ("temperature: {coulomb: 1}", r"temperature\.reference \(line 7\): is missing"),
    ("temperature: {reference: 30}", r"temperature \(line 7\): give coulomb or viscous here, or in forward"),
    ("temperature: {reference: 30, coulomb: 1, forward: {coulomb: 1}}", r"temperature\.coulomb \(line 7\): give it h"),
    ("temperature: {reference: 30, coulomb: 1, range: [45, 20]}", r"line 7\): .*lowest and its highest, given 45, 20"),
    ("temperature: {reference: .nan, coulomb: 1}", r"temperature\.reference \(line 7\): must be a number"),
    ("temperature: {reference: 30, forward: {stiction: 1}}", r"temperature\.forward\.stiction \(line 7\): no such f"),
    ("load: 1.5", r"line 7.*load forward must be at least 0 and below 1, given 1.5"),
    ("load: {forward: 0.1}", "line 7.*backward"),
    (
        "load: much",
        r"load \(line 7\): must be a number, given the text .much.; drives.*load \(line 7\): should be a map",
    ),
    ("uncertainty: {parameters: [coulomb]}", r"z1\.uncertainty\.covariance \(line 7\): is missing"),
    ("uncertainty: {parameters: [], covariance: []}", r"z1\.uncertainty\.parameters \(line 7\): .*at least 1 item"),
    ("uncertainty: {parameters: [x], covariance: [[1]]}", r"parameters\[1\] \(line 7\): no parameter 'x'; available"),
    ("uncertainty: {parameters: [coulomb, coulomb], covariance: [[1, 0], [0, 1]]}", r"\(line 7\): .*coulomb.* twice"),
    ("uncertainty: {parameters: [coulomb, offset], covariance: [[1, 0], [0]]}", r"covariance\[2\] \(line 7\): needs 2"),
    ("uncertainty: {parameters: [coulomb, offset], covariance: [[1, 0]]}", "covariance .line 7.: needs 2 rows.*given"),
    ("uncertainty: {parameters: [coulomb], covariance: [[-1]]}", "variance of coulomb must be zero or more, given -1"),
    ("uncertainty: {parameters: [coulomb, offset], covariance: [[1, 0.5], [0.4, 1]]}", "given 0.5 for .*, but 0.4"),
    ("uncertainty: {parameters: [coulomb, offset], covariance: [[1, 2], [2, 1]]}", "with the eigenvalue -1"),
]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *BAD,
        *((f"{PLAIN}    {entry}\n", message) for entry, message in BAD_ENTRIES),
        (TABLE + "    uncertainty: {parameters: [coulomb], covariance: [[1]]}\n", "a table has no parameters"),
    ],
)
def test_bad_files_are_refused_with_the_line(text: str, message: str) -> None:
    assert re.search(message, refusal(friction_of, text, "f.yaml", begins="f.yaml"))
