"""Simulated robots: dynamics against Pinocchio, balances, sensors, and logs from which the truth can be found."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from motions import Polynomials, order_of, random_fourier as motion
from pinocchio_chains import chain_model, inertia
from refused import refusal
from scipy.integrate import solve_ivp
from slow_dynamics import random_body, random_chain

from excite.design.interruption import answered_signals
from excite.errors import LostMotionError
from excite.simulation import integration
from excite.simulation.control import ControlledRobot, Controller
from excite.simulation.integration import Steps, simulated_run, steps_for
from excite.simulation.plant import Plant, plant_of
from excite.simulation.sensors import motor_angle, quantised
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import controlled_robot, simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.payload import Payload
from excite.tasks.reference import Repeated, SampledMotion
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.load import LoadModel, Sensor
from regressors.models.nominal import parameter_values
from regressors.readers.library import built_in
from regressors.robot.columns import Terms
from regressors.robot.friction.curve import CoulombViscous, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, smooth_direction
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.locked_joints import with_locked_joints
from regressors.samples import Array, Samples

NO_FRICTION = FrictionCurves({f"z{k}": CoulombViscous() for k in range(1, 6)})
LOOSE = SimulationSettings(rate=200.0, torque_limits=False)


@cache
def of_irp6() -> Simulation:
    """The first three axes with their own friction and exact sensors."""
    return simulated(SimulationSettings(rate=500.0, torque_limits=False))


def simulated(settings: SimulationSettings = LOOSE, **how: Any) -> Simulation:
    """The first three axes."""
    return simulate_motion(built_in("irp6"), Task("irp6"), how.pop("motion", motion(3)), settings, **how)


def acceleration_of(plant: Plant, states: Samples, tau: Array) -> Array:
    symbols = [ca.SX.sym(name, plant.robot.n) for name in ("q", "dq", "tau")]
    direction = smooth_direction(plant.robot, symbols[1], 1e-3)
    function = ca.Function("a", symbols, [plant.acceleration(*symbols, direction)[0]])
    return np.array(function.map(len(tau))(states.q.T, states.dq.T, tau.T)).T


def close(found: Array, expected: Array, relative: float = 1e-9) -> None:
    np.testing.assert_allclose(found, expected, atol=relative * max(1.0, float(np.abs(expected).max())))


# --- the equations of motion -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["panda", "ur10e", "sliders"])
def test_acceleration_is_that_of_the_articulated_body_algorithm(name: str) -> None:
    robot = random_chain("rprpr", np.random.default_rng(0)) if name == "sliders" else built_in(name)
    states, model = random_states(robot, 20, seed=1), chain_model(robot)
    tau = np.random.default_rng(2).normal(0.0, 20.0, (20, robot.n))
    data = model.createData()
    expected = [pin.aba(model, data, q, dq, t) for q, dq, t in zip(states.q, states.dq, tau, strict=True)]
    close(acceleration_of(plant_of(robot)[0], states, tau), np.array(expected))


def test_rotors_and_friction_of_drives_reach_the_joints_through_the_coupling() -> None:
    """``(M + C' R C) ddq = tau - bias - C' f(C dq)`` with Pinocchio's M and bias, solved by NumPy."""
    robot = built_in("irp6")
    states, model = random_states(robot, 20, seed=5), chain_model(robot)
    tau = np.random.default_rng(6).normal(0.0, 100.0, (20, 5))
    C = robot.transmission.coupling
    drives = robot.transmission.drives
    n2 = np.array([158.0, 167.5, 167.5, 128.0, 76.8]) ** 2
    R = np.diag(n2 * [drive.rotor_inertia for drive in drives])
    expected = []
    for q, dq, t in zip(states.q, states.dq, tau, strict=True):
        data = model.createData()
        upper = np.triu(pin.crba(model, data, q))
        M = upper + np.triu(upper, 1).T + C.T @ R @ C
        dz = C @ dq
        f = np.array([d.coulomb * np.tanh(v / 1e-3) + d.viscous * v for d, v in zip(drives, dz, strict=True)])
        expected.append(np.linalg.solve(M, t - pin.rnea(model, data, q, dq, 0 * q) - C.T @ f))
    close(acceleration_of(plant_of(robot)[0], states, tau), np.array(expected))


# --- what is logged --------------------------------------------------------------------------------------------------


def test_least_squares_finds_the_truth_in_a_log_without_noise() -> None:
    found = of_irp6()
    close(found.log.effort, found.run.effort, 0.0)
    model = DifferentialModel(found.robot, sign_width=found.steps.width)
    base = base_parameters(model)
    W = model.assemble(found.run.samples)[:, base.index]
    beta = np.linalg.lstsq(W, found.log.effort.reshape(-1), rcond=None)[0]
    close(beta, parameter_values(model, base, dict(found.truth)), 1e-6)
    published = dict(zip(base.names, beta, strict=True))
    assert published["X3"] - published["X4"] == pytest.approx(5.5, abs=0.01)  # [KD96]
    assert (published["F2c"], published["F2v"]) == pytest.approx((28.75, 26.0), abs=1e-6)


def test_friction_that_is_not_known_is_said() -> None:
    found = simulated(friction=FrictionCurves({"z1": TableFriction([0.01, 0.02], [28.0, 29.0])}))
    assert any("friction of z1" in note and "faster than its table" in note for note in found.notes)
    found = simulate_motion(built_in("panda"), Task("panda"), motion(7, duration=0.5), LOOSE)
    assert any("friction of panda_joint1, " in note and "counts as zero" in note for note in found.notes)
    assert found.truth["F7c"] == 0.0


# --- balances --------------------------------------------------------------------------------------------------------


def test_energy_balance_closes_at_order_four_without_friction() -> None:
    residuals = []
    for rate in (50.0, 100.0, 200.0):
        settings = SimulationSettings(rate=rate, controller="pd", bandwidth=1.0, torque_limits=False)
        found = simulated(settings, friction=NO_FRICTION)
        assert found.steps.substeps == 1
        residuals.append(found.energy_residual)
    assert min(order_of(residuals)) > 3.7
    assert residuals[-1] < 1e-4


def test_energy_balance_closes_with_friction() -> None:
    run = of_irp6().run
    assert run.loss[-1] > 20.0
    assert np.all(np.diff(run.loss) > -1e-12)
    assert of_irp6().energy_residual < 1e-5 * run.loss[-1]


def test_implicit_friction_converges_at_order_two_to_the_explicit_method() -> None:
    arm = with_locked_joints(built_in("panda"), [1, 3, 5])
    plant, _ = plant_of(arm, FrictionCurves(dict.fromkeys(arm.joint_names, CoulombViscous(2.0, 0.5))))
    course = motion(3, duration=1.5)
    robot = controlled_robot(plant, plant, course, LOOSE, None)

    def last(steps: Steps) -> Array:
        return simulated_run(robot, course, 200.0, steps).samples.q[-1]

    exact = last(Steps(60, 0.1))
    errors = [float(np.abs(last(Steps(s, 0.1, implicit=True)) - exact).max()) for s in (5, 10, 20)]
    assert min(order_of(errors)) > 1.7
    assert errors[-1] < 3e-7


def test_steep_friction_of_all_joints_is_that_of_a_stiff_solver() -> None:
    arm = built_in("panda")
    curves = FrictionCurves(
        {name: CoulombViscous(x, 0.3) for name, x in zip(arm.joint_names, (9, 9, 6, 6, 3, 3, 2), strict=True)}
    )
    plant, _ = plant_of(arm, curves)
    course = motion(7, duration=1.0, size=0.05)
    robot = controlled_robot(plant, plant, course, LOOSE, None)
    steps = steps_for(robot, course, 100.0, 0.01)
    assert steps.implicit
    found = simulated_run(robot, course, 100.0, steps).samples
    (x, given, memory), (rate, *_) = robot.instant(0.01)
    still = np.zeros(memory.numel())
    rates, slopes = (
        ca.Function("f", [x, given], [ca.densify(ca.substitute(f, memory, still))])
        for f in (rate, ca.jacobian(rate, x))
    )

    def inputs(t: float) -> Array:
        wanted = course.samples(np.array([t]))
        return np.concatenate([wanted.q[0], wanted.dq[0], wanted.ddq[0], [0.0]])

    exact = solve_ivp(
        lambda t, x: np.array(rates(x, inputs(t))).ravel(), (0.0, 0.5),
        np.concatenate([found.q[0], found.dq[0], np.zeros(2)]),
        method="Radau", jac=lambda t, x: np.array(slopes(x, inputs(t))), rtol=1e-6, atol=1e-8, t_eval=found.time[:51],
    )  # fmt: skip
    np.testing.assert_allclose(found.q[:51], exact.y[:7].T, atol=1e-4)
    np.testing.assert_allclose(found.dq[:51], exact.y[7:14].T, atol=1e-2)


def test_friction_of_a_light_link_stays_steep_and_in_balance_with_the_torques() -> None:
    light = built_in("panda")
    wrist = FrictionCurves({light.joint_names[-1]: CoulombViscous(2.0, 0.5)})
    settings = replace(LOOSE, rate=2000.0, sign_width=0.01)
    found = simulate_motion(light, Task("panda"), motion(7, duration=1.0, size=0.05), settings, friction=wrist)
    assert found.steps.implicit
    assert found.steps.substeps == 1
    speed = found.run.samples.dq[:, -1]
    expected = 2.0 * np.tanh(speed / found.steps.width) + 0.5 * speed
    np.testing.assert_allclose(found.run.friction[:, -1], expected, atol=1e-6)
    assert found.energy_residual < 1e-3 * found.run.loss[-1]
    assert np.all(np.diff(found.run.loss) > -1e-12)


def push(torque: float) -> Controller:
    """Constant torques."""
    return lambda q, *_: ca.densify(torque + 0 * q)


class Ringing(np.ndarray):
    """An array at which Ctrl-C is pressed while CasADi converts it, which swallows what is raised meanwhile."""

    @property
    def __DM__(self) -> Callable[[], ca.DM]:  # noqa: N802
        signal.raise_signal(signal.SIGINT)
        return lambda: ca.DM(np.asarray(self))


def test_ctrl_c_inside_compiled_steps_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    plant, _ = plant_of(with_locked_joints(built_in("irp6"), [0]))
    still = SampledMotion(Samples(np.array([0.0, 2.0]), *(np.zeros((2, 1)) for _ in range(4))))
    wanted, done = integration._wanted, list[int]()
    monkeypatch.setattr(integration, "_wanted", lambda *given: wanted(*given).view(Ringing))
    robot = ControlledRobot(plant, push(0.0))
    with pytest.raises(KeyboardInterrupt), answered_signals():
        simulated_run(robot, still, 1000.0, Steps(1, 1e-3), lambda some, _: done.append(some))
    assert done == [1000]


@pytest.mark.parametrize("most", [16.0, -10.0])
def test_below_break_away_a_joint_only_creeps(most: float) -> None:
    """Column of the IRp-6, no gravity along its axis, break-away torques 16.8 and 10.6 Nm."""
    width, robot = 1e-3, built_in("irp6")
    alone = with_locked_joints(robot, [0])
    stuck = FrictionCurves({"z1": Stribeck(Side(14.0, 25.0, 16.8), Side(9.0, 25.0, 10.6))})
    plant, _ = plant_of(alone, stuck)
    still = SampledMotion(Samples(np.array([0.0, 1.0]), *(np.zeros((2, 1)) for _ in range(4))))

    def speed(torque: float) -> float:
        pushed = ControlledRobot(plant, push(torque))
        return float(simulated_run(pushed, still, 500.0, Steps(8, width)).samples.dq[-1, 0])

    assert 0 < speed(most) * np.sign(most) < 3 * width
    assert abs(speed(1.2 * most)) > 100 * width


# --- control ---------------------------------------------------------------------------------------------------------


def worst(motion: Any = None, **options: object) -> float:
    how = {} if motion is None else {"motion": motion}
    return float(np.abs(simulated(replace(LOOSE, **options), **how).tracking_error).max())


def test_computed_torque_with_the_true_model_tracks_exactly_and_stiffer_control_better() -> None:
    assert worst(motion=SampledMotion(motion(3).sampled(100.0))) < 1e-6
    assert worst() < 1e-8
    assert 1e-5 < worst(model_error=0.1) < 0.02
    soft, stiff = worst(controller="pd", bandwidth=2.0), worst(controller="pd", bandwidth=8.0)
    assert 1e-3 < soft < 0.3
    assert stiff < soft / 8


@pytest.mark.parametrize("controller", ["computed-torque", "pd"])
def test_a_run_begins_settled(controller: str) -> None:
    """A controller that is wrong about gravity lets the joints sag before the run, not in it."""
    settings = replace(LOOSE, controller=controller, model_error=0.3)
    run = simulated(settings, friction=NO_FRICTION)
    assert np.abs(run.tracking_error[0]).max() > 1e-4
    assert np.abs(run.run.samples.ddq[0]).max() < 0.01 * np.abs(run.run.samples.ddq).max()
    assert (run.run.work[0], run.run.loss[0], run.log.time[0]) == (0.0, 0.0, 0.0)


def test_torques_saturate_at_the_drives() -> None:
    robot = built_in("irp6")
    limits = replace(robot.transmission.limits, torque=np.array([30.0, 60.0, 45.0, 1.0, 1.0]))
    weak = robot.replace(transmission=replace(robot.transmission, limits=limits))
    found = simulate_motion(weak, Task("irp6"), motion(3), SimulationSettings(rate=200.0))
    C = found.robot.transmission.coupling[:3]
    at_drives = found.run.effort @ np.linalg.inv(C)
    assert np.all(np.abs(at_drives) <= np.array([30.0, 60.0, 45.0]) + 1e-9)
    use = {torque.label: torque for torque in found.torques}
    assert list(use) == ["drive z1", "drive z2", "drive z3"]
    assert use["drive z1"].saturated == np.count_nonzero(np.abs(at_drives[:, 0]) > 30.0 - 1e-9)
    assert use["drive z1"].peak > use["drive z1"].limit == 30.0
    assert np.abs(found.tracking_error).max() > 1e-3


def test_a_motion_that_runs_away_is_told() -> None:
    faster = FrictionCurves({"z1": CoulombViscous(0.0, -5000.0)})
    settings = SimulationSettings(rate=1000.0, controller="pd", torque_limits=False, sign_width=0.01)
    with pytest.raises(LostMotionError, match=r"diverges at [\d.]+ s"):
        simulated(settings, friction=faster)


# --- the load --------------------------------------------------------------------------------------------------------


LOAD = Payload(random_body(np.random.default_rng(9)))


@cache
def loaded(**how: Any) -> Simulation:
    """All five axes with a load, and with noise of the wrench or another task where they are given."""
    task, noise = how.get("task", Task("irp6", model="load", **SHIFTED)), how.get("noise", (0.0,) * 2)
    settings = replace(LOOSE, wrench_rate=50.0, wrench_noise=noise)
    return simulate_motion(built_in("irp6"), task, motion(5), settings, load=LOAD)


SHIFTED = {"sensor": "5", "sensor_xyz": (0.02, -0.05, 0.1), "sensor_rpy": (0.3, -1.0, 2.0)}


def placement() -> object:
    return pin.SE3(rotation_from_rpy(SHIFTED["sensor_rpy"]), np.array(SHIFTED["sensor_xyz"]))


def test_noise_of_the_wrench_is_that_of_forces_then_of_torques() -> None:
    exact, noisy = loaded().wrench_log.wrench, loaded(noise=(2.0, 0.1)).wrench_log.wrench
    np.testing.assert_allclose(np.std(noisy - exact, axis=0), [2.0] * 3 + [0.1] * 3, rtol=0.25)


def test_the_wrench_moves_the_load() -> None:
    """Newton and Euler for the free body, by Pinocchio: ``I a + v x* I v`` less its weight, in the sensor's frame."""
    found, model = loaded(), chain_model(built_in("irp6"))
    body, place = inertia(LOAD.parameters), placement()
    step, run = 4, found.run.samples  # 200 Hz and 50 Hz
    for k in range(0, found.wrench_log.count, 17):
        data = model.createData()
        pin.forwardKinematics(model, data, run.q[step * k], run.dq[step * k], run.ddq[step * k])
        up = (data.oMi[5] * place).actInv(model.gravity)
        v, a = place.actInv(data.v[5]), place.actInv(data.a[5]) - up
        force = body * a + v.cross(body * v)
        close(found.wrench_log.wrench[k], np.concatenate([force.linear, force.angular]), 1e-9)
        np.testing.assert_allclose(found.wrench_log.q[k], run.q[step * k], atol=1e-14)
    assert found.wrench_log.rate == pytest.approx(50.0)


def test_the_load_is_moved_by_the_robot() -> None:
    found, whole = loaded(), chain_model(built_in("irp6"))
    whole.appendBodyToJoint(5, inertia(LOAD.parameters), placement())
    run, robot = found.run.samples, found.robot
    plain = robot.replace(structure=type(robot.structure)())
    extra = DifferentialModel(plain, Terms(reflected=False), sign_width=found.steps.width)
    drives = [0.0 if name[0] in "mI" and name[:2] != "Ia" else found.truth[name] for name in extra.names]
    lost = (extra.assemble(run) @ np.array(drives)).reshape(run.q.shape)
    for k in range(0, run.time.size, 97):
        expected = pin.rnea(whole, whole.createData(), run.q[k], run.dq[k], run.ddq[k]) + lost[k]
        close(found.run.effort[k], expected, 1e-9)
    assert found.truth["m"] == LOAD.parameters[0]
    assert np.abs(found.tracking_error).max() > 1e-6  # the controller does not know of it


def test_the_sensor_of_a_model_object_measures() -> None:
    """As good as the options that say where the sensor is."""
    sensor = Sensor("5", rotation_from_rpy(SHIFTED["sensor_rpy"]), np.array(SHIFTED["sensor_xyz"]))
    found = loaded(task=Task("irp6", model=LoadModel(built_in("irp6"), sensor)))
    np.testing.assert_array_equal(found.wrench_log.wrench, loaded().wrench_log.wrench)


def test_impossible_loads_are_refused() -> None:
    for phi, message in (
        ([1.0, 2.0], "expected ten finite numbers, m, mcx"),
        ([1.0] + [np.nan] * 9, "expected ten finite numbers"),
        ([-1.0] + [0.0] * 9, "mass -1 kg"),
        ([1.0, 1.0] + [0.0] * 8, "no body has these parameters"),
        ([1.0, 0, 0, 0, 1.0, 0, 0, 0.1, 0, 0.1], "no body has these parameters"),  # triangle inequality
    ):
        assert re.search(message, refusal(Payload, phi))


# --- sensors ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["irp6", "irp6-full"])
def test_encoders_are_within_half_a_count(name: str) -> None:
    transmission = replace(built_in(name).transmission, offset=np.linspace(-0.1, 0.2, 5))
    robot = built_in(name).replace(transmission=transmission)
    states = random_states(robot, 200, seed=10)
    found = quantised(robot, states.q, (4000.0,))
    C = transmission.coupling[: robot.n]
    for k, (before, after) in enumerate(zip((states.q @ C.T).T, (found @ C.T).T, strict=True)):
        gear = transmission.drives[k].ratio
        half = np.pi / 4000 / np.abs(motor_angle(gear, before + transmission.offset[k])[1])
        error = np.abs(after - before)
        assert np.all(error <= half * (1 + 1e-3))
        assert error.max() > 0.9 * half.min()
        counts = motor_angle(gear, after + transmission.offset[k])[0] * 4000 / (2 * np.pi)
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-2)
    np.testing.assert_allclose(quantised(robot, found, (4000.0,)), found, atol=1e-6 * np.pi / 4000)


