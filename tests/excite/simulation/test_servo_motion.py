"""Motion that servos make of a design: laws, a plant in MuJoCo, what its log identifies, and what is refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from motions import random_fourier
from refused import refusal
from scipy.integrate import solve_ivp
from servo_arm import JOINTS, played, small_arm, true_servos

import excite
from excite.identification.servo_result import ServoResult
from excite.simulation.servo_motion import followed
from excite.simulation.simulation import Simulation
from excite.tasks.reference import MotionSource
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.errors import InputError
from regressors.models.servo_response import SYMBOLS, arm_torques
from regressors.readers.library import built_in
from regressors.robot.robot import transmission_of
from regressors.samples import Array

RATE, DURATION = 250.0, 6.0


@cache
def source() -> MotionSource:
    motion = random_fourier(3, 3, DURATION)
    return MotionSource(small_arm(), Task(small_arm()), motion, None, None, {"design": None, "friction_plan": None})


def simulated(result: ServoResult, **options: Any) -> Simulation:
    return excite.simulate(source(), servos=result, rate=RATE, beyond_limits=True, **options)


STIFF = {"K": 5e4, "D": 5e2, "J": 1e-3, "Fc": 0.0, "b": 0.0, "d": 0.0, "L": 1e5}


def test_stiff_servos_without_delay_make_what_they_are_told() -> None:
    simulation = simulated(true_servos(**STIFF))
    assert simulation.outcome.tracking[0].error < 0.01 * 2.0
    lag = STIFF["D"] / STIFF["K"] + 0.5 / RATE  # of damping, and of a command that is held
    wanted = source().motion.samples(np.clip(simulation.log.time - lag, 0.0, DURATION)).q
    np.testing.assert_allclose(simulation.log.q, wanted, atol=1e-3)
    np.testing.assert_allclose(simulation.log.command, source().motion.samples(simulation.log.time).q, atol=1e-12)
    commanded, tracked = (simulation.tracked[name]["condition_number"] for name in ("commanded", "tracked"))
    assert tracked == pytest.approx(commanded, rel=0.02)


def test_a_delay_shifts_the_motion_and_nothing_else() -> None:
    early, late = (simulated(true_servos(**{**STIFF, "d": d})).log.q for d in (0.0, 0.06))
    shift = round(0.06 * RATE)
    np.testing.assert_allclose(late[shift:], early[:-shift], atol=1e-5)


def test_at_rest_gravity_deflects_the_servos_by_their_torque_over_their_stiffness() -> None:
    resting = replace(source(), motion=Trajectory(Fourier(2.0, 4), np.zeros((3, Fourier(2.0, 4).size))))
    told = true_servos(Fc=0.0, b=0.0)
    simulation = excite.simulate(resting, servos=told, rate=RATE)
    bent = simulation.log.command - simulation.log.q
    np.testing.assert_allclose(told.of("K") * bent[-1], simulation.log.effort[-1], atol=2e-3)
    assert abs(bent[-1, 0]) > 0.05


def test_the_motion_is_that_of_mujoco() -> None:
    time = np.arange(round(DURATION * RATE) + 1) / RATE
    log = played(source().motion.samples(time).q, "mujoco", rate=RATE, encoder=1e-6)
    simulation = simulated(true_servos())
    moved = time > 1.0  # before, friction keeps them where they were put
    np.testing.assert_allclose(simulation.log.q[moved], log.q[moved], atol=1e-3)


def test_its_torques_are_those_of_the_arm_with_its_rotors_and_friction() -> None:
    old = transmission_of(small_arm())
    drives = tuple(replace(drive, rotor_inertia=0.01, coulomb=0.1) for drive in old.drives)
    driven = small_arm().replace(transmission=replace(old, drives=drives))
    compensated = driven.replace(gravity=np.zeros(3))  # for the servos, and not for their torques
    simulation = simulated(replace(true_servos(), robot=compensated))
    run = simulation.run
    load, inertia = arm_torques(small_arm())(run.samples.q, run.samples.dq, run.samples.ddq)
    expected = load + (inertia + 0.01) * run.samples.ddq + 0.1 * np.sign(run.samples.dq)
    np.testing.assert_allclose(simulation.log.effort, expected, atol=1e-9)
    assert simulation.energy_residual < 0.02 * run.loss[-1]
    assert simulation.truth["Ia1"] == 0.01
    assert simulation.truth["F2c"] == 0.1
    assert simulation.record.settings["controller"] == "servos"
    result = excite.identify(small_arm(), simulation.log, joint_rotors=True, choose=())
    assert result.training_error < 0.02


@pytest.mark.parametrize(("name", "inertia"), [("so101", 0.01), ("ur10e", 0.1), ("panda", 0.01)])
def test_coupled_joints_move_as_one_system_of_equations(name: str, inertia: float) -> None:
    """Servos of 5 Hz without friction, against an integration of the whole arm."""
    robot, rate, w = built_in(name), 500.0, 2 * np.pi * 5.0
    n, needs, time = robot.n, arm_torques(robot), np.arange(round(2.0 * rate) + 1) / rate
    motion = random_fourier(n, 0, 2.0, 0.15)
    command, still = motion.samples(time).q, np.zeros((1, n))
    own = np.median(needs(command, 0 * command, 0 * command)[1], axis=0) + inertia
    values = np.zeros((n, len(SYMBOLS)))
    for symbol, each in {"K": own * w**2, "D": 1.2 * own * w, "J": inertia, "L": 1e5}.items():
        values[:, SYMBOLS.index(symbol)] = each
    told = ServoResult(robot, values, 0 * values, (), (), 0)

    def slope(t: float, state: Array) -> Array:
        q, dq = np.split(state, 2)
        rows = np.vstack([still, np.eye(n)])
        load, arm = needs(np.tile(q, (n + 1, 1)), np.tile(dq, (n + 1, 1)), rows)
        tau = load + arm * rows
        M = (tau[1:] - tau[0]).T + inertia * np.eye(n)
        u = motion.samples(np.array([max(0.0, t - 0.5 / rate)])).q[0]  # held, it is half a step late
        return np.concatenate([dq, np.linalg.solve(M, own * w**2 * (u - q) - 1.2 * own * w * dq - tau[0])])

    start = np.concatenate([command[0], np.zeros(n)])
    whole = solve_ivp(slope, (0.0, 2.0), start, t_eval=time, rtol=1e-6, atol=1e-8, method="LSODA").y[:n].T
    path = followed(told, command, 1 / rate, command[0], np.zeros(n))
    assert np.abs(whole - command).max() > 0.05
    np.testing.assert_allclose(path, whole, atol=2e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bandwidth": 7.0}, "`bandwidth` is for a simulated controller, whose place servos take"),
        ({"breakaway": 1e-4}, "`breakaway` is for a simulated controller"),
        ({"load": "load.yaml"}, "`load` is not for servos"),
    ],
)
def test_what_is_for_controllers_is_refused(options: dict[str, Any], words: str) -> None:
    assert re.search(words, refusal(simulated, true_servos(), **options))


def test_servos_of_another_robot_and_of_which_nothing_is_known_are_refused() -> None:
    other = replace(source(), robot=excite.load_robot("so101"), task=Task("so101"))
    with pytest.raises(InputError, match=f"the servos are those of {', '.join(JOINTS)}, the robot of the motion has"):
        excite.simulate(other, servos=true_servos(), beyond_limits=True)
    half = np.zeros_like(true_servos().values)
    half[1] = np.inf
    with pytest.raises(InputError, match="nothing is known of the servo of elbow, which the motion moves"):
        simulated(replace(true_servos(), half_width=half))
