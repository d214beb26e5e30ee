"""figaroh's optimal trajectory (waypoints at rest, IPOPT, finite differences) for every case.

Runs where ``figaroh`` and ``cyipopt`` can be imported. figaroh's own class leaves the problem to subclasses; this one
gives it the base columns and the limits of the case, and keeps every iterate, for figaroh returns none when it is
stopped. Descents from random waypoints follow each other until the time is spent.
"""

from __future__ import annotations

import contextlib
import io
import logging
import time
from collections.abc import Mapping
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import irp6_model
import judge
import numpy as np
from candidates import best
from cases import Case, case
from figaroh.optimal.base_optimal_trajectory import (  # type: ignore[import-not-found]
    BaseOptimalTrajectory,
    BaseTrajectoryIPOPTProblem,
)
from figaroh.utils.cubic_spline import CubicSpline, WaypointsGeneration  # type: ignore[import-not-found]

WAYPOINTS, RATE, ATTEMPTS = 11, 10, 20
DEGREE = 5  # of the spline's pieces
UNLIMITED = 1e9


class Limits:
    """The limits of the case at all samples; figaroh's own know no accelerations and no coupled joints."""

    def __init__(self, arm: Case, spline: Any) -> None:
        self.arm, self.spline = arm, spline

    def get_variable_bounds(self) -> tuple[list[float], list[float]]:
        n = WAYPOINTS - 1
        return list(self.spline.lower_q) * n, list(self.spline.upper_q) * n

    def get_constraint_bounds(self, samples: int) -> tuple[list[float], list[float]]:
        lower, upper = (np.concatenate([np.tile(limit[side], samples) for limit in self.arm.limits]) for side in (1, 2))
        return lower.tolist(), upper.tolist()

    def evaluate_constraints(self, samples: int, x: Any, *rest: Any) -> Any:
        _, times, velocities, accelerations, first = rest
        waypoints = np.vstack([first, np.reshape(x, (WAYPOINTS - 1, -1))]).T
        _, *state = self.spline.get_full_config(RATE, times, waypoints, velocities, accelerations)
        return np.concatenate([(q @ L.T).ravel() for q, (L, _, _) in zip(state, self.arm.limits, strict=True)])

    def trajectory_clear(self, *rest: Any) -> bool:
        return True


class Search(BaseOptimalTrajectory):  # type: ignore[misc]
    """figaroh's search, given the case in place of a file of settings."""

    def __init__(self, arm: Case, robot: Any, cpu: float) -> None:
        self.arm, self.cpu, self.robot, self.model = arm, cpu, robot, robot.model
        self.logger = logging.getLogger("figaroh")
        self.active_joints = list(robot.model.names)[1:]
        self.trajectory_config = {
            "n_wps": WAYPOINTS,
            "freq": RATE,
            "t_s": arm.period / (WAYPOINTS - 1),
            "soft_lim": 0.0,
            "max_attempts": ATTEMPTS,
            "max_iterations": 100_000,
        }
        self.CB, self.WP = (
            kind(robot, WAYPOINTS, self.active_joints, 0.0) for kind in (CubicSpline, WaypointsGeneration)
        )
        self.constraint_manager = Limits(arm, self.CB)
        self.iterates: list[Any] = []

    def _stack_base_regressors(self, q: Any, v: Any, a: Any, W_stack: Any = None) -> Any:
        return self.arm.columns(q, v, a)

    def create_ipopt_problem(self, *given: Any) -> Any:
        return Descent(self, *given)


class Descent(BaseTrajectoryIPOPTProblem):  # type: ignore[misc]
    """figaroh's problem, which ends when the time is spent and keeps its iterates."""

    def gradient(self, X: Any) -> Any:
        self.opt_traj.iterates.append(np.vstack([self.wp_init, np.reshape(X, (WAYPOINTS - 1, -1))]).T)
        return super().gradient(X)

    def intermediate(self, *given: Any) -> bool:
        return bool(super().intermediate(*given)) and time.process_time() < self.opt_traj.cpu


def pieces(search: Search, waypoints: Any) -> dict[str, Any]:
    """The spline through waypoints as polynomials."""
    breaks = np.linspace(0.0, search.arm.period, WAYPOINTS)
    zeros = np.zeros_like(waypoints)
    search.CB.get_active_config(RATE, np.matrix(breaks).T, waypoints, zeros, zeros)
    inside = 0.5 - 0.5 * np.cos(np.pi * (np.arange(2 * DEGREE) + 0.5) / (2 * DEGREE))
    coefficients = []
    for begin, end in pairwise(breaks):
        t = (end - begin) * inside
        q = np.array([np.ravel(search.CB.pc(begin + each)) for each in t])
        fitted, *_ = np.linalg.lstsq(np.vander(t, DEGREE + 1), q)
        if np.abs(np.vander(t, DEGREE + 1) @ fitted - q).max() > 1e-9:
            raise RuntimeError(f"the spline is no polynomial of degree {DEGREE}")
        coefficients.append(fitted)
    return {"breaks": breaks.tolist(), "coefficients": np.array(coefficients).transpose(1, 0, 2).tolist()}


def robot_of(arm: Case) -> Any:
    """What figaroh takes for a robot: Pinocchio's model, with the limits of the case."""
    model, data = irp6_model.model() if arm.name == "IRp-6" else judge.pinocchio_model(arm.name)
    n = model.nv
    L, lower, upper = arm.limits[0]
    model.lowerPositionLimit, model.upperPositionLimit = lower[:n], upper[:n]  # those of single joints come first
    L, _, upper = arm.limits[1]
    model.velocityLimit = np.abs(np.linalg.inv(L)) @ upper  # of every joint on its own
    model.effortLimit = np.full(n, UNLIMITED)
    return SimpleNamespace(model=model, data=data, q0=np.zeros(n), v0=np.zeros(n))


def motion(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """The best iterate of all descents."""
    np.random.seed(wanted["seed"])  # noqa: NPY002  figaroh draws from NumPy's global generator
    arm = case(wanted["case"])
    search = Search(arm, robot_of(arm), wanted["cpu"])
    search.WP.gen_rand_pool(np.zeros((3, search.model.nv)))
    descents, zeros = 0, np.zeros(search.model.nv)
    with contextlib.redirect_stdout(io.StringIO()):
        while time.process_time() < wanted["cpu"]:
            begin = np.array([np.random.choice(pool) for pool in search.WP.pool_q.T])  # noqa: NPY002
            search._attempt_segment(0, begin, zeros, zeros, None)
            descents += 1
    return {
        "trajectory": best(arm, [pieces(search, each) for each in search.iterates]),
        "iterates": len(search.iterates),
        "descents": descents,
    }
