"""Serialisable description of a design problem, from which another process builds it; its memory and time.

What grows is the motion at the instants of its files, in equations and as samples; the basis of the family at the
instants where limits are imposed, and the Hessian of the search. The time of a start is that of its steps, which grows
with the coefficients, and of the factors of its Hessian, with their third power.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from constraints.closed_loops import closing_limits, free_limits
from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.design.grid_limits import GridLimits
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem, SmoothObjective
from excite.design.stated_limits import StatedWorld, nonlinear_limits, stated_limits
from excite.information.goal import Goal
from excite.information.matrix import Information
from excite.information.target import IdentificationTarget, model_of
from excite.information.tracking import LinearServos
from excite.registry import instance
from excite.tasks.task import Task
from regressors.models.partial import PartialMotion
from regressors.robot.archive import robot_from_description
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Index
from regressors.work_prediction import FLOAT, check_memory

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
        limits = restricted_limits(free_limits(robot), motion)
        family, equations = task.trajectory.family(), task.model.equations
        slowest = min((float(limit.upper.min()) for limit in limits if limit.derivative == 1), default=1.0)
        soft = model_of(robot, task, _SIGN_WIDTH * slowest).restricted(motion, equations)
        symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
        function = VectorisedFunction(symbols, soft.expression(*symbols)[:, self.index.tolist()])
        samples, grid = objective_instants(family.richness), grid_instants(family.richness)
        combination = soft.combination(task.trajectory.period, samples)
        servos, pose = task.objective.servos, motion.poses(self.centre)
        tracking = None if servos is None else LinearServos.of(servos, robot, pose, task.trajectory.period)
        information = Information(function, family, combination, motion, self.noise, tracking)
        exact = model_of(robot, task).restricted(motion, equations)

        def rows(x: Array) -> Array:
            time = exact.times(task.trajectory.period, task.output.rate)
            told = information.trajectory(x).samples(time)
            W = exact.assemble(told if tracking is None else tracking.samples(told))[:, self.index]
            return W.reshape(-1, self.noise.size, self.index.size) / self.noise[:, None]

        def exact_matrix(x: Array) -> Array:
            W = rows(x)
            return np.asarray(np.tensordot(W, W, ((0, 1), (0, 1))) / len(W))

        prior = self.precision
        prior = prior / len(rows(family.resting(self.centre))) if np.any(prior) else prior
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
                exact_matrix=exact_matrix,
            ),
            limits=GridLimits.imposed(
                family.on_grid(grid), limits, (*closing_limits(robot), *nonlinear), motion, stated
            ),
            centre=self.centre,
            shapes=task.search.start,
            initial=self.initial,
        )
        if not stated:
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


_EQUATIONS = 2.6  # copies of the regressor that are held at once
_OF_ANY, _SAMPLES = 2.0, 24.0  # numbers of each sample, and of each of its joints
_BASIS = 5.0  # derivatives of the basis, and what is computed with it
_HESSIAN = 4.0  # matrices of the size of the Hessian
TYPICAL_STARTS = 60  # starts of a search that adapts their number
_STEPS, _FACTORS = 1e-2, 6e-7  # seconds of a start for each coefficient, and for its third power


def check_richness(task: Task) -> None:
    """Refuse a family whose basis alone is too large, before it is built."""
    option, value = task.trajectory.richness
    if isinstance(task.trajectory.kind, type):  # no family has fewer functions or instants
        held = FLOAT * _BASIS * grid_instants(value // 2) * value
        check_memory("the design", held, f"a basis of {value} functions", f"lower `{option}`")


def check_size(target: IdentificationTarget, task: Task) -> None:
    """Refuse a design that takes more memory than it may; the factors are measured, without nonlinear limits."""
    model, output, size = target.model, task.output, _coefficients(target, task)
    short = model.window is not None and model.window.kind == "short"
    rate = max(output.rate, 2.0 / model.window.length) if short and model.window is not None else output.rate
    rest = 2.0 * output.settle if output.home is not None else 0.0
    equations = task.trajectory.period * rate
    samples = (task.trajectory.period + rest) / min(output.speed, default=1.0) * output.rate
    held = _EQUATIONS * equations * len(model.row_labels) * len(model.columns)
    held += samples * (_OF_ANY + _SAMPLES * target.robot.n)
    remedy = "lower `rate`, `period` or `settle`, or raise `speed`" + ", or `window_length`" * short
    check_memory("the design", FLOAT * held, f"{max(equations, samples):.3g} instants", remedy)
    richness = task.trajectory.family().richness
    instants = grid_instants(richness) + objective_instants(richness)
    basis = _BASIS * instants * size / len(target.motion.labels)
    processes = 1 + (task.search.executor == "process") * workers_of(task, task.search.first)
    remedy = f"lower `{task.trajectory.richness[0]}`"
    check_memory("the design", processes * FLOAT * (basis + _HESSIAN * size**2), f"{size} coefficients", remedy)


def _coefficients(target: IdentificationTarget, task: Task) -> int:
    return int(np.size(task.trajectory.family().resting(np.zeros(len(target.motion.labels)))))


def workers_of(task: Task, starts: int) -> int:
    """Number of processes that work on so many starts at a time."""
    return min(task.search.workers or os.cpu_count() or 1, starts) if task.search.executor == "process" else 1


def search_seconds(target: IdentificationTarget, task: Task, starts: int) -> float:
    """Time that so many starts of the task take, in the processes that it has [s]; right within a factor of five."""
    size = float(_coefficients(target, task))
    return starts * (_STEPS * size + _FACTORS * size**3) / max(workers_of(task, starts), 1)
