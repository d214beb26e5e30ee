"""From a robot and a task to a design problem, with every check that must come before an optimisation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from threadpoolctl import threadpool_limits

from constraints.feasibility.diagnosis import interior_pose
from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import check_home
from excite.design.blueprint import Blueprint, restricted_limits
from excite.design.imposed_limits import nonlinear_limits, roomy_pose
from excite.design.problem import Problem
from excite.design.task_checks import check_bounded, check_excitable, check_model, check_required, check_solver
from excite.design.task_notes import task_notes
from excite.design.warm_start import initial_motion
from excite.information.metrics import noise_per_row
from excite.information.target import IdentificationTarget, model_of, target_of
from excite.information.weighting import weighting_of
from excite.tasks.task import Task
from regressors.readers.joint_ranges import refuse_missing_ranges
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Formulation:
    """A checked design problem.

    Parameters
    ----------
    target : IdentificationTarget
        What is to be identified.
    task : Task
    limits : tuple of LinearConstraint
        Of the moving robot's joints and drives.
    nonlinear : tuple of NonlinearConstraint
        Of torques and of the tool, where the task asks for them.
    transfer_limits : tuple of NonlinearConstraint
        The same as functions of every joint, for the ways from home and back; none without a home.
    blueprint : Blueprint
    notes : tuple of str
        What the user should know before the robot moves.
    """

    target: IdentificationTarget
    task: Task
    limits: tuple[LinearConstraint, ...]
    nonlinear: tuple[NonlinearConstraint, ...]
    transfer_limits: tuple[NonlinearConstraint, ...]
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
        Unknown joints, limits that are not stated, contradict each other or leave a joint unbounded, a model without a
        visible parameter, or too few harmonics for its parameters.
    """
    if not task.trajectory.family().linear:
        check_solver(task, f"motions of the family {task.trajectory.name}")
    target = target_of(robot, task)
    motion = target.motion
    refuse_missing_ranges(target.robot, motion.matrix.any(axis=1))
    limits = linear_limits(target.robot)
    restricted = restricted_limits(limits, motion)
    check_bounded(motion, restricted)
    nonlinear = nonlinear_limits(robot, target.robot.joint_names, task)
    if nonlinear:
        check_solver(task, "limits of torques, of the tool and of collisions")
    centre = interior_pose(restricted, len(motion.labels))
    centre = roomy_pose(nonlinear, restricted, motion, centre)
    rest = motion.matrix @ centre + motion.offset
    transfer_limits = _transfer_limits(robot, task, target.robot.joint_names, nonlinear)
    check_home(robot, task, target.robot.joint_names, rest, transfer_limits)
    check_model(target, task)
    noise_per_row(task.objective.noise, target.model)
    check_required(target, model_of(target.robot, task), task)
    weighting = weighting_of(target, task)
    blueprint = Blueprint(
        robot=target.robot.description(),
        whole=robot.description(),
        motion=motion,
        task=task,
        index=target.base.index,
        transform=weighting.transform,
        centre=centre,
        noise=weighting.noise,
        precision=weighting.precision,
        initial=initial_motion(target, task),
    )
    notes = (*task_notes(target, task, restricted), *(note for limit in nonlinear for note in limit.notes))
    formulation = Formulation(target, task, limits, nonlinear, transfer_limits, blueprint, notes)
    with threadpool_limits(1):
        check_excitable(blueprint, formulation.problem, target.base)
    return formulation


def _transfer_limits(
    robot: Robot, task: Task, joints: tuple[str, ...], nonlinear: tuple[NonlinearConstraint, ...]
) -> tuple[NonlinearConstraint, ...]:
    """Nonlinear limits as functions of every joint; those of the motion itself if it moves all."""
    if task.output.home is None:
        return ()
    return nonlinear if joints == robot.joint_names else nonlinear_limits(robot, robot.joint_names, task)
