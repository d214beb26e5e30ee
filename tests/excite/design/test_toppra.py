"""Designed motions given as paths to TOPP-RA: within the same limits they can be played in no more than their duration.

TOPP-RA [Pham, Pham 2018] knows nothing of this project: it finds the quickest timing of a path within limits of
velocity and acceleration.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import toppra
import toppra.algorithm
import toppra.constraint

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.samples import Array

QUICK = {"starts": 1, "executor": "serial"}
TASKS = {
    "irp6, drives": Task("irp6", harmonics=3, **QUICK),
    "panda": Task("panda", friction=False, **QUICK),
    "ur10e, B-splines": Task("ur10e", trajectory="bspline", period=8.0, acceleration=(2.5,), **QUICK),
    "ur10e, quintic": Task("ur10e", trajectory="fourier-quintic", period=5.0, acceleration=(4.0,), **QUICK),
}
STEPS = 600
ENDS = 0.01  # part of the duration at each end, where the path hardly moves and TOPP-RA's linear programs degenerate


@cache
def designed(name: str) -> Design:
    return design_trajectory(TASKS[name])


class Path(toppra.interpolator.AbstractGeometricPath):
    """A motion in the coordinates whose velocity is limited, its time as the path's parameter.

    Parameters
    ----------
    trajectory : Trajectory
    C : ndarray, shape (k, n)
        From joints to those coordinates.
    """

    def __init__(self, trajectory: Trajectory, C: Array) -> None:
        self._trajectory, self._C = trajectory, C

    def __call__(self, s: Array, order: int = 0) -> Array:
        basis = self._trajectory.family.basis(np.atleast_1d(s), order)
        values = basis @ self._trajectory.x.T @ self._C.T
        return np.asarray(values if np.ndim(s) else values[0])

    @property
    def dof(self) -> int:
        return len(self._C)

    @property
    def path_interval(self) -> Array:
        return np.array([ENDS, 1.0 - ENDS]) * self._trajectory.duration

    @property
    def waypoints(self) -> tuple[Array, Array]:
        times = np.linspace(*self.path_interval, STEPS + 1)
        return times, self(times)


def limited(design: Design) -> tuple[Array, Array, Array]:
    """Coordinates ``C q``, and the bounds of their velocity and acceleration: of joints, or of drives as described."""
    robot = design.moving
    if robot.transmission is None or not np.all(np.isinf(robot.limits.velocity)):
        return np.eye(robot.n), robot.limits.velocity, robot.limits.acceleration
    moves = np.any(robot.transmission.coupling != 0.0, axis=1)
    limits = robot.transmission.limits
    return robot.transmission.coupling[moves], limits.velocity[moves], limits.acceleration[moves]


def constraints(velocity: Array, acceleration: Array) -> list[toppra.constraint.Constraint]:
    pairs = (np.column_stack([-bound, bound]) for bound in (velocity, acceleration))
    return [
        toppra.constraint.JointVelocityConstraint(next(pairs)),
        toppra.constraint.JointAccelerationConstraint(
            next(pairs), discretization_scheme=toppra.constraint.DiscretizationType.Collocation
        ),
    ]


def quickest(path: Path, velocity: Array, acceleration: Array, rate: float = 1.0) -> float:
    """Shortest duration of a path that is begun and ended at ``rate`` times the designed speed [s]."""
    grid = np.linspace(*path.path_interval, STEPS + 1)
    how = {"gridpoints": grid, "solver_wrapper": "seidel", "parametrizer": "ParametrizeSpline"}
    problem = toppra.algorithm.TOPPRA(constraints(velocity, acceleration), path, **how)
    _, speed, _ = problem.compute_parameterization(rate, rate)
    return float(2 * grid[0] / rate + np.sum(2 * np.diff(grid) / (speed[1:] + speed[:-1])))


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_a_design_can_be_played_in_no_more_than_its_duration_and_so_is_its_own_timing(name: str) -> None:
    """``u = 0, x = 1`` (the path's parameter is time) within ``F (a u + b x + c) <= g`` and the bounds on x."""
    design, period = designed(name), TASKS[name].trajectory.period
    C, velocity, acceleration = limited(design)
    path = Path(design.trajectory, C)
    found = quickest(path, velocity, acceleration)
    assert 0.5 * period < found <= period * (1 + 1e-6)  # the limits are used: no timing of this path is much quicker
    grid = np.linspace(0.0, period, STEPS + 1)
    by_velocity, by_acceleration = constraints(velocity, acceleration)
    bounds = by_velocity.compute_constraint_params(path, grid)[-1]
    assert np.all(bounds[:, 0] <= 1.0)
    assert np.all(bounds[:, 1] >= 1.0 - 1e-9)
    assert bounds[:, 1].min() < 1.3  # some velocity is nearly used
    a, b, c, F, g, *_ = by_acceleration.compute_constraint_params(path, grid)
    assert a.shape == b.shape
    assert np.all((b + c) @ F.T <= g + 1e-9)


@pytest.mark.slow
def test_what_breaks_a_limit_is_found_out() -> None:
    """The same path under limits that the design does not keep takes longer than its duration."""
    design = designed("panda")
    C, velocity, acceleration = limited(design)
    path = Path(design.trajectory, C)
    assert quickest(path, 0.5 * velocity, 0.25 * acceleration, rate=0.5) > design.task.trajectory.period
    whole = quickest(path, velocity, acceleration)
    halved = quickest(path, 0.5 * velocity, 0.25 * acceleration, rate=0.5)
    assert halved == pytest.approx(2 * whole, rel=1e-3)  # every timing at half the speed
