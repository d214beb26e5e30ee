"""Serialisable description of a design problem, from which another process builds it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.grid_limits import GridLimits
from excite.design.initial_guesses import random_motion
from excite.design.problem import InitialGuess, Problem, SmoothObjective
from excite.design.stated_limits import StatedWorld, nonlinear_limits, stated_limits
from excite.information.goal import Goal
from excite.information.matrix import Information
from excite.information.target import model_of
from excite.registry import instance, part
from excite.tasks.task import Task
from regressors.models.partial import PartialMotion
from regressors.robot.archive import robot_from_description
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Index

_SIGN_WIDTH = 0.02  # of the velocity limit: width of Coulomb friction's smooth sign; results use the exact sign
_FEWEST_SAMPLES, _SAMPLES_PER_HARMONIC = 100, 20
_MOTIONS = 8  # such as a search begins with: limits that one of them breaks are imposed at once
_FEWEST_INSTANTS, _INSTANTS_PER_HARMONIC = 512, 64


@dataclass(frozen=True, eq=False)
class Blueprint:
    """Data from which another process builds the same problem."""

    robot: dict[str, object]  # descriptions of the moving robot and of the whole one
    whole: dict[str, object]
    motion: PartialMotion
    task: Task
    index: Index  # (b,) reference base columns
    transform: Array  # (b, b)
    centre: Array  # (k,) pose of the moving coordinates inside the position limits
    noise: Array  # (r,) divisor of the rows of each equation
    precision: Array  # (b, b) prior knowledge, see `excite.information.weighting`
    world: StatedWorld  # bodies that stay apart by default, see `excite.design.stated_limits.stated_world`
    initial: Array | None = None  # (N, k) positions of the moving coordinates in the initial motion
    goal: Goal = field(default_factory=Goal)  # what the criterion takes from the model

    def problem(
        self,
        nonlinear: tuple[NonlinearConstraint, ...] | None = None,
        stated: tuple[NonlinearConstraint, ...] | None = None,
    ) -> Problem:
        """The design problem."""
        robot, task, motion = robot_from_description(self.robot), self.task, self.motion
        limits = restricted_limits(linear_limits(robot), motion)
        family = task.trajectory.family()
        equations = task.model.equations
        soft = model_of(robot, task, _SIGN_WIDTH * _slowest(limits)).restricted(motion, equations)
        symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
        function = VectorisedFunction(symbols, soft.expression(*symbols)[:, self.index.tolist()])
        samples, grid = objective_instants(family.richness), grid_instants(family.richness)
        combination = soft.combination(task.trajectory.period, samples)
        information = Information(function, family, combination, motion, self.noise)
        exact = model_of(robot, task).restricted(motion, equations)

        def rows(x: Array) -> Array:
            time = exact.times(task.trajectory.period, task.output.rate)
            W = exact.assemble(information.trajectory(x).samples(time))[:, self.index]
            return W.reshape(-1, self.noise.size, self.index.size) / self.noise[:, None]

        def exact_matrix(x: Array) -> Array:
            W = rows(x)
            return np.asarray(np.tensordot(W, W, ((0, 1), (0, 1))) / len(W))

        prior = self.precision
        if np.any(prior):
            prior = prior / len(rows(family.resting(self.centre)))
        if nonlinear is None or stated is None:
            whole = robot_from_description(self.whole)
            nonlinear = nonlinear_limits(whole, robot.joint_names, task)
            stated = stated_limits(whole, robot.joint_names, task, self.world).constraints
        problem = Problem(
            family=family,
            objective=SmoothObjective(
                information=information,
                transform=self.transform,
                criterion=self.goal.of(instance("criterion", task.objective.criterion)),
                prior=prior,
                unit=combination.unit,
                exact=exact_matrix,
            ),
            limits=GridLimits.imposed(family.on_grid(grid), limits, nonlinear, motion, stated),
            guess=InitialGuess(self.centre, task.search.start, self.initial),
        )
        if not stated or not part("solver", task.search.solver).takes_nonlinear_limits:
            return problem
        rng = np.random.default_rng(0)
        motions = [random_motion(problem, rng) for _ in range(_MOTIONS)]
        return replace(problem, limits=problem.limits.with_expected(motions))


def objective_instants(richness: int) -> int:
    """Number of instants at which the search evaluates the criterion."""
    return max(_FEWEST_SAMPLES, _SAMPLES_PER_HARMONIC * richness)


def grid_instants(richness: int) -> int:
    """Number of instants at which the search imposes the limits."""
    return max(_FEWEST_INSTANTS, _INSTANTS_PER_HARMONIC * richness)


def restricted_limits(limits: tuple[LinearConstraint, ...], motion: PartialMotion) -> tuple[LinearConstraint, ...]:
    """Limits as functions of the moving coordinates, without those that the motion does not change."""
    return tuple(restricted for restricted in (limit.restricted(motion) for limit in limits) if restricted.labels)


def _slowest(limits: tuple[LinearConstraint, ...]) -> float:
    return min((float(limit.upper.min()) for limit in limits if limit.derivative == 1), default=1.0)
