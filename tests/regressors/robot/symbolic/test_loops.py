"""Closed loops beside the closed form of a four-bar and MuJoCo's own constraints."""

from __future__ import annotations

from functools import cache

import casadi as ca
import mujoco
import numpy as np
import pytest
from linkages import FOUR_BAR, PARALLELOGRAM, joint_angles, linkage, played, robot_of_text

from regressors.errors import InputError, UnknownName
from regressors.robot.archive import robot_from_description
from regressors.robot.closures import Closure
from regressors.robot.robot import Robot
from regressors.robot.symbolic.loops import CLOSED, closure_residual, loops_of
from regressors.samples import Samples


@cache
def robot_of(lengths: tuple[float, ...] = FOUR_BAR) -> Robot:
    return robot_of_text("linkage", linkage("linkage", lengths))


def test_a_crank_turns_all_round() -> None:
    loops, q1 = loops_of(robot_of()), np.linspace(-7.0, 7.0, 300)
    q, left = loops.reached(q1[:, None])
    assert loops.names == ("q1",)
    assert left.max() <= CLOSED
    np.testing.assert_allclose(q, joint_angles(FOUR_BAR, q1), atol=1e-9)


def test_positions_from_known_configurations_are_those_of_the_closed_form() -> None:
    loops, q1 = loops_of(robot_of()), np.random.default_rng(0).uniform(-9.0, 9.0, 500)
    q, left = loops.solved(q1[:, None])
    assert left.max() <= CLOSED
    np.testing.assert_allclose(q, joint_angles(FOUR_BAR, q1), atol=1e-9)


def test_slopes_of_all_joints_are_those_of_differences() -> None:
    loops, rng, h = loops_of(robot_of()), np.random.default_rng(1), 1e-6
    motion, slopes = rng.uniform(-1.5, 1.5, (3, 1, 40)), rng.normal(size=(3, 3, 40))
    q, *_ = loops.moved(motion)
    found = loops.pullback(q, motion[1:], slopes)
    for k in range(3):
        step = np.zeros((3, 1, 40))
        step[k] = h
        ahead, behind = (loops.moved(each) for each in (motion + step, motion - step))
        change = sum(np.sum(s * (a - b), axis=0) for s, a, b in zip(slopes, ahead, behind, strict=True)) / (2 * h)
        np.testing.assert_allclose(found[k][0], change, rtol=1e-6, atol=1e-6)


def test_where_loops_do_not_close_they_are_left_open() -> None:
    """A crank that is longer than its neighbours reach cannot turn all round; nothing is made up beyond."""
    loops = loops_of(robot_of((0.3, 0.2, 0.25, 0.4)))
    beyond = np.array([[3.0]])
    _, left = loops.solved(beyond)
    assert left[0] > CLOSED
    q, *_ = loops.moved([beyond, np.zeros((1, 1)), np.zeros((1, 1))])
    gap = np.array(ca.Function("g", [x := ca.SX.sym("q", 3)], [closure_residual(loops.robot, x)])(q))
    assert np.abs(gap).max() > 1e-3


def test_a_parallelogram_moves_its_coupler_without_turning() -> None:
    q1 = np.linspace(-0.9, 1.9, 50)
    q, left = loops_of(robot_of(PARALLELOGRAM)).reached(q1[:, None])
    assert left.max() <= CLOSED
    np.testing.assert_allclose(q, np.column_stack([q1, -q1, q1]), atol=1e-9)


def test_rates_are_derivatives_along_the_motion() -> None:
    loops, middle, half = loops_of(robot_of()), 0.4, 0.3
    nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
    chebyshev = np.polynomial.chebyshev
    v, a, j = 1.3, -2.1, 4.0
    angles = joint_angles(FOUR_BAR, middle + half * nodes).T
    curves = [chebyshev.Chebyshev(chebyshev.chebfit(nodes, x, 23)) for x in angles]
    d1, d2, d3 = (np.array([curve.deriv(k)(0.0) for curve in curves]) / half**k for k in (1, 2, 3))
    given = (np.array([[x, 9.0, 9.0]]) for x in (v, a, j))  # what dependent joints are given does not count
    found = loops.rates(Samples(np.zeros(1), joint_angles(FOUR_BAR, np.array([middle])), *given))
    np.testing.assert_allclose(found.dq[0], d1 * v, rtol=1e-9)
    np.testing.assert_allclose(found.ddq[0], d2 * v**2 + d1 * a, rtol=1e-8)
    np.testing.assert_allclose(found.dddq[0], d3 * v**3 + 3 * d2 * v * a + d1 * j, rtol=1e-7)


def test_mujoco_moves_the_same_way() -> None:
    log = played(FOUR_BAR, linkage("linkage", FOUR_BAR), 0.0, 0, middle=0.2, swing=2.2)
    q = np.column_stack([log[f"q{k}.position"] for k in (1, 2, 3)])
    found, left = loops_of(robot_of()).reached(q[:, :1])
    assert left.max() <= CLOSED
    assert np.ptp(q[:, 0]) > 2.0
    np.testing.assert_allclose(found, q, atol=2e-6)  # its constraints are soft


