"""Simulated friction that sticks: nothing creeps, drives break loose at their stiction, energy and couplings hold."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from breakaway_ramps import STICKING
from motions import order_of, random_fourier
from refused import refusal
from scipy.integrate import solve_ivp

from excite.identification.equations import dahl_direction
from excite.simulation.control import (
    ControlledRobot,
    Sticking,
    controller_of,
    leads,
)
from excite.simulation.integration import SimulatedRun, Steps, simulated_run
from excite.simulation.plant import Plant, plant_of
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.reference import SampledMotion
from excite.tasks.task import Task
from regressors.models.differential import DifferentialModel
from regressors.readers.library import built_in
from regressors.robot.columns import Terms
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Stribeck
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.locked_joints import with_locked_joints
from regressors.samples import Array, Samples

UNEVEN = Stribeck(Side(9.0, 25.0, 16.8, 0.12, 1.0), Side(7.0, 25.0, 10.6, 0.12, 1.0))  # stiction of [KD96] axis 2
MIDDLE, HALF = (16.8 - 10.6) / 2, (16.8 + 10.6) / 2


def pulling(plant: Plant) -> ControlledRobot:
    """Joint torques that the reference states in the place of accelerations, beside gravity's."""
    still = ca.SX.zeros(plant.robot.n, 1)
    return ControlledRobot(plant, lambda q, _, wanted, __: plant.torque(q, still, still) + wanted[2])


@dataclass(frozen=True)
class Torques:
    """A reference whose accelerations are torques, functions of time."""

    duration: float
    function: Callable[[Array], Array]

    def samples(self, time: Array) -> Samples:
        tau = self.function(np.asarray(time, dtype=float))
        return Samples(np.asarray(time, dtype=float), *(0 * tau, 0 * tau, tau, 0 * tau))


def column(curve: FrictionCurve = UNEVEN) -> Plant:
    """First axis of the IRp-6 alone; gravity does not act on it."""
    return plant_of(with_locked_joints(built_in("irp6"), [0]), FrictionCurves({"z1": curve}))[0]


def inertia(plant: Plant) -> float:
    q = ca.SX.sym("q", 1)
    return float(ca.Function("M", [q], [plant.mass_matrix(q)])(0.0))


def pulled(
    points: dict[float, float], distance: float = 1e-4, rate: float = 500.0, plant: Plant | None = None
) -> SimulatedRun:
    """Motion of the column under a torque that goes straight from one point (time, torque) to the next."""
    plant = column() if plant is None else plant
    times, torques = np.array(list(points)), np.array(list(points.values()))
    reference = Torques(float(times[-1]), lambda t: np.interp(t, times, torques)[:, None])
    sticking = Sticking(distance, tuple(leads(plant, np.zeros(1)) * np.sqrt(distance)))
    return simulated_run(pulling(plant), reference, rate, Steps(2, 1e-3, sticking=sticking))


# --- at rest ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("torque", [16.0, 12.0, 5.0, -5.0, -10.0])
@pytest.mark.parametrize("distance", [1e-4, 2e-5])
def test_at_rest_a_drive_gives_way_as_a_spring_and_does_not_creep(torque: float, distance: float) -> None:
    """``z = d ln((1 - s_0) / (1 - s))`` of Dahl's friction that carries the torque, ``s = (tau - middle) / half``."""
    z = pulled({0.0: 0.0, 1.0: 0.8 * torque, 4.0: torque, 6.0: torque}, distance).samples.q[:, 0]
    s0, s = -MIDDLE / HALF, (torque - MIDDLE) / HALF
    u = np.sign(torque)
    expected = u * distance * np.log((1 - u * s0) / (1 - u * s))
    assert z[-1] == pytest.approx(expected, rel=0.02)
    assert np.abs(z).max() < 1.02 * abs(expected)
    assert abs(z[-1] - z[2250]) < 1e-6 * distance  # in the last second and a half