def test_the_angle_of_a_ball_screw_is_its_length() -> None:
    """``F(z) = (2 pi / pitch) L(z)`` in closed form."""
    screw = BallScrew(0.005, 0.07789525, -0.02934668, -0.06090255)
    z = np.linspace(-0.7, 0.7, 15)
    length = np.sqrt(0.07789525 - 0.02934668 * np.cos(z) - 0.06090255 * np.sin(z))
    expected = 2 * np.pi / 0.005 * (length - np.sqrt(0.07789525 - 0.02934668))
    np.testing.assert_allclose(motor_angle(screw, z)[0], expected, atol=1e-9)
    np.testing.assert_allclose(motor_angle(ConstantRatio(-158.0), z)[0], -158.0 * z, atol=1e-12)


def test_noise_is_as_asked_for_and_repeats_with_the_seed() -> None:
    noise = {"torque_noise": (0.5, 1.0, 2.0), "position_noise": (1e-4,), "velocity_noise": (1e-2,)}
    first, again, other = (simulated(replace(LOOSE, rate=500.0, seed=seed, **noise)) for seed in (3, 3, 4))
    for name in ("q", "dq", "effort"):
        np.testing.assert_array_equal(getattr(first.log, name), getattr(again.log, name))
        assert np.all(getattr(first.log, name) != getattr(other.log, name))
    np.testing.assert_array_equal(first.run.effort, other.run.effort)
    np.testing.assert_allclose(np.std(first.log.effort - first.run.effort, axis=0), [0.5, 1.0, 2.0], rtol=0.1)
    np.testing.assert_allclose(np.std(first.log.q - first.run.samples.q, axis=0), 1e-4, rtol=0.1)
    np.testing.assert_allclose(np.std(first.log.dq - first.run.samples.dq, axis=0), 1e-2, rtol=0.1)