SPATIAL = """<mujoco><compiler angle="radian"/><worldbody><body name="frame" pos="0.1 0 0" euler="0.3 0 0">
<body name="a" pos="0 0.1 0.2" euler="0.2 0.4 0"><joint name="j1" axis="0 0.6 0.8" pos="0.03 0 0.02" ref="0.1"/>
<geom size="0.1" mass="1"/><body name="plate" pos="0.1 0 0.1" euler="0 0.7 0"><geom size="0.1" mass="1"/>
<site name="s" pos="0.01 0.02 0.03"/></body>
<body name="b" pos="0.2 0 0.1"><joint name="j2" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/>
<body name="c" pos="0 0.2 0"><joint name="j3" axis="1 0 0" pos="0 0 0.05"/><geom size="0.1" mass="1"/>
<site name="t" pos="0.04 0 0" euler="0 0.2 0"/></body></body></body></body></worldbody>
<equality>{}</equality><actuator><motor joint="j1"/></actuator></mujoco>"""
EQUALITIES = {
    "connect": '<connect body1="c" body2="plate" anchor="0.1 0.2 0.3"/>',
    "to the world": '<connect body1="b" body2="frame" anchor="0.1 0.2 0.3"/>',
    "at sites": '<connect site1="s" site2="t"/>',
    "weld": '<weld body1="plate" body2="c" anchor="0.1 0 0.2"/>',
    "weld of sites": '<weld site1="t" site2="s"/>',
}


@pytest.mark.parametrize("equality", EQUALITIES.values(), ids=EQUALITIES)
def test_residuals_are_those_of_mujoco(equality: str) -> None:
    """Distances of the points alike, and angles between the held axes."""
    robot = robot_of_text("linkage", SPATIAL.format(equality))
    model = mujoco.MjModel.from_xml_string(SPATIAL.format(equality))
    data, q = mujoco.MjData(model), ca.SX.sym("q", robot.n)
    residual = ca.Function("g", [q], [closure_residual(robot, q)])
    for state in np.random.default_rng(0).uniform(-0.7, 0.7, (5, 3)):
        data.qpos[:] = state
        mujoco.mj_forward(model, data)
        theirs = np.array(data.efc_pos[: model.neq * (6 if "weld" in equality else 3)])
        ours = np.array(residual(state)).ravel()
        np.testing.assert_allclose(np.linalg.norm(ours[:3]), np.linalg.norm(theirs[:3]), rtol=1e-9)
        if ours.size > 3:
            half = np.arcsin(np.linalg.norm(theirs[3:]))
            np.testing.assert_allclose(np.linalg.norm(ours[3:]), np.abs(np.sin(2 * half)), rtol=1e-9)


def test_what_does_not_close_is_refused_with_what_is_left_open() -> None:
    lengths = (0.3, 0.2, 0.25, 0.4)  # its longest bar is too long for the crank to turn all round
    robot = robot_of_text("linkage", linkage("rocking", lengths))
    loops, q1 = loops_of(robot), np.linspace(0.0, 2.0, 21)
    q, left = loops.closed(np.column_stack([q1, np.zeros((21, 2))]))
    with pytest.raises(InputError, match=r"does not close at \d+ of 21 instants, first at .*q1 = .* left open"):
        loops.check(q1, q, left, "run.csv")
    q, left = loops.reached(q1[:, None])  # on the way there, the coupler and the rocker come to lie in line
    with pytest.raises(InputError, match="is at or beyond a singular configuration"):
        loops.check(q1, q, left, "run.csv")


def test_singular_configurations_are_refused_and_not_passed() -> None:
    loops, q1 = loops_of(robot_of(PARALLELOGRAM)), np.array([0.5, np.deg2rad(120.0), 2.5])
    q, left = loops.reached(q1[:, None])
    assert (left <= CLOSED).tolist() == [True, False, False]
    with pytest.raises(
        InputError, match=r"is at or beyond a singular configuration at 2 of 3 instants.*q1 cannot determine q2, q3"
    ):
        loops.check(q1, q, left, "run.csv")


def four_bar(**changes: object) -> Robot:
    return robot_of().replace(**changes)


def point(x: float) -> tuple[Closure, ...]:
    return (Closure(("coupler", "rocker"), ((x, 0.0, 0.0), (0.25, 0.0, 0.0))),)


REFUSED = {
    "bars too short": ({"closures": point(-2.0)}, "does not close near home; .* m are left open; check the points"),
    "no freedom": (
        {"closures": (*point(0.35), Closure(("base", "coupler"), ((0.06, 0.10392304845413264, 0), (0.0, 0.0, 0.0))))},
        "leaves no joint free|does not close near home",
    ),
}


@pytest.mark.parametrize(("changes", "message"), REFUSED.values(), ids=REFUSED)
def test_loops_that_determine_nothing_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        loops_of(four_bar(**changes))


def test_a_second_drive_follows_the_first_one() -> None:
    assert not loops_of(four_bar()).redundant
    loops = loops_of(four_bar(passive=("q2",)))
    assert loops.redundant
    assert "q2" not in loops.names
    assert [four_bar().joint_names[k] for k in loops.driven] == ["q1", "q3"]


def test_closures_name_what_there_is() -> None:
    with pytest.raises(UnknownName, match="no body of robot 'linkage'"):
        four_bar(closures=(Closure(("coupler", "bar"), ((0.0, 0.0, 0.0),) * 2),))
    with pytest.raises(UnknownName, match="no passive joint of robot 'linkage'"):
        four_bar(passive=("q9",))
    with pytest.raises(InputError, match="but it has no loop; state `loops:`, or leave out `passive:`"):
        four_bar(closures=())
    with pytest.raises(InputError, match="given 'a' twice"):
        Closure(("a", "a"), ((0.0, 0.0, 0.0),) * 2)


def test_open_robots_keep_their_descriptions() -> None:
    robot = robot_of()
    opened = robot.replace(closures=(), passive=())
    assert {"closures", "passive"} == robot.description().keys() - opened.description().keys()
    back = robot_from_description(robot.description())
    assert (back.closures, back.passive, back.sha256()) == (robot.closures, robot.passive, robot.sha256())
    assert opened.sha256() != robot.sha256()
