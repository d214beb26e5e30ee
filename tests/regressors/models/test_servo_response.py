"""Simulated servos against what mechanics says of them: linear motion, stick, delay, limit of torque, dead band."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pinocchio_chains import joint_torques
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from regressors.models.servo_response import QUANTITIES, SYMBOLS, Windows, arm_torques, response, scale_shown_by
from regressors.readers.library import built_in
from regressors.samples import Array, Samples

RATE, OWN = 50.0, 0.03  # of the rows [Hz], and inertia of the arm [kg m^2]
PLAIN = {"K": 12.0, "D": 0.9, "J": 0.02, "L": 1e5}


def servo(**given: float) -> Array:
    """One servo without friction, offset, delay, dead band and limit, but for what is given, shape (1, 1, p)."""
    assert given.keys() <= set(SYMBOLS)
    return np.array([[[{**PLAIN, **given}.get(symbol, 0.0) for symbol in SYMBOLS]]])


def windows(command: Array, load: Any = 0.0, start: Any = 0.0, speed: Any = 0.0, lead: int = 10) -> Windows:
    """Stretches that begin at some positions and speeds; before them the first command was given."""
    command = np.atleast_2d(command)
    told = np.hstack([np.repeat(command[:, :1], lead, axis=1), command])
    shape, count = command.shape, len(command)
    full = np.broadcast_to(np.asarray(load, dtype=float), shape).copy()
    measured = np.repeat(np.broadcast_to(np.asarray(start, dtype=float), count)[:, None], shape[1], axis=1)
    speeds = np.broadcast_to(np.asarray(speed, dtype=float), count).copy()
    return Windows(np.full(count, 1 / RATE), told, full, np.full(shape, OWN), measured, measured[:, 0], speeds)


def of_linear_servo(times: Any, start: Array) -> Array:
    """Deviation from the end of ``(m + J) e'' + D e' + K e = 0`` at some times, by the matrix exponential."""
    own = OWN + PLAIN["J"]
    A = np.array([[0.0, 1.0], [-PLAIN["K"] / own, -PLAIN["D"] / own]])
    return np.array([(expm(A * t) @ start)[0] for t in times])


def test_without_friction_and_limits_a_servo_is_a_linear_one_to_second_order() -> None:
    # a window of N substeps, one to a row: the error at the same instants falls by four when the step is halved
    errors = []
    for step in (0.004, 0.002, 0.001):
        count = round(1.0 / step) + 1
        w = windows(np.full(count, 0.5), start=0.1, speed=-1.0)
        path = response(servo(), replace(w, step=np.array([step]), longest_step=step))[0, 0]
        exact = 0.5 + of_linear_servo(step * np.arange(count), np.array([0.1 - 0.5, -1.0]))
        errors.append(np.abs(path - exact).max())
    assert errors[0] < 2e-3
    assert errors[:-1] / np.array(errors[1:]) == pytest.approx(4.0, rel=0.05)


def test_a_constant_load_deflects_a_servo_by_its_compliance_and_its_offset() -> None:
    end = response(servo(b=0.02), windows(np.full(300, 0.3), load=0.6))[0, 0, -1]
    assert end == pytest.approx(0.3 - 0.02 - 0.6 / PLAIN["K"], abs=1e-9)


@pytest.mark.parametrize(("each", "most"), [(1, 4e-4), (6, 2e-5)])
def test_a_load_that_varies_moves_a_linear_servo_as_its_equation_says(each: int, most: float) -> None:
    # taken as linear between rows, which makes the load (w h)^2 / 12 too small, or between several instants of each
    count, own = 60, OWN + PLAIN["J"]
    load = lambda t: 0.8 * np.sin(2 * np.pi * 2.0 * t)  # noqa: E731
    w = windows(np.zeros(count))
    instants = np.arange(1 + (count - 1) * each) / (RATE * each)
    given = replace(w, load=load(instants)[None], inertia=np.full((1, instants.size), OWN))
    times = np.arange(count) / RATE
    rate = lambda t, x: [x[1], (-PLAIN["K"] * x[0] - PLAIN["D"] * x[1] - load(t)) / own]  # noqa: E731
    exact = solve_ivp(rate, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12).y[0]
    path = response(servo(), replace(given, longest_step=1 / (RATE * 24)))[0, 0]
    assert np.ptp(exact) > 0.1
    assert np.abs(path - exact).max() < most


@pytest.mark.parametrize(
    ("friction", "most"), [({"Fc": 0.2}, 0.2), ({"Fs": 0.2}, 0.2), ({"mu": 0.4}, 0.2), ({"Fc": 0.1, "mu": 0.2}, 0.2)]
)
@pytest.mark.parametrize("load", [0.5, -0.5])
def test_a_joint_sticks_while_friction_can_hold_it_and_slips_beyond(
    friction: dict[str, float], most: float, load: float
) -> None:
    pulls = np.array([-1.5, -1.01, -0.99, -0.5, 0.0, 0.7, 0.99, 1.01, 1.5]) * most
    commands = (load + pulls) / PLAIN["K"]  # K e - tau
    path = response(servo(**friction), windows(np.repeat(commands[:, None], 100, axis=1), load=load))[0]
    stuck = np.abs(pulls) < most
    assert (path[stuck] == 0.0).all()
    assert (np.sign(path[~stuck, -1]) == np.sign(pulls[~stuck])).all()