@pytest.mark.parametrize(("stiction", "sign"), [(16.8, 1), (10.6, -1)])
def test_a_slow_ramp_breaks_loose_at_the_stiction(stiction: float, sign: int) -> None:
    run = pulled({0.0: 0.0, 1.0: 0.9 * sign * stiction, 6.0: 1.05 * sign * stiction}, 1e-5, 1000.0)
    z, tau = sign * run.samples.q[:, 0], sign * run.effort[:, 0]
    assert z[tau < 0.99 * stiction].max() < 1e-4
    assert z[-1] > 1e-2
    assert tau[np.argmax(z > 1e-4)] == pytest.approx(stiction, rel=0.01)


@pytest.mark.parametrize("torque", [20.0, -15.0])
def test_in_steady_motion_friction_is_the_curve(torque: float) -> None:
    run = pulled({0.0: 0.0, 0.5: 30.0 * np.sign(torque), 1.0: torque, 8.0: torque}, 1e-4)
    assert abs(run.samples.dq[-1, 0]) > 0.1
    assert abs(run.samples.ddq[-1, 0]) < 1e-8
    assert float(UNEVEN.torque(run.samples.dq[-1, 0])) == pytest.approx(torque, abs=1e-6)


def test_a_moving_drive_comes_to_rest_and_stays() -> None:
    """It stops, swings back as a spring does, and stops for good, in less than a twentieth of a second."""
    run = pulled({0.0: 0.0, 0.2: 30.0, 0.6: 30.0, 0.7: 0.0, 4.0: 0.0}, 1e-5, 1000.0)
    moving = np.abs(run.samples.dq[:, 0]) > 1e-6
    last = int(np.flatnonzero(moving)[-1])
    assert run.samples.q[-1, 0] > 0.05
    stopped = int(np.argmax((run.samples.time > 0.7) & (run.samples.dq[:, 0] <= 0)))
    assert 0 < stopped <= last < stopped + 50
    assert abs(run.samples.q[-1, 0] - run.samples.q[stopped, 0]) < 1e-5 * np.log(4)


def test_a_slow_motion_under_soft_control_sticks_and_slips() -> None:
    """Friction falls with speed faster than the controller damps, and stays at rest longer than it slips."""
    curve = Stribeck(Side(8.0, 25.0, 16.0, 0.005, 2.0))
    plant, speed, end = column(curve), 0.002, 4.0
    controller = controller_of("pd", plant, 5.0, np.zeros(1))
    path, rates = np.array([[0.0], [speed * end]]), (np.full((2, 1), x) for x in (speed, 0.0, 0.0))
    reference = SampledMotion(Samples(np.array([0.0, end]), path, *rates))
    sticking = Sticking(1e-5, tuple(leads(plant, np.zeros(1)) * np.sqrt(1e-5)))
    run = simulated_run(ControlledRobot(plant, controller), reference, 1000.0, Steps(2, 1e-3, sticking=sticking))
    dq, later = run.samples.dq[:, 0], run.samples.time > 1.0
    slips = int(np.count_nonzero((dq[:-1] < 3 * speed) & (dq[1:] >= 3 * speed)))
    assert slips >= 3
    assert np.mean(np.abs(dq[later]) < 0.2 * speed) > 0.5
    assert run.effort[later].max() == pytest.approx(16.0, rel=0.01)
    assert run.effort[later].min() < 8.0


# --- the integration -------------------------------------------------------------------------------------------------


def exact(torque: Callable[[float], float], curve: Stribeck, d: float, T: float, times: Array, start: Array) -> Array:
    """Velocity and direction as states of an ordinary differential equation, by scipy's Radau."""
    M = inertia(column(curve))

    def rate(t: float, x: Array) -> list[float]:
        _, v, s = x
        ds = (1 - s * np.sign(v)) * v / d
        f = float(curve.torque(v, np.clip(s + T * ds, -1, 1)))
        return [v, (torque(t) - f) / M, ds]

    found = solve_ivp(rate, (times[0], times[-1]), start, "Radau", times, rtol=1e-10, atol=1e-13, max_step=2e-3)
    assert found.success
    return np.asarray(found.y.T)


