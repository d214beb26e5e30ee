"""From a robot and a task to a design problem, with every check that must come before an optimisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from constraints.diagnosis import interior_pose
from constraints.linear import LinearConstraint, linear_limits
from excite.criteria import ConditionNumber
from excite.information import Information
from excite.problem import Problem
from excite.starts import random_motion
from excite.task import Task
from excite.trajectories import FourierFamily, LinearFamily
from regressors.archive import robot_from_description
from regressors.base import Base, base_parameters
from regressors.differential import DifferentialModel
from regressors.errors import InputError
from regressors.lanes import LaneFunction
from regressors.resting import with_resting_joints
from regressors.robot import Robot
from regressors.samples import Array, Index

_SIGN_WIDTH = 0.02  # of the velocity limit: Coulomb friction's sign is this soft for the optimiser, exact in results
_FEWEST_SAMPLES, _SAMPLES_PER_HARMONIC = 100, 20
_FEWEST_INSTANTS, _INSTANTS_PER_HARMONIC = 512, 64


def family_of(task: Task) -> LinearFamily:
    """Trajectory family that a task asks for."""
    return FourierFamily(task.period, task.harmonics)


def moving_robot(robot: Robot, task: Task) -> Robot:
    """The task's robot: its limits, and only the joints that move."""
    robot = task.limits.applied(robot)
    if task.joints is not None:
        return with_resting_joints(robot, [robot.joint_index(name) for name in task.joints])
    forms = robot.structure.aggregates
    names = forms[0].joints if forms else robot.joint_names
    return with_resting_joints(robot, [robot.joint_index(name) for name in names])


def model_of(robot: Robot, task: Task, sign_width: float = 0.0) -> DifferentialModel:
    """Model that a task asks for."""
    return DifferentialModel(robot, task.terms, sign_width=sign_width)


def convention_transform(base: Base, convention: str, model: DifferentialModel) -> Array:
    """Matrix T that takes the reference base columns to another convention's: ``W_c = W_b T``.

    Parameters
    ----------
    base : Base
        Reference base, left-to-right QR.
    convention : {"gautier", "pivoted", "orthonormal"}
    model : DifferentialModel

    Returns
    -------
    ndarray, shape (b, b)
        For ``orthonormal`` a factor with the singular values of the full regressor.
    """
    if convention == "orthonormal":
        return base.full_rank_factor
    if convention == "pivoted":
        return np.asarray(base.D[:, base_parameters(model, "pivoted").index])
    return np.eye(base.rank)


@dataclass(frozen=True, eq=False)
class Blueprint:
    """What another process needs to build the same problem.

    Parameters
    ----------
    robot : dict
        Description of the moving robot.
    task : Task
    index : ndarray of int, shape (b,)
        Reference base columns.
    transform : ndarray, shape (b, b)
    centre : ndarray, shape (n,)
        Pose inside the position limits.
    """

    robot: dict[str, object]
    task: Task
    index: Index
    transform: Array
    centre: Array

    def problem(self) -> Problem:
        """The design problem."""
        robot, task = robot_from_description(self.robot), self.task
        limits = linear_limits(robot)
        family = family_of(task)
        soft = self._columns(robot, _SIGN_WIDTH * _slowest(limits))
        exact = self._columns(robot, 0.0) if task.friction else soft
        samples = max(_FEWEST_SAMPLES, _SAMPLES_PER_HARMONIC * task.harmonics)
        grid = max(_FEWEST_INSTANTS, _INSTANTS_PER_HARMONIC * task.harmonics)
        return Problem(
            Information(soft, family, samples),
            self.transform,
            ConditionNumber(),
            family,
            limits,
            self.centre,
            grid,
            Information(exact, family, round(task.rate * task.period)),
        )

    def _columns(self, robot: Robot, sign_width: float) -> LaneFunction:
        """Regressor of one instant in the reference base columns."""
        symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
        rows = model_of(robot, self.task, sign_width).rows(*symbols)
        return LaneFunction(symbols, rows[:, self.index.tolist()])


def _slowest(limits: tuple[LinearConstraint, ...]) -> float:
    return min((float(limit.upper.min()) for limit in limits if limit.derivative == 1), default=1.0)