def test_a_joint_that_slides_stops_once_and_stays() -> None:
    path = response(servo(Fc=0.3), windows(np.full(200, 0.1), speed=2.0))[0, 0]
    stop = np.flatnonzero(path == path[-1])[0]
    assert stop < 100
    assert (path[stop:] == path[-1]).all()
    assert PLAIN["K"] * np.abs(0.1 - path[-1]) < 0.3


@pytest.mark.parametrize("rows", [1, 3, 6])
def test_a_delay_of_whole_rows_shifts_the_motion_by_them(rows: int) -> None:
    rng = np.random.default_rng(0)
    command = np.concatenate([np.zeros(10), np.cumsum(rng.normal(0.0, 0.05, 90))])
    values = {"Fc": 0.05, "delta": 0.003}
    at_once, late = (response(servo(d=delay, **values), windows(command))[0, 0] for delay in (0.0, rows / RATE))
    assert np.ptp(at_once) > 0.1
    np.testing.assert_allclose(late[rows:], at_once[:-rows], atol=1e-12)
    assert (late[: 10 + rows] == 0.0).all()


def test_variants_and_stretches_may_have_delays_of_their_own() -> None:
    rng = np.random.default_rng(2)
    w = windows(rng.normal(0.0, 0.2, (3, 60)).cumsum(axis=1), start=[0.0, 0.1, -0.2])
    single = np.array([[response(servo(d=d), w)[0, k] for k in range(3)] for d in (0.0, 0.013, 0.07)])
    each = np.concatenate([servo(d=d) for d in (0.0, 0.013, 0.07)])
    np.testing.assert_allclose(response(each, w), single, atol=1e-12)
    of_each = np.concatenate([servo(d=d) for d in (0.0, 0.013, 0.07)], axis=1)
    np.testing.assert_allclose(response(of_each, w)[0], single[[0, 1, 2], [0, 1, 2]], atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_at_the_limit_of_torque_the_acceleration_is_that_torque_over_the_inertia(sign: float) -> None:
    own, t = OWN + PLAIN["J"], np.arange(20) / RATE
    path = response(servo(L=0.4, D=0.0), windows(np.full(20, sign * 50.0)))[0, 0]
    np.testing.assert_allclose(path, sign * 0.4 / own * t**2 / 2, rtol=1e-9, atol=1e-12)
    pulled = response(servo(L=0.4, D=0.0, Fc=0.1), windows(np.full(20, sign * 50.0), load=0.05 * sign))[0, 0]
    np.testing.assert_allclose(pulled, sign * (0.4 - 0.05 - 0.1) / own * t**2 / 2, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_damping_takes_from_a_motor_at_its_limit_until_no_torque_is_left(sign: float) -> None:
    path = response(servo(L=0.4, Fc=0.1), windows(np.full(60, sign * 50.0), load=0.05 * sign))[0, 0]
    speed = sign * (0.4 - 0.1 - 0.05) / PLAIN["D"]
    np.testing.assert_allclose(np.diff(path)[-20:] * RATE, speed, rtol=1e-6)


def test_within_the_dead_band_a_servo_does_not_pull() -> None:
    commands = np.array([-0.0051, -0.0049, 0.0, 0.0049, 0.0051])
    path = response(servo(delta=0.005), windows(np.repeat(commands[:, None], 200, axis=1)))[0]
    assert (path[1:4] == 0.0).all()
    assert path[[0, 4], -1] == pytest.approx([-1e-4, 1e-4], rel=0.3)  # up to the edge of the band


def test_the_arms_torques_are_those_of_pinocchio_split_by_the_joints_own_inertia() -> None:
    robot = built_in("so101")
    q, dq, ddq = np.random.default_rng(4).normal(size=(3, 15, robot.n))
    time = np.arange(15) / RATE
    load, own = arm_torques(robot)(q, dq, ddq)
    whole = joint_torques(robot, Samples(time, q, dq, ddq, 0 * q))
    np.testing.assert_allclose(load + own * ddq, whole, atol=1e-10)
    for j in range(robot.n):
        still = joint_torques(robot, Samples(time, q, dq, np.where(np.arange(robot.n) == j, 0.0, ddq), 0 * q))
        np.testing.assert_allclose(load[:, j], still[:, j], atol=1e-10)


def test_gravity_fast_motion_or_a_known_mass_tells_how_large_torques_are() -> None:
    robot = built_in("so101")
    told = dict(zip(robot.joint_names, scale_shown_by(robot), strict=True))
    assert told["shoulder_pan"][0] == 0.0  # its axis is upright
    assert [words for _, _, words in told.values()] == ["fast motion", *["gravity"] * 3, *["a known mass in hand"] * 2]
    rng, time = np.random.default_rng(5), np.arange(1000) / RATE
    q = rng.uniform(robot.limits.lower, robot.limits.upper, (1000, robot.n))
    at_rest = np.abs(joint_torques(robot, Samples(time, q, 0 * q, 0 * q, 0 * q))).max(axis=0)
    np.testing.assert_allclose([load for load, _, _ in told.values()], at_rest, rtol=0.05, atol=1e-9)


def test_quantities_have_a_symbol_each_and_limits_about_their_size() -> None:
    assert len(set(SYMBOLS)) == len(QUANTITIES)
    for q in QUANTITIES:
        assert q.least <= q.size <= q.most or q.symbol in ("d", "delta")
        assert q.scales == (("N" in q.unit and q.symbol != "mu") or q.symbol == "J")
