"""Impacts on a simulated robot, and friction that grows with the torque a drive carries."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from motions import random_fourier
from pinocchio_chains import chain_model
from refused import refusal

from excite.identification.identification import Identification
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.simulation.plant import plant_of
from excite.simulation.replay import windowed_motion
from excite.simulation.settings import ImpactPulse, SimulationSettings, impacts_on
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.task import Task
from regressors.errors import UnknownName
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, Stribeck
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded
from regressors.samples import Array

BLOW = ImpactPulse("q2", 1.0, 400.0, 0.01)


@cache
def run(*impacts: ImpactPulse, friction: bool = False) -> Simulation:
    """The first three axes of the IRp-6 under a soft controller, for 2 s."""
    motion = random_fourier(3, 0, 2.0, 0.05, harmonics=2)
    settings = SimulationSettings(rate=2000.0, torque_limits=False, bandwidth=1.0, impact=impacts)
    curves = None if friction else FrictionCurves({f"z{k}": CoulombViscous() for k in range(1, 6)})
    return simulate_motion(built_in("irp6"), Task("irp6"), motion, settings, friction=curves)


def test_the_velocity_jumps_by_the_impulse_over_the_inertia() -> None:
    brief = ImpactPulse("q2", 1.0, 2000.0, 0.002)
    struck, calm = run(brief).run.samples, run().run.samples
    before, after = 2000, 2004
    jump = (struck.dq - calm.dq)[after] - (struck.dq - calm.dq)[before]
    q = ca.SX.sym("q", 3)
    plant = plant_of(run().robot)[0]
    M = np.array(ca.Function("M", [q], [plant.mass_matrix(q)])(struck.q[before]))
    expected = np.linalg.solve(M, [0.0, 2 * 2000.0 * 0.002 / np.pi, 0.0])
    np.testing.assert_allclose(jump, expected, atol=0.015 * np.abs(expected).max())  # the controller answers meanwhile
    np.testing.assert_array_equal(struck.q[:before], calm.q[:before])


@pytest.mark.parametrize("friction", [False, True])
def test_the_energy_of_the_impact_enters_the_balance(friction: bool) -> None:
    struck = run(BLOW, friction=friction)
    assert struck.energy_residual < 1e-3 * struck.run.energy.max()


def test_the_torques_of_the_drives_do_not_show_the_impact_at_once() -> None:
    struck, calm = run(BLOW).log, run().log
    assert struck.effort is not None
    assert calm.effort is not None
    answer = np.abs(struck.effort - calm.effort).max(axis=1)
    assert answer[:2000].max() == 0.0
    assert 0.0 < answer[2010] < 100.0  # 400 Nm act from outside
    assert any("acts on q2 from 1 s on" in note for note in run(BLOW).notes)


def test_friction_is_what_the_torques_do_beyond_the_motion() -> None:
    """With viscous friction alone, of one drive: ``C' f dz``."""
    motion = random_fourier(3, 0, 1.0, 0.05, harmonics=2)
    during = ImpactPulse("q2", 0.5, 400.0, 0.01)
    curves = FrictionCurves({f"z{k}": CoulombViscous(0.0, 3.0 if k == 2 else 0.0) for k in range(1, 6)})
    found = simulate_motion(
        built_in("irp6"), Task("irp6"), motion, SimulationSettings(rate=500.0, impact=(during,)), friction=curves
    )
    row = found.robot.transmission.coupling[1]
    expected = 3.0 * np.outer(found.run.samples.dq @ row, row)
    np.testing.assert_allclose(found.run.friction, expected, atol=1e-9 * np.abs(found.run.effort).max())


def test_impacts_add_up_and_wait_for_the_motion() -> None:
    robot = built_in("panda")
    name = robot.joint_names[0]
    impacts = impacts_on(robot, (ImpactPulse(name, 1.0, 5.0, 0.2), ImpactPulse(name, 1.1, 5.0, 0.2)), wait=0.5)
    torques = impacts(np.array([1.0, 1.5, 1.6, 1.65, 2.0]))
    s = np.sin(np.pi * np.array([0.5, 0.75, 0.25]))
    np.testing.assert_allclose(torques[:, 0], [0, 0, 5 * s[0], 5 * (s[1] + s[2]), 0], atol=1e-12)
    assert not np.any(torques[:, 1:])


def test_the_impulse_is_that_of_half_a_sine() -> None:
    time = np.linspace(0.9, 1.1, 200_001)
    assert np.trapezoid(BLOW.at(time), time) == pytest.approx(2 * 400.0 * 0.01 / np.pi, rel=1e-6)


def test_invalid_pulses() -> None:
    for numbers in ((1.0, 5.0, 0.0), (1.0, 5.0, -1.0), (float("nan"), 5.0), (1.0, float("inf"))):
        assert "`impact` on q2" in refusal(ImpactPulse, "q2", *numbers)
    with pytest.raises(UnknownName, match="no moving joint for an impact named 'q9'"):
        run(ImpactPulse("q9", 1.0, 5.0))


