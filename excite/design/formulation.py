"""From a robot and a task to a design problem, with every check that must come before an optimisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from threadpoolctl import threadpool_limits

from constraints.feasibility.diagnosis import interior_pose
from constraints.linear import LinearConstraint, linear_limits, spanned
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import check_home
from excite.design.grid_limits import GridLimits
from excite.design.imposed_limits import nonlinear_limits, roomy_pose
from excite.design.initial_guesses import random_motion
from excite.design.objective import Objective
from excite.design.problem import InitialGuess, Problem
from excite.design.solvers import solver
from excite.design.warm_start import initial_motion
from excite.information.criteria import criterion
from excite.information.identifiability import Observability, motion_that_shows
from excite.information.matrix import Information
from excite.information.target import Subject, model_of, moving_robot, seen_by, subject_of
from excite.information.weighting import weighting_of
from excite.registry import WINDOWED
from excite.tasks.task import Task
from excite.trajectories import family_of, finer
from regressors.errors import InputError, UnknownName
from regressors.friction.curves import Warm, drives_with_friction
from regressors.friction.temperature import warm_part
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion
from regressors.robot.archive import robot_from_description
from regressors.robot.robot import Robot
from regressors.samples import Array, Index
from regressors.symbolic.vectorised import LaneFunction

_SIGN_WIDTH = 0.02  # of the velocity limit: Coulomb friction's sign is this soft for the optimiser, exact in results
_FEWEST_SAMPLES, _SAMPLES_PER_HARMONIC = 100, 20
_FEWEST_INSTANTS, _INSTANTS_PER_HARMONIC = 512, 64


@dataclass(frozen=True, eq=False)
class Blueprint:
    """What another process needs to build the same problem.

    Parameters
    ----------
    robot, whole : dict
        Descriptions of the moving robot and of the whole one.
    motion : PartialMotion
    task : Task
    index : ndarray of int, shape (b,)
        Reference base columns.
    transform : ndarray, shape (b, b)
    centre : ndarray, shape (k,)
        Pose of the moving coordinates inside the position limits.
    noise : ndarray, shape (r,)
        What the rows of each equation are divided by.
    precision : ndarray, shape (b, b)
        Prior knowledge, see `excite.information.weighting`.
    initial : ndarray, shape (N, k), optional
        Positions of the moving coordinates in the motion to begin with.
    """

    robot: dict[str, object]
    whole: dict[str, object]
    motion: PartialMotion
    task: Task
    index: Index
    transform: Array
    centre: Array
    noise: Array
    precision: Array
    initial: Array | None = None

    def problem(self, nonlinear: tuple[NonlinearConstraint, ...] | None = None) -> Problem:
        """The design problem.

        Parameters
        ----------
        nonlinear : tuple of NonlinearConstraint, optional
            Limits that this process has built already, see `nonlinear_limits`.
        """
        robot, task, motion = robot_from_description(self.robot), self.task, self.motion
        limits = _restricted(linear_limits(robot), motion)
        family = family_of(task)
        soft = seen_by(model_of(robot, task, _SIGN_WIDTH * _slowest(limits)), motion, task.equations)
        symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
        function = LaneFunction(symbols, soft.expression(*symbols)[:, self.index.tolist()])
        samples = max(_FEWEST_SAMPLES, _SAMPLES_PER_HARMONIC * family.richness)
        grid = max(_FEWEST_INSTANTS, _INSTANTS_PER_HARMONIC * family.richness)
        combination = soft.combination(task.period, samples)
        information = Information(function, family, combination, motion, self.noise)
        exact = seen_by(model_of(robot, task), motion, task.equations)

        def rows(x: Array) -> Array:
            W = exact.assemble(information.trajectory(x).samples(exact.times(task.period, task.rate)))[:, self.index]
            return W.reshape(-1, self.noise.size, self.index.size) / self.noise[:, None]

        def exact_matrix(x: Array) -> Array:
            W = rows(x)
            return np.asarray(np.tensordot(W, W, ((0, 1), (0, 1))) / len(W))

        prior = self.precision
        if np.any(prior):
            prior = prior / len(rows(family.resting(self.centre)))
        if nonlinear is None:
            nonlinear = nonlinear_limits(robot_from_description(self.whole), robot.joint_names, task)
        return Problem(
            family=family,
            objective=Objective(
                information=information,
                transform=self.transform,
                criterion=criterion(task.criterion),
                prior=prior,
                unit=combination.unit,
                exact=exact_matrix,
            ),
            limits=GridLimits.imposed(family.on_grid(grid), limits, nonlinear, motion),
            guess=InitialGuess(self.centre, task.start, self.initial),
        )


def _restricted(limits: tuple[LinearConstraint, ...], motion: PartialMotion) -> tuple[LinearConstraint, ...]:
    return tuple(found for found in (limit.restricted(motion) for limit in limits) if found.labels)


def _slowest(limits: tuple[LinearConstraint, ...]) -> float:
    return min((float(limit.upper.min()) for limit in limits if limit.derivative == 1), default=1.0)


@dataclass(frozen=True, eq=False)
class Formulation:
    """A checked design problem.

    Parameters
    ----------
    subject : Subject
        What is to be identified.
    task : Task
    limits : tuple of LinearConstraint
        Of the moving robot's joints and drives.
    nonlinear : tuple of NonlinearConstraint
        Of torques and of the tool, where the task asks for them.
    way_limits : tuple of NonlinearConstraint
        The same as functions of every joint, for the ways from home and back; none without a home.
    blueprint : Blueprint
    notes : tuple of str
        What the user should know before the robot moves.
    """

    subject: Subject
    task: Task
    limits: tuple[LinearConstraint, ...]
    nonlinear: tuple[NonlinearConstraint, ...]
    way_limits: tuple[NonlinearConstraint, ...]
    blueprint: Blueprint
    notes: tuple[str, ...]

    @cached_property
    def problem(self) -> Problem:
        """The problem, built in this process."""
        return self.blueprint.problem(self.nonlinear)


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
    family = family_of(task)
    if not (family.linear or solver(task.solver).nonlinear):
        raise InputError(f"motions of the family {family.name} are for the solver sqp, not for {task.solver}")
    if task.model in WINDOWED and task.window == "short" and task.window_length >= task.period:
        raise InputError(f"a window of {task.window_length:g} s is longer than the motion of {task.period:g} s")
    subject = subject_of(robot, task)
    motion = subject.motion
    limits = linear_limits(subject.robot)
    restricted = _restricted(limits, motion)
    _check_bounded(motion, restricted)
    nonlinear = nonlinear_limits(robot, subject.robot.joint_names, task)
    if nonlinear and not solver(task.solver).nonlinear:
        what = "limits of torques, of the tool and of collisions"
        raise InputError(f"{what} are for the solver sqp, not for {task.solver}")
    centre = interior_pose(restricted, len(motion.labels))
    centre = roomy_pose(nonlinear, restricted, motion, centre)
    rest = motion.matrix @ centre + motion.offset
    way_limits = _way_limits(robot, task, subject.robot.joint_names, nonlinear)
    check_home(robot, task, subject.robot.joint_names, rest, way_limits)
    if len(task.start) not in (1, len(motion.labels)):
        raise InputError(f"start needs one shape, or {len(motion.labels)} for {', '.join(motion.labels)}")
    if task.model == "energy" and task.equations is not None:
        raise InputError("equations: the energy model has a single equation, the work; nothing to choose")
    if subject.base.rank == 0:
        raise InputError(f"no motion of {', '.join(motion.labels)} shows any parameter of the {task.model} model")
    _check_required(subject, model_of(subject.robot, task), task)
    weighting = weighting_of(subject, task)
    blueprint = Blueprint(
        robot=subject.robot.description(),
        whole=robot.description(),
        motion=motion,
        task=task,
        index=subject.base.index,
        transform=weighting.transform,
        centre=centre,
        noise=weighting.noise,
        precision=weighting.precision,
        initial=initial_motion(subject, task),
    )
    told = (note for limit in nonlinear for note in limit.notes)
    notes = (*_notes(motion, restricted), *_prior_notes(task), *_friction_notes(subject, task), *told)
    made = Formulation(subject, task, limits, nonlinear, way_limits, blueprint, notes)
    with threadpool_limits(1):
        _check_excitable(made)
    return made


def _way_limits(
    robot: Robot, task: Task, joints: tuple[str, ...], nonlinear: tuple[NonlinearConstraint, ...]
) -> tuple[NonlinearConstraint, ...]:
    """Nonlinear limits as functions of every joint; those of the motion itself if it moves all."""
    if task.home is None:
        return ()
    return nonlinear if joints == robot.joint_names else nonlinear_limits(robot, robot.joint_names, task)


def _check_bounded(motion: PartialMotion, limits: tuple[LinearConstraint, ...]) -> None:
    bounded = spanned(limits, len(motion.labels), (1, 2, 3))
    if not all(bounded):
        free = [name for name, ok in zip(motion.labels, bounded, strict=True) if not ok]
        raise InputError(
            f"no velocity or acceleration limit bounds joint {', '.join(free)}; "
            "give --velocity-limit and --acceleration-limit, or limits in the robot's file"
        )


def _notes(motion: PartialMotion, limits: tuple[LinearConstraint, ...]) -> tuple[str, ...]:
    bounded = spanned(limits, len(motion.labels), (2,))
    free = [name for name, ok in zip(motion.labels, bounded, strict=True) if not ok]
    if not free:
        return ()
    return (f"no acceleration limit is known for {', '.join(free)}; --acceleration-limit gives one",)


def _prior_notes(task: Task) -> tuple[str, ...]:
    if task.prior is None or task.noise is not None:
        return ()
    return ("prior knowledge counts by the noise of the measurements: 1 is assumed, --noise gives it",)


def _friction_notes(subject: Subject, task: Task) -> tuple[str, ...]:
    """Drives that turn without a curve where friction is known, and temperatures that the others' are taken at."""
    curves = task.known_friction
    if curves is None:
        return ()
    drives = drives_with_friction(subject.robot)
    turning = [name for name, row in drives if np.any(np.abs(row @ subject.motion.matrix) > 1e-12)]
    limited = task.torque_margin is not None
    warm = {name: curve for name in turning if (curve := warm_part(curves.curve(name))) is not None} if limited else {}
    notes = tuple(f"torque limits take friction of {name} {_temperatures(curve)}" for name, curve in warm.items())
    without = [name for name in turning if curves.curve(name) is None]
    if not without:
        return notes
    told = "; torque limits count what the robot's description states" if limited else ""
    return (f"no friction curve of {', '.join(without)}: taken to have no friction in identification{told}", *notes)


