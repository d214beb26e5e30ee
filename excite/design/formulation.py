"""From a robot and a task to a design problem, with every check that must come before an optimisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from constraints.closed_loops import dependent_limits, free_limits
from constraints.diagnosis import ContradictionError, interior_pose, smallest_relaxation
from constraints.linear import QUANTITIES, LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import check_home
from excite.design.blueprint import Blueprint, check_richness, check_size, restricted_limits
from excite.design.design import Design
from excite.design.initial_guesses import initial_motion, with_initial_design
from excite.design.problem import Problem
from excite.design.problem_identity import ProblemIdentity, problem_identity
from excite.design.stated_limits import (
    StatedLimits,
    StatedWorld,
    Unchecked,
    gravest_first,
    nonlinear_limits,
    stated_limits,
    stated_world,
    unchecked_limits,
)
from excite.design.task_checks import (
    check_bounded,
    check_excitable,
    check_gradient,
    check_loops,
    check_model,
    check_required,
    suspecting,
    task_notes,
)
from excite.information.earlier_precision import check_earlier, noise_in_hand
from excite.information.goal import goal_of
from excite.information.matrix import noise_per_row
from excite.information.target import IdentificationTarget, model_of, motion_of, target_of
from excite.information.weighting import weighting_of
from excite.registry import built_in
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.stored_files import TaskMotion, UnopenedFile
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.partial import PartialMotion, of_joints
from regressors.numerical import numerical_work, one_thread
from regressors.readers.description import refuse_missing_ranges
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


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


LIKELY_CAUSE = (
    "values of very different sizes are the likely cause: check `period`, `noise`, `prior` and the limits of the joints"
)


@numerical_work("the formulation of the design", LIKELY_CAUSE)
def formulate(robot: Robot, task: Task) -> Formulation:
    """Build and check the design problem of a task."""
    task = with_information_in_hand(robot, with_servos(with_task_motion(with_initial_design(task))))
    check_richness(task)
    check_loops(robot, task)
    target = target_of(robot, task)
    check_size(target, task)
    if task.objective.servos is not None and target.model.window is not None:
        raise InputError("`servos`: the motion that they make is for models of single instants, without windows")
    motion = target.motion
    refuse_missing_ranges(target.robot, motion.chosen)
    limits = free_limits(target.robot)
    restricted = restricted_limits(limits, motion)
    check_bounded(motion, restricted)
    joints = target.robot.joint_names
    world, nonlinear = stated_world(robot, task), nonlinear_limits(robot, joints, task)
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
    rest = motion.poses(centre)
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
    left_out = (Unchecked(*each) for limit in imposed for each in limit.unchecked.items())
    unchecked = gravest_first((*_unstated(target.robot, motion, limits), *stated.unchecked, *left_out))
    of_limits = (*stated.notes, *(note for limit in imposed for note in limit.notes))
    notes = (*task.installation.notes, *task_notes(target, task, restricted), *of_limits)
    formulation = Formulation(
        target, task, limits, nonlinear, stated.constraints, unchecked, transfer_limits, blueprint, notes
    )
    with one_thread():
        check_excitable(blueprint, formulation.problem, target.base)
        check_gradient(task, formulation.problem)
    return formulation


def _unstated(robot: Robot, motion: PartialMotion, limits: tuple[LinearConstraint, ...]) -> tuple[Unchecked, ...]:
    """Limits that are not stated; of closed loops for each joint, and those that are not checked although they are."""
    if not robot.closures:
        return unchecked_limits(motion, restricted_limits(limits, motion))
    jerks = [name for name, most in zip(robot.joint_names, robot.limits.jerk, strict=True) if np.isfinite(most)]
    following = [name for name in jerks if name not in motion.labels]
    left = unchecked_limits(of_joints(robot, range(robot.n)), (*limits, *dependent_limits(robot)))
    if not following:
        return left
    kept = (each for each in left if each.limit != QUANTITIES[-1])
    return (*kept, Unchecked(QUANTITIES[-1], f"limits of {', '.join(following)} are not checked: they follow others"))


def _pose_to_start_from(
    nonlinear: tuple[NonlinearConstraint, ...],
    stated: StatedLimits,
    restricted: tuple[LinearConstraint, ...],
    motion: PartialMotion,
    centre: Array,
) -> Array:
    """Pose that keeps every limit; those that hold by default move it only where they leave it no room."""
    pose = roomy_pose(nonlinear, restricted, motion, centre)
    q = motion.poses(pose)
    if all(_room(limit, limit.at_rest(q)).min() >= _ROOM for limit in stated.constraints):
        return pose  # a motion can start there
    try:
        return roomy_pose((*nonlinear, *stated.constraints), restricted, motion, centre)
    except ContradictionError as error:
        raise ContradictionError(
            f"{error}; `torque_margin='none'` leaves out the torque limits of the description, `floor='none'` the "
            "surface that the robot is mounted on"
        ) from error


def _transfer_limits(
    robot: Robot, task: Task, joints: tuple[str, ...], imposed: tuple[NonlinearConstraint, ...], world: StatedWorld
) -> tuple[NonlinearConstraint, ...]:
    """Nonlinear limits as functions of every joint; those of the motion itself if it moves all."""
    if task.output.home is None:
        return ()
    if joints == robot.joint_names:
        return imposed
    joints = robot.joint_names
    return (*nonlinear_limits(robot, joints, task), *stated_limits(robot, joints, task, world).constraints)


INSTANTS = 200  # at most: enough for means over a motion, and few enough to be kept with a result


def with_task_motion(task: Task) -> Task:
    """The task with the motion itself whose torques it is to predict, so that a result can hold it."""
    given = task.objective.task_motion
    if given is None or isinstance(given, TaskMotion):
        return task
    if isinstance(given, UnopenedFile):
        raise given.missing()
    if isinstance(given, Design):
        return task.changed(task_motion=task_motion_of(given))
    from excite.design.design_json import read_task_motion

    return task.changed(task_motion=read_task_motion(given))


def task_motion_of(design: Design) -> TaskMotion:
    """The motion of a design at `INSTANTS` instants in equal steps."""
    motion = design.trajectory
    samples = motion.samples((np.arange(INSTANTS) + 0.5) * motion.duration / INSTANTS)
    return TaskMotion(design.name, design.moving.joint_names, samples.q, samples.dq, samples.ddq)


def with_servos(task: Task) -> Task:
    """The task with the values themselves of identified servos, so that a result can hold them."""
    given = task.objective.servos
    return task if given is None else task.changed(servos=built_in("reader", "servos")(given))


def with_information_in_hand(robot: Robot, task: Task) -> Task:
    """The task with the information itself of the results and designs that it names, so that a design can hold it.

    Where the task states no noise, it is that of the results, else that of the designs.
    """
    if not task.objective.after:
        return task
    earlier = tuple(built_in("reader", "earlier")(each) for each in task.objective.after)
    moving = moving_robot(robot, task)
    check_earlier(earlier, robot, moving, task)
    motion = motion_of(task.limits.applied(robot), moving, task)
    model = task.model.built(moving).restricted(motion, task.model.equations)
    return task.changed(after=earlier, noise=noise_in_hand(earlier, model, task))


_POSES, _POSES_FIRST = 4000, 250
_STARTS = 5
_ROOM = 0.02  # of a limit's scale, distance of an initial pose from the bounds
_AMPLE = 0.25  # the same, with which the centre of the linear limits is accepted


def roomy_pose(
    nonlinear: Sequence[NonlinearConstraint], linear: Sequence[LinearConstraint], motion: PartialMotion, centre: Array
) -> Array:
    """Pose of the moving coordinates with ample margin in every limit, also nonlinear ones; the centre where it has."""
    # centre (k,)
    if not nonlinear:
        return centre
    poses = _poses(linear, centre)
    least, q, bar = _linear_room(linear, poses), motion.poses(poses), -np.inf
    for some in np.split(np.arange(len(poses)), [_POSES_FIRST]):
        for limit in nonlinear:
            some = some[least[some] >= bar]  # of poses with less room than the best so far, no more is asked
            least[some] = np.minimum(least[some], _room_at_rest(limit, q[some]))
        if least[0] >= _AMPLE:
            return centre
        bar = best if (best := least[:_POSES_FIRST].max()) >= _ROOM else bar
    order = np.argsort(-least, kind="stable")[:_STARTS]  # the first of many with the same room, on every processor
    if least[order[0]] >= _ROOM:
        return np.asarray(poses[order[0]])
    pose, needed = smallest_relaxation(nonlinear, linear, motion, poses[order], _ROOM)
    if needed:
        cure = " and ".join(map(str, needed))
        raise ContradictionError(f"no pose keeps all limits; the smallest relaxation found that leaves one: {cure}")
    return pose


def _room_at_rest(limit: NonlinearConstraint, q: Array) -> Array:
    """Least room of each pose of all joints."""
    room = _room(limit, limit.values(Samples.at_rest(q)))
    return np.asarray(room.min(axis=1, initial=np.inf))


def _room(limit: NonlinearConstraint, values: Array) -> Array:
    """Distance from the nearer bound as part of the scale."""
    return np.asarray(np.minimum(limit.upper - values, values - limit.lower) / limit.scale)


def _poses(linear: Sequence[LinearConstraint], centre: Array) -> Array:
    """The centre, and random poses in the ranges of the coordinates that are bounded on their own."""
    low, high = np.full(centre.size, -np.inf), np.full(centre.size, np.inf)
    for limit in linear:
        if limit.derivative == 0:
            for row, offset, lower, upper in zip(limit.matrix, limit.offset, limit.lower, limit.upper, strict=True):
                (moved,) = np.nonzero(row)
                if moved.size == 1:
                    ends = np.sort((np.array([lower, upper]) - offset) / row[moved[0]])
                    low[moved[0]], high[moved[0]] = max(low[moved[0]], ends[0]), min(high[moved[0]], ends[1])
    least = np.maximum(low, np.minimum(-np.pi, high - 2 * np.pi))  # within half a turn of zero, where that is allowed
    most = np.minimum(high, np.maximum(np.pi, low + 2 * np.pi))
    poses = np.random.default_rng(0).uniform(least, most, (_POSES, centre.size))
    return np.vstack([centre, poses])


def _linear_room(linear: Sequence[LinearConstraint], poses: Array) -> Array:
    """Least margin to a position limit, relative to half its range, for each pose."""
    room = np.ones(len(poses))
    for limit in linear:
        if limit.derivative == 0:
            values = poses @ limit.matrix.T + limit.offset
            half = 0.5 * (limit.upper - limit.lower)
            room = np.minimum(room, (np.minimum(limit.upper - values, values - limit.lower) / half).min(axis=1))
    return room
