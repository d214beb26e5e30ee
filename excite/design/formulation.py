"""From a robot and a task to a design problem, with every check that must come before an optimisation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from threadpoolctl import threadpool_limits

from constraints.feasibility.diagnosis import ContradictionError, interior_pose
from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import check_home
from excite.design.blueprint import Blueprint, restricted_limits
from excite.design.design_memory import check_richness, design_prediction
from excite.design.given_task_motion import with_task_motion
from excite.design.imposed_limits import has_room, nonlinear_limits, roomy_pose
from excite.design.information_in_hand import with_information_in_hand
from excite.design.initial_guesses import initial_motion, with_initial_design
from excite.design.problem import Problem
from excite.design.problem_identity import ProblemIdentity, problem_identity
from excite.design.stated_limits import (
    StatedLimits,
    StatedWorld,
    Unchecked,
    gravest_first,
    stated_limits,
    stated_world,
    unchecked_limits,
)
from excite.design.task_checks import (
    check_bounded,
    check_excitable,
    check_gradient,
    check_model,
    check_required,
    check_solver,
    suspecting,
    task_notes,
)
from excite.information.goal import goal_of
from excite.information.metrics import noise_per_row
from excite.information.target import IdentificationTarget, model_of, target_of
from excite.information.weighting import weighting_of
from excite.tasks.task import Task
from regressors.models.partial import PartialMotion
from regressors.numerical import numerical_work
from regressors.readers.joint_ranges import refuse_missing_ranges
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Formulation:
    """A checked design problem."""

    target: IdentificationTarget  # what is to be identified
    task: Task
    limits: tuple[LinearConstraint, ...]  # of the moving robot's joints and drives
    nonlinear: tuple[NonlinearConstraint, ...]  # of torques, of the tool and of distances, where the task asks for them
    stated: tuple[NonlinearConstraint, ...]  # of torques, by default
    unchecked: tuple[Unchecked, ...]  # kinds of limits that nothing is known of
    # the same as functions of every joint, for the ways from home and back; none without a home
    transfer_limits: tuple[NonlinearConstraint, ...]
    blueprint: Blueprint
    notes: tuple[str, ...]  # what the user should know before the robot moves

    @cached_property
    def problem(self) -> Problem:
        """The problem, built in this process."""
        return self.blueprint.problem(self.nonlinear, self.stated)

    @cached_property
    def identity(self) -> ProblemIdentity:
        """What a start's result depends on."""
        return problem_identity(self.blueprint)


@numerical_work(
    "the formulation of the design",
    "values of very different sizes are the likely cause: "
    "check `period`, `noise`, `prior` and the limits of the joints",
)
def formulate(robot: Robot, task: Task) -> Formulation:
    """Build and check the design problem of a task."""
    task = with_information_in_hand(robot, with_task_motion(with_initial_design(task)))
    check_richness(task)
    if not task.trajectory.family().linear:
        check_solver(task, f"motions of the family {task.trajectory.name}")
    target = target_of(robot, task)
    design_prediction(target, task).check()
    motion = target.motion
    refuse_missing_ranges(target.robot, motion.matrix.any(axis=1))
    limits = linear_limits(target.robot)
    restricted = restricted_limits(limits, motion)
    check_bounded(motion, restricted)
    joints = target.robot.joint_names
    world, nonlinear = stated_world(robot, task), nonlinear_limits(robot, joints, task)
    if nonlinear:
        check_solver(task, "limits of torques, of the tool and of collisions")
    with suspecting(robot):
        middle = interior_pose(restricted, len(motion.labels))
        try:
            stated = stated_limits(robot, joints, task, world)
            centre = _pose_to_start_from(nonlinear, stated, restricted, motion, middle)
        except ContradictionError as error:
            if world.world is None or not world.world.self_collision:
                raise
            touch = "capsules around its shapes touch in every pose that was tried"
            world = world.without_self_collision(f"{touch}, {error}")
            stated = stated_limits(robot, joints, task, world)
            centre = _pose_to_start_from(nonlinear, stated, restricted, motion, middle)
    imposed = (*nonlinear, *stated.constraints)
    rest = motion.matrix @ centre + motion.offset
    transfer_limits = _transfer_limits(robot, task, joints, imposed, world)
    check_home(robot, task, joints, rest, transfer_limits)
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
        world=world,
        initial=initial_motion(target, task),
        goal=goal_of(target, task),
    )
    unchecked = gravest_first((*unchecked_limits(motion, restricted), *stated.unchecked))
    of_limits = (*stated.notes, *(note for limit in imposed for note in limit.notes))
    notes = (*task.installation.notes, *task_notes(target, task, restricted), *of_limits)
    formulation = Formulation(
        target, task, limits, nonlinear, stated.constraints, unchecked, transfer_limits, blueprint, notes
    )
    with threadpool_limits(1):
        check_excitable(blueprint, formulation.problem, target.base)
        check_gradient(task, formulation.problem)
    return formulation


def _pose_to_start_from(
    nonlinear: tuple[NonlinearConstraint, ...],
    stated: StatedLimits,
    restricted: tuple[LinearConstraint, ...],
    motion: PartialMotion,
    centre: Array,
) -> Array:
    """Pose that keeps every limit; those that hold by default move it only where they leave it no room."""
    pose = roomy_pose(nonlinear, restricted, motion, centre)
    if has_room(stated.constraints, motion, pose):
        return pose
    try:
        return roomy_pose((*nonlinear, *stated.constraints), restricted, motion, centre)
    except ContradictionError as error:
        raise ContradictionError(
            f"{error}; `torque_margin='none'` leaves out the torque limits of the description, `floor='none'` the "
            "surface that the robot is mounted on"
        ) from error


def _transfer_limits(
    robot: Robot,
    task: Task,
    joints: tuple[str, ...],
    imposed: tuple[NonlinearConstraint, ...],
    world: StatedWorld,
) -> tuple[NonlinearConstraint, ...]:
    """Nonlinear limits as functions of every joint; those of the motion itself if it moves all."""
    if task.output.home is None:
        return ()
    if joints == robot.joint_names:
        return imposed
    joints = robot.joint_names
    return (*nonlinear_limits(robot, joints, task), *stated_limits(robot, joints, task, world).constraints)