# --- motions to follow -----------------------------------------------------------------------------------------------


def test_sampled_motion_is_exact_for_quintics() -> None:
    quintic = Polynomials(np.random.default_rng(11).normal(size=(6, 3)))
    time = np.sort(np.random.default_rng(12).uniform(1.0, 3.0, 5))
    sampled = SampledMotion(quintic.samples(time))
    at = np.linspace(0.0, sampled.duration, 40)
    found, expected = sampled.samples(at), quintic.samples(at + time[0])
    for name in ("q", "dq", "ddq", "dddq"):
        close(getattr(found, name), getattr(expected, name), 1e-10)


def test_periods_repeat() -> None:
    twice = Repeated(motion(3), 2)
    assert twice.duration == 8.0
    at = np.array([0.0, 1.3, 4.0, 5.3, 8.0])
    once = motion(3).samples(np.array([0.0, 1.3, 0.0, 1.3, 4.0]))
    for name in ("q", "dq", "ddq"):
        np.testing.assert_allclose(getattr(twice.samples(at), name), getattr(once, name), atol=1e-9)
    found = simulated(replace(LOOSE, rate=100.0, periods=2))
    assert found.log.count == 801
    np.testing.assert_allclose(found.run.samples.q[400:], found.run.samples.q[:401], atol=1e-6)