def errors(torque: Callable[[Array], Array], duration: float, T: float, rates: tuple[float, ...]) -> list[float]:
    """Largest errors in position with steps of given rates, the last one a multiple of the others."""
    curve, d = Stribeck(Side(9.0, 25.0, 14.1, 0.12, 1.0)), 5e-3
    plant = column(curve)
    reference, robot = Torques(duration, lambda t: torque(t)[:, None]), pulling(plant)
    times = np.arange(round(duration * rates[-1]) + 1) / rates[-1]
    expected = exact(lambda t: float(torque(np.array(t))), curve, d, T, times, np.zeros(3))[:, 0]
    found = []
    for rate in rates:
        run = simulated_run(robot, reference, rate, Steps(1, 1e-3, sticking=Sticking(d, (T,))))
        found.append(float(np.abs(run.samples.q[:, 0] - expected[:: round(rates[-1] / rate)]).max()))
    return found


def test_integration_is_of_order_four_in_one_direction() -> None:
    found = errors(lambda t: 40.0 * np.sin(np.pi * t) ** 2, 0.5, 0.0, (50.0, 100.0, 200.0))
    assert min(order_of(found)) > 3.7
    assert found[-1] < 1e-7


def test_reversals_are_met_as_finely_as_the_steps() -> None:
    found = errors(lambda t: 30.0 * np.sin(2 * np.pi * t) + 5.0 * np.sin(6 * np.pi * t), 1.5, 0.02, (200.0, 800.0))
    assert found[1] < min(found[0] / 8, 5e-6)


def test_a_distance_that_no_step_resolves_stays_bounded() -> None:
    """Fifty times too short for the steps: friction turns from one substep to the next."""
    points = {0.0: 0.0, 0.5: 30.0, 1.0: -30.0, 1.5: -30.0, 2.0: 0.0, 4.0: 0.0}
    fine, coarse = (pulled(points, d, 1000.0).samples.q[:, 0] for d in (1e-5, 1e-9))
    assert np.ptp(fine) > 0.5
    assert np.abs(coarse - fine).max() < 2e-3


# --- whole robots ----------------------------------------------------------------------------------------------------

C = np.array([[1.0, 0, 0], [0, 1, 0], [0, 1, 1]])


@cache
def of_irp6() -> Simulation:
    settings = SimulationSettings(rate=1000.0, torque_limits=False, controller="pd", breakaway="auto")
    return simulate_motion(built_in("irp6"), Task("irp6"), random_fourier(), settings, friction=STICKING)


def test_the_energy_balance_closes() -> None:
    run = of_irp6().run
    assert run.loss[-1] > 10.0
    assert of_irp6().energy_residual < 1e-5 * run.loss[-1]


def test_friction_reaches_the_joints_through_the_coupling() -> None:
    """What the joints lose is ``C' f(C dq, s)``; s by Dahl's recursion over the logged path, settled in steady ways."""
    found = of_irp6()
    sticking, run = found.steps.sticking, found.run.samples
    bare = found.robot.replace(structure=type(found.robot.structure)())
    inertial = DifferentialModel(bare, Terms(coulomb=False, viscous=False, reflected=False))
    theta = np.array([found.truth[name] for name in inertial.names])
    lost = found.run.effort - (inertial.assemble(run) @ theta).reshape(run.q.shape)
    z, dz = run.q @ C.T, run.dq @ C.T
    s = dahl_direction(z, sticking.distance)
    settled = np.all(np.abs(s - np.sign(dz)) < 1e-9, axis=1)
    assert settled.mean() > 0.5
    f = np.column_stack([STICKING.curve(f"z{k + 1}").torque(dz[:, k]) for k in range(3)])
    np.testing.assert_allclose(lost[settled], (f @ C)[settled], atol=1e-6)
    turning = ~settled & (np.abs(dz).max(axis=1) > 0)
    bounds = np.array([14.1, 16.8, 18.0]) + 26.0 * np.abs(dz[turning])
    assert np.all(np.abs(lost[turning] @ np.linalg.inv(C)) <= bounds + 1e-6)