@dataclass(frozen=True, eq=False)
class Formulation:
    """A checked design problem.

    Parameters
    ----------
    robot : Robot
        The moving robot.
    task : Task
    model : DifferentialModel
        With exact friction.
    base : Base
        Reference base columns.
    limits : tuple of LinearConstraint
    blueprint : Blueprint
    notes : tuple of str
        What the user should know before the robot moves.
    """

    robot: Robot
    task: Task
    model: DifferentialModel
    base: Base
    limits: tuple[LinearConstraint, ...]
    blueprint: Blueprint
    notes: tuple[str, ...]

    @cached_property
    def problem(self) -> Problem:
        """The problem, built in this process."""
        return self.blueprint.problem()


def formulate(robot: Robot, task: Task) -> Formulation:
    """Build and check the design problem of a task.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task

    Returns
    -------
    Formulation

    Raises
    ------
    InputError
        Unknown joints, limits that contradict each other or leave a joint unbounded, a model without a visible
        parameter, or too few harmonics for its parameters.
    """
    moving = moving_robot(robot, task)
    limits = linear_limits(moving)
    _check_bounded(moving, limits)
    family_of(task)
    centre = interior_pose(limits, moving.n)
    model = model_of(moving, task)
    base = base_parameters(model)
    if base.rank == 0:
        raise InputError(f"no motion of {', '.join(moving.joint_names)} shows any parameter of the {task.model} model")
    transform = convention_transform(base, task.base, model)
    blueprint = Blueprint(moving.description(), task, base.index, transform, centre)
    made = Formulation(moving, task, model, base, limits, blueprint, _notes(moving, limits))
    _check_excitable(made)
    return made


def _bounded(limits: tuple[LinearConstraint, ...], n: int, derivatives: tuple[int, ...]) -> list[bool]:
    """Which joints are bounded in one of these derivatives: those spanned by the limited functions."""
    rows = [limit.matrix for limit in limits if limit.derivative in derivatives]
    A = np.concatenate([np.zeros((0, n)), *rows])
    projector = np.linalg.pinv(A) @ A if A.size else np.zeros((n, n))
    return [bool(ok) for ok in np.isclose(np.diag(projector), 1.0, atol=1e-9)]


def _check_bounded(robot: Robot, limits: tuple[LinearConstraint, ...]) -> None:
    bounded = _bounded(limits, robot.n, (1, 2, 3))
    if not all(bounded):
        free = [name for name, ok in zip(robot.joint_names, bounded, strict=True) if not ok]
        raise InputError(
            f"no velocity or acceleration limit bounds joint {', '.join(free)}; "
            "give --velocity-limit and --acceleration-limit, or limits in the robot's file"
        )


def _notes(robot: Robot, limits: tuple[LinearConstraint, ...]) -> tuple[str, ...]:
    bounded = _bounded(limits, robot.n, (2,))
    free = [name for name, ok in zip(robot.joint_names, bounded, strict=True) if not ok]
    if not free:
        return ()
    return (f"no acceleration limit is known for {', '.join(free)}; --acceleration-limit gives one",)


def _check_excitable(made: Formulation) -> None:
    """Random motions of the family must show every base parameter."""
    rank, missing = _visible(made.problem, made.base)
    if rank == made.base.rank:
        return
    needed = next((K for K in range(made.task.harmonics + 1, 21) if _rank_with(made, K) == made.base.rank), None)
    cure = f"{needed} harmonics show all" if needed else "more harmonics do not help"
    raise InputError(
        f"harmonics: motions of {made.task.harmonics} harmonic(s) show {rank} of {made.base.rank} parameters, "
        f"not {', '.join(missing)}; {cure}"
    )


def _rank_with(made: Formulation, harmonics: int) -> int:
    task = replace(made.task, harmonics=harmonics)
    return _visible(replace(made.blueprint, task=task).problem(), made.base)[0]


def _visible(problem: Problem, base: Base) -> tuple[int, list[str]]:
    """Number of base parameters that random motions show, and the names of those that they do not."""
    rng = np.random.default_rng(0)
    best, missing = 0, list(base.names)
    for _ in range(3):
        M = problem.information.evaluate(random_motion(problem, rng)).M
        scale = np.sqrt(np.where(np.diag(M) > 0, np.diag(M), 1.0))
        eigenvalues, V = np.linalg.eigh(M / np.outer(scale, scale))
        hidden = eigenvalues < 1e-13 * eigenvalues[-1]
        if base.rank - int(hidden.sum()) > best:
            best = base.rank - int(hidden.sum())
            part = np.sum(V[:, hidden] ** 2, axis=1)
            missing = [name for name, weight in zip(base.names, part, strict=True) if weight > 1e-6]
    return best, missing