def test_an_open_motion_is_not_repeated() -> None:
    half = SampledMotion(motion(3).samples(np.linspace(0.0, 2.0, 50)))
    with pytest.raises(InputError, match=r"ends [\d.]+ rad \(m\) from where it starts cannot be repeated"):
        simulated(replace(LOOSE, periods=2), motion=half)


# --- bad input -------------------------------------------------------------------------------------------------------


def test_impossible_settings_are_refused() -> None:
    for options, message in (
        ({"controller": "magic"}, "no controller named 'magic'; available: computed-torque, pd"),
        ({"rate": 0.0}, "`rate` must be a number from 1e-06 to 10000000 Hz, given 0"),
        ({"torque_noise": (-0.1,)}, "`torque_noise` must be 0 or a number from 1e-12 to 1e.12 Nm or N, given -0.1"),
        ({"wrench_noise": (1.0, 2.0, 3.0)}, "wrench_noise needs two numbers, of force and torque, or six; given 3"),
        ({"sign_width": 0.0}, "`sign_width` must be a velocity greater than zero"),
    ):
        assert re.search(message, refusal(SimulationSettings, **options))
    for name in ("encoder", "position_noise", "temperature"):
        for given in (2, 2.0, [2.0], np.array([2.0]), np.float64(2.0)):
            assert getattr(SimulationSettings(**{name: given}), name) == (2.0,)


