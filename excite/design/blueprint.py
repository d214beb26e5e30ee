"""Serialisable description of a design problem, from which another process builds it; memory and time that it takes.

What grows is the motion at the instants of its files, in equations and as samples; the basis of the family at the
instants where limits are imposed, and the Hessian of the search; and what is kept of every start. The time of a start
is that of its steps, which grows with the coefficients, and of the factors of its Hessian, with their third power.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.grid_limits import GridLimits
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem, SmoothObjective
from excite.design.stated_limits import StatedWorld, nonlinear_limits, stated_limits
from excite.information.goal import Goal
from excite.information.matrix import Information
from excite.information.target import IdentificationTarget, model_of
from excite.information.tracking import LinearServos
from excite.registry import instance, part
from excite.storage.work_prediction import FLOAT, MemoryPart, WorkPrediction
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
        family, equations = task.trajectory.family(), task.model.equations
        slowest = min((float(limit.upper.min()) for limit in limits if limit.derivative == 1), default=1.0)
        soft = model_of(robot, task, _SIGN_WIDTH * slowest).restricted(motion, equations)
        symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
        function = VectorisedFunction(symbols, soft.expression(*symbols)[:, self.index.tolist()])
        samples, grid = objective_instants(family.richness), grid_instants(family.richness)
        combination = soft.combination(task.trajectory.period, samples)
        servos, pose = task.objective.servos, motion.matrix @ self.centre + motion.offset
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
            limits=GridLimits.imposed(family.on_grid(grid), limits, nonlinear, motion, stated),
            centre=self.centre,
            shapes=task.search.start,
            initial=self.initial,
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


_EQUATIONS = 2.6  # copies of the regressor that are held at once
_OF_ANY, _SAMPLES = 2.0, 24.0  # numbers of each sample, and of each of its joints
_BASIS = 5.0  # derivatives of the basis, and what is computed with it
_HESSIAN = 4.0  # matrices of the size of the Hessian
TYPICAL_STARTS = 60  # starts of a search that adapts their number
_START = 100.0  # bytes of a start: all but the best are on the disk only
_STEPS, _FACTORS = 1e-2, 6e-7  # seconds of a start for each coefficient, and for its third power


def check_richness(task: Task) -> None:
    """Refuse a family whose basis alone is too large, before it is built."""
    option, value = task.trajectory.richness
    if isinstance(task.trajectory.kind, type):  # no family has fewer functions or instants
        least = _basis(value, grid_instants(value // 2), 1, option, value)
        WorkPrediction("the design", (least,)).check()


def design_prediction(target: IdentificationTarget, task: Task) -> WorkPrediction:
    """Memory and time of the design of a task; the factors are measured, without limits of torques or distances."""
    family, processes = task.trajectory.family(), 1
    if task.search.executor == "process":  # the problem is in this process too
        processes += workers_of(task, task.search.first)
    option, value = task.trajectory.richness
    coordinates = len(target.motion.labels)
    size = int(np.size(family.resting(np.zeros(coordinates))))
    instants = grid_instants(family.richness) + objective_instants(family.richness)
    hessian = processes * FLOAT * _HESSIAN * size**2
    starts = TYPICAL_STARTS if task.search.adaptive else task.search.first
    return WorkPrediction(
        "the design",
        (
            _motion(target, task),
            _basis(size // coordinates, instants, processes, option, value),
            MemoryPart("rows of the Hessian of the search", size, size, hessian, option, value, 2.0),
            MemoryPart("starts", starts, 1, starts * _START, "starts", starts),
        ),
        starts * (_STEPS * size + _FACTORS * float(size) ** 3),
    )


def workers_of(task: Task, starts: int) -> int:
    """Number of processes that work on so many starts at a time."""
    return min(task.search.workers or os.cpu_count() or 1, starts) if task.search.executor == "process" else 1


def search_seconds(target: IdentificationTarget, task: Task, starts: int) -> float:
    """Time that so many starts of the task take, in the processes that it has [s]; right within a factor of five."""
    seconds = design_prediction(target, task).seconds
    every = TYPICAL_STARTS if task.search.adaptive else task.search.first
    return (seconds or 0.0) / every * starts / max(workers_of(task, starts), 1)


def _basis(size: int, instants: int, processes: int, option: str, value: int) -> MemoryPart:
    """Basis of a family at the instants of a search, in each process, by the option that makes it large."""
    held = processes * FLOAT * _BASIS * instants * size
    return MemoryPart("instants of the search", instants, size, held, option, value, 2.0)


def _motion(target: IdentificationTarget, task: Task) -> MemoryPart:
    """The motion at the rate of its files, at rest for as long as asked for, and its equations."""
    model, period, output = target.model, task.trajectory.period, task.output
    window = model.window if model.window is not None and model.window.kind == "short" else None
    rate = output.rate if window is None else max(output.rate, 2.0 / window.length)
    rest = 2.0 * output.settle if output.home is not None else 0.0
    slowest = min(output.speed, default=1.0)
    equations = _EQUATIONS * period * rate * len(model.row_labels) * len(model.columns)
    played = (period + rest) / slowest * output.rate
    samples = played * (_OF_ANY + _SAMPLES * target.robot.n)
    larger = {"rate": output.rate / 100.0, "period": period / 10.0, "settle": rest / 2.0, "speed": 1.0 / slowest}
    given = {"rate": output.rate, "period": period, "settle": output.settle, "speed": slowest}
    if window is not None and rate > output.rate and equations > samples:
        name, value, power = "window_length", window.length, -1.0
    else:
        name = max(larger, key=lambda option: larger[option])
        value, power = given[name], -1.0 if name == "speed" else 1.0
    rows = max(played, period * rate)
    return MemoryPart("instants", rows, len(model.columns), FLOAT * (equations + samples), name, value, power)