CURVES = FrictionCurves(
    {
        "z1": CoulombViscous(9.0, 25.0),
        "z2": Loaded(Stribeck(Side(11.0, 26.0, 16.8, 0.1), Side(7.0, 26.0, 10.6, 0.1)), 0.08),
        "z3": Loaded(CoulombViscous(12.0, 26.0), 0.05, 0.15),
    }
)


@cache
def found(**chosen: float) -> Simulation:
    motion, settings = random_fourier(3, 3, size=0.2), SimulationSettings(rate=500.0, torque_limits=False, **chosen)
    return simulate_motion(built_in("irp6"), Task("irp6"), motion, settings, friction=CURVES)


def rigid(run: Simulation) -> Array:
    """Torques without friction along the true motion, by Pinocchio and, rotor by rotor, by hand."""
    robot, samples = run.robot, run.run.samples
    model = chain_model(robot)
    data = model.createData()
    states = zip(samples.q, samples.dq, samples.ddq, strict=True)
    tau = np.array([pin.rnea(model, data, *state).copy() for state in states])
    for drive, row in zip(robot.transmission.drives, robot.transmission.coupling, strict=True):
        if not drive.rests:
            tau += np.outer(drive.ratio.value**2 * drive.rotor_inertia * (samples.ddq @ row), row)
    return tau


def test_logged_torques_are_the_law() -> None:
    run = found(sign_width=0.02)
    samples, tau = run.run.samples, rigid(run)
    C = run.robot.transmission.coupling[:3]
    s = np.tanh(samples.dq @ C.T / 0.02)
    at_drives = np.linalg.solve(C.T, tau.T).T
    friction = np.column_stack([CURVES.curve(f"z{k}").torque(samples.dq @ C[k - 1], s[:, k - 1]) for k in (1, 2, 3)])
    friction[:, 1] += 0.08 * s[:, 1] * np.abs(at_drives[:, 1])
    friction[:, 2] += ((1 + s[:, 2]) / 2 * 0.05 - (1 - s[:, 2]) / 2 * 0.15) * np.abs(at_drives[:, 2])
    np.testing.assert_allclose(run.run.effort, tau + friction @ C, atol=1e-8)
    power = np.sum(friction * (samples.dq @ C.T), axis=1)
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]))]) / 500.0
    np.testing.assert_allclose(run.run.loss - run.run.loss[0], lost, atol=2e-3 * lost[-1])


@cache
def identified() -> Identification:
    recipe = Recipe(signals="fourier", period=4.0, harmonics=10, rows="all", sign_width=0.02, estimator="least-squares")
    log = found(sign_width=0.02).log
    return estimate_parameters(built_in("irp6"), Task("irp6"), [log], recipe, friction=CURVES)


def test_masses_come_back_with_the_curves_alone() -> None:
    known, estimate = dict(found(sign_width=0.02).truth), identified().estimate
    masses = dict(zip(estimate.names, estimate.values, strict=True))
    assert masses["X7"] == pytest.approx(known["m2c2x"] + 0.455 * known["m3"], rel=2e-3)
    assert estimate.names == tuple(f"X{k}" for k in range(1, 8))


def test_the_identified_motion_is_replayed_with_friction_that_grows_with_load() -> None:
    run, target, part, ends = found(sign_width=0.02).run, identified().target, slice(0, 251), []
    samples, model = run.samples, (target.model, identified().estimate.coefficients, target.base)
    given = (samples.time[part], run.effort[part], samples.q[part], samples.dq[part], 9.0)
    bare = FrictionCurves({name: getattr(curve, "curve", curve) for name, curve in CURVES.curves.items()})
    for curves in (CURVES, bare):
        replay = windowed_motion(*model, *given, friction=curves, sign_width=0.02)
        assert replay.ok
        ends.append(float(np.abs(replay.q - samples.q[part]).max()))
    assert ends[0] < 5e-3
    assert ends[1] > 5 * ends[0]


def test_a_controller_with_a_wrong_model_has_wrong_shares_too() -> None:
    plant, _ = plant_of(built_in("irp6"), CURVES)
    wrong = plant.with_errors(0.2, np.random.default_rng(0))
    factor = wrong.friction.curve("z3").curve.torque(1.0) / CURVES.curve("z3").curve.torque(1.0)
    np.testing.assert_allclose(wrong.friction.curve("z3").shares, factor * np.array([0.05, 0.15]))
    assert factor != pytest.approx(1.0, abs=1e-3)


def test_friction_that_sticks_is_as_steep_with_a_load() -> None:
    run = found(breakaway="auto")
    assert run.steps.sticking.distance < 5e-5
    assert run.energy_residual < 1e-4 * run.run.loss[-1]