def test_bad_input_is_told() -> None:
    robot, slow, narrow = built_in("irp6"), replace(LOOSE, rate=1.0, bandwidth=50.0), replace(LOOSE, sign_width=1e-6)
    hand = robot.replace(links=(*robot.links[:4], replace(robot.links[4], theta=None)))
    with_load, panda = FrictionCurves({"z1": Loaded(CoulombViscous(9.0), 0.1)}), built_in("panda")
    noisy, counted = replace(LOOSE, torque_noise=(1.0, 2.0)), replace(LOOSE, encoder=(1.0, 2.0))
    few_steps = r"sign_width 1e-06: .* needs \d+ substeps per sample at 200 Hz, more than 64; expected a width of about"
    calls: tuple[tuple[Callable[[], object], str], ...] = (
        (lambda: plant_of(hand), "robot 'irp6': the inertia of link wrist_turn is unknown"),
        (lambda: plant_of(robot, FrictionCurves({"z9": CoulombViscous(1.0)})), "no drive named 'z9'"),
        (lambda: simulated(motion=motion(2)), "the motion has 2 joints, .* 3: q1, q2, q3"),
        (lambda: simulated(narrow, friction=with_load), few_steps),
        (lambda: simulate_motion(panda, Task("panda"), motion(7), slow), r"needs \d+ substeps per sample at 1 Hz"),
        (lambda: simulated(noisy), "torque_noise needs one value, or 3, one per joint"),
        (lambda: simulated(counted), "encoder needs one value, or 3, one per moving drive"),
        (lambda: SampledMotion(motion(1).samples(np.array([0.0]))), "two samples or more"),
    )
    for call, message in calls:
        assert re.search(message, refusal(call))


def test_bodies_that_cannot_be_are_told() -> None:
    robot = built_in("panda")
    theta = np.array(robot.links[6].theta)
    theta[4:] = -1.0
    broken = robot.replace(links=(*robot.links[:6], replace(robot.links[6], theta=theta)))
    with pytest.raises(InputError, match="not positive definite at 0 s"):
        simulate_motion(broken, Task("panda"), motion(7, duration=0.5), LOOSE)


def test_wrong_models_are_of_real_bodies() -> None:
    plant, _ = plant_of(built_in("irp6"))
    wrong = plant.with_errors(0.3, np.random.default_rng(0))
    ratio = wrong.theta.reshape(5, 10) / np.where(plant.theta == 0, np.nan, plant.theta).reshape(5, 10)
    assert np.nanmax(np.nanstd(ratio, axis=1)) < 1e-12
    assert np.all(np.abs(np.nanmean(ratio, axis=1) - 1) < 0.3)
    assert plant.with_errors(0.0, np.random.default_rng(0)) is plant
