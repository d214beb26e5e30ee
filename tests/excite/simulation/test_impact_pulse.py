"""Impacts on a simulated robot: momentum, energy, and what the drives show of them."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pytest

from excite.simulation.plant import plant_of
from excite.simulation.settings import ImpactPulse, Impacts, SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves

BLOW = ImpactPulse("q2", 1.0, 400.0, 0.01)


@cache
def run(*impacts: ImpactPulse, friction: bool = False) -> Simulation:
    """The first three axes of the IRp-6 under a soft controller, for 2 s."""
    family = Fourier(2.0, 2)
    motion = Trajectory(family, np.random.default_rng(0).normal(0.0, 0.05, (3, family.size)))
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
    family = Fourier(1.0, 2)
    motion = Trajectory(family, np.random.default_rng(0).normal(0.0, 0.05, (3, family.size)))
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
    impacts = Impacts(robot, (ImpactPulse(name, 1.0, 5.0, 0.2), ImpactPulse(name, 1.1, 5.0, 0.2)), wait=0.5)
    torques = impacts.at(np.array([1.0, 1.5, 1.6, 1.65, 2.0]))
    s = np.sin(np.pi * np.array([0.5, 0.75, 0.25]))
    np.testing.assert_allclose(torques[:, 0], [0, 0, 5 * s[0], 5 * (s[1] + s[2]), 0], atol=1e-12)
    assert not np.any(torques[:, 1:])


def test_the_impulse_is_that_of_half_a_sine() -> None:
    time = np.linspace(0.9, 1.1, 200_001)
    assert np.trapezoid(BLOW.at(time), time) == pytest.approx(2 * 400.0 * 0.01 / np.pi, rel=1e-6)


@pytest.mark.parametrize("numbers", [(1.0, 5.0, 0.0), (1.0, 5.0, -1.0), (float("nan"), 5.0), (1.0, float("inf"))])
def test_invalid_pulses(numbers: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="`impact` on q2"):
        ImpactPulse("q2", *numbers)


def test_the_joint_must_move() -> None:
    with pytest.raises(UnknownName, match="no moving joint for an impact named 'q9'"):
        run(ImpactPulse("q9", 1.0, 5.0))