def _temperatures(curve: Warm) -> str:
    """At which a torque limit takes friction, in words."""
    if curve.range is None:
        return f"at {curve.reference:.4g} deg C only: its file has no range"
    low, high = (f"{end:.4g}" for end in curve.range)
    return f"at {low} deg C only: its file has no wider range" if low == high else f"from {low} to {high} deg C"


def _check_required(subject: Subject, whole: RegressorModel, task: Task) -> None:
    """Parameters that the task requires must be shown by its motion; if not, name a motion that shows them."""
    if not task.require:
        return
    for name in task.require:
        if name not in whole.names:
            raise UnknownName("parameter", name, whole.names)
    observability = Observability(whole)
    shown = observability.shown([observability.rows(subject.motion, task.equations)])
    for index in (whole.names.index(name) for name in task.require):
        if index in shown:
            continue
        cure = motion_that_shows(whole, index)
        where = f"a motion of {', '.join(cure)} shows it" if cure else "no motion shows it on its own"
        raise InputError(f"a motion of {', '.join(subject.motion.labels)} does not show {whole.names[index]}; {where}")


def _check_excitable(made: Formulation) -> None:
    """Random motions of the family must show every base parameter."""
    rank, missing = _visible(made.problem, made.subject.base)
    if rank == made.subject.base.rank:
        return
    option, shown = finer(made.task)[1], made.task.trajectory
    given = getattr(made.task, option)
    needed = next((given + by for by in range(1, 21 - given) if _rank_with(made, by) == made.subject.base.rank), None)
    cure = f"{needed} {option} show all" if needed else f"more {option} do not help"
    raise InputError(
        f"{option}: {shown} motions of {given} {option} show {rank} of {made.subject.base.rank} parameters, "
        f"not {', '.join(missing)}; {cure}"
    )


def _rank_with(made: Formulation, by: int) -> int:
    task = finer(made.task, by)[0]
    return _visible(replace(made.blueprint, task=task).problem(made.nonlinear), made.subject.base)[0]


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


__all__ = ["Blueprint", "Formulation", "family_of", "formulate", "model_of", "moving_robot"]