def test_every_drive_holds_its_own_torque() -> None:
    """Joint 2 bears more than either drive could; one drive breaks loose while the other one keeps its coordinate."""
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    plant, _ = plant_of(robot, STICKING)
    sticking = Sticking(1e-5, tuple(leads(plant, np.zeros(3)) * np.sqrt(1e-5)))

    def moved(at_drives: list[float]) -> Array:
        reference = Torques(2.0, lambda t: np.outer(np.minimum(t, 1.0), np.array(at_drives) @ C))
        run = simulated_run(pulling(plant), reference, 1000.0, Steps(3, 1e-3, sticking=sticking))
        return np.asarray(np.abs(run.samples.q @ C.T).max(axis=0))

    assert np.all(moved([13.0, 15.0, 16.0]) < 1e-4)
    one = moved([0.0, 0.0, 20.0])
    assert one[2] > 1e-2
    assert np.all(one[:2] < 1e-4)


# --- how it is chosen ------------------------------------------------------------------------------------------------


def brief(**options: object) -> Simulation:
    settings = replace(SimulationSettings(rate=500.0, torque_limits=False), **options)
    return simulate_motion(built_in("irp6"), Task("irp6"), random_fourier(3, 1, 1.0, 0.05), settings)


def test_friction_is_smooth_unless_it_is_asked_to_stick() -> None:
    smooth, sticking, given = brief(), brief(breakaway="auto"), brief(breakaway=2e-3)
    assert smooth.steps.sticking is None
    assert any("friction changes sign within" in note for note in smooth.notes)
    assert 1e-5 <= sticking.steps.sticking.distance < 2e-4
    assert sticking.steps.substeps <= 10
    assert given.steps.sticking.distance == 2e-3
    assert any("friction is presliding: it changes direction over 0.002 rad (m)" in note for note in given.notes)


def test_at_a_low_rate_friction_turns_over_a_longer_way() -> None:
    low = brief(breakaway="auto", rate=20.0, bandwidth=2.0)
    assert low.steps.widened
    assert 1e-5 < low.steps.sticking.distance < 1e-3
    assert any("widened to suit the substep" in note for note in low.notes)


def test_damping_is_half_of_the_critical_one() -> None:
    """``x'' + T w^2 x' + w^2 x = 0`` with ``w^2 = F / (d M)``: twice the damping ratio is T w."""
    plant = column(CoulombViscous(28.0, 25.0))
    lead = float(leads(plant, np.zeros(1))[0]) * np.sqrt(1e-4)
    assert lead * np.sqrt(28.0 / (1e-4 * inertia(plant))) == pytest.approx(1.0)
    assert leads(column(CoulombViscous(0.0, 25.0)), np.zeros(1))[0] == 0.0


def test_bad_input_is_told() -> None:
    for options, message in (
        (
            {"breakaway": 1e-9},
            r"breakaway 1e-09: .* needs \d+ substeps .* expected a distance of about 7\.1e-09 or more",
        ),
        ({"breakaway": 0.0}, "`breakaway` must be a distance greater than zero, given 0"),
        ({"breakaway": "soft"}, "breakaway must be a distance, or 'auto', given 'soft'"),
        ({"breakaway": 1e-4, "sign_width": 1e-3}, "give `sign_width` or `breakaway`, not both"),
        ({"catch": 0.0}, "`catch` must be a number from 1e-09 to 10000 rad or m, given 0"),
    ):
        assert re.search(message, refusal(brief, **options))
