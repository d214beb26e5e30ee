"""Simulated friction that grows with the torque a drive carries: its law in logs, its way to masses, its replay."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_chains import chain_model

from excite.identification.estimation import estimate_parameters
from excite.identification.recipe import Recipe
from excite.simulation.plant import plant_of
from excite.simulation.replay import windowed_motion
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, Stribeck
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded
from regressors.samples import Array

CURVES = FrictionCurves(
    {
        "z1": CoulombViscous(9.0, 25.0),
        "z2": Loaded(Stribeck(Side(11.0, 26.0, 16.8, 0.1), Side(7.0, 26.0, 10.6, 0.1)), 0.08),
        "z3": Loaded(CoulombViscous(12.0, 26.0), 0.05, 0.15),
    }
)


@cache
def found(**chosen: float) -> Simulation:
    family = Fourier(4.0, 4)
    motion = Trajectory(family, np.random.default_rng(3).normal(0.0, 0.2, (3, family.size)))
    settings = SimulationSettings(rate=500.0, torque_limits=False, **chosen)
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


def test_masses_come_back_with_the_curves_alone() -> None:
    run = found(sign_width=0.02)
    recipe = Recipe(signals="fourier", period=4.0, harmonics=10, rows="all", sign_width=0.02)
    result = estimate_parameters(
        built_in("irp6"), Task("irp6"), [run.log], replace(recipe, estimator="least-squares"), friction=CURVES
    )
    known = dict(run.truth)
    masses = dict(zip(result.estimate.names, result.estimate.values, strict=True))
    assert masses["X7"] == pytest.approx(known["m2c2x"] + 0.455 * known["m3"], rel=2e-3)
    assert result.estimate.names == tuple(f"X{k}" for k in range(1, 8))


def test_the_identified_motion_is_replayed_with_friction_that_grows_with_load() -> None:
    run = found(sign_width=0.02)
    recipe = Recipe(signals="fourier", period=4.0, harmonics=10, rows="all", sign_width=0.02)
    result = estimate_parameters(
        built_in("irp6"), Task("irp6"), [run.log], replace(recipe, estimator="least-squares"), friction=CURVES
    )
    samples, target = run.run.samples, result.target
    part = slice(0, 251)
    ends = {}
    bare = FrictionCurves({name: getattr(curve, "curve", curve) for name, curve in CURVES.curves.items()})
    for name, curves in (("with", CURVES), ("without", bare)):
        given = (samples.time[part], run.run.effort[part], samples.q[part], samples.dq[part], 9.0)
        replay = windowed_motion(
            target.model, result.estimate.coefficients, target.base, *given, friction=curves, sign_width=0.02
        )
        assert replay.ok
        ends[name] = float(np.abs(replay.q - samples.q[part]).max())
    assert ends["with"] < 5e-3
    assert ends["without"] > 5 * ends["with"]


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
