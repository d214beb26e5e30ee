"""Candidate designs compared by the same metrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from constraints.certificate import LimitUse
from excite.design.design import Design
from excite.information.goal import goal_of
from excite.information.matrix import MotionMeasures, noise_per_row
from excite.information.target import IdentificationTarget, target_of
from excite.information.weighting import minimised_text, weighting_of
from excite.registry import instance, name_of
from excite.tasks.model_choice import FRICTION
from excite.tasks.model_options import without_curve
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.numerical import DESCRIPTION_CAUSE, numerical_work
from regressors.robot.robot import Robot
from regressors.samples import Samples

RATE = 100.0


@dataclass(frozen=True)
class Judgement:
    """One design under the common metrics."""

    name: str  # folder of the design
    robot: str
    model: str
    channel: str  # ``effort`` or ``wrench``, which its equations explain
    moving: tuple[str, ...]  # names of the joints, or of the drives, that move
    duration: float  # [s]
    parameters: int  # number of base parameters
    friction: str  # treatment of friction in the design: "identified", "known" beforehand, or "left out"
    minimised: str  # criterion that it was designed for
    goal: float | None  # value of the criterion that the first design minimised; None if it does not apply
    # see `excite.information.matrix.CONVENTIONS`; at 100 Hz whatever rate the design was written at
    criteria: dict[str, float]
    tightest: LimitUse | None  # the limit with the least margin relative to its range
    feasible: bool  # every limit that was checked holds over continuous time, on approach and return too
    unchecked: tuple[str, ...]  # kinds of limits that were not checked when it was designed
    cpu_seconds: float  # processor time of the design [s]
    # what could not be computed from a stored motion, so that it is as its file states it
    believed: tuple[str, ...] = ()


@checked
@numerical_work("the comparison", DESCRIPTION_CAUSE)
def compare(designs: Sequence[Design], model: str | None = None, window: str | None = None) -> list[Judgement]:
    """Evaluate every design under the terms (friction, rotors, noise) of the first one.

    Where the first one has friction parameters, all are judged with them, including those designed for friction known
    beforehand; otherwise all are judged without.

    Parameters
    ----------
    designs : sequence of Design
    model, window : str, optional
        Judge the motions under this model instead of the one that each was designed for.

    Returns
    -------
    list of Judgement
        In the order given.
    """
    return [_judgement(design, designs[0].task, _other_model(design, model, window)) for design in designs]


def _other_model(design: Design, model: str | None, window: str | None) -> Task:
    """The design's task for another model, with the same moving joints and no known friction."""
    task = design.task.changed(friction_curves=None)
    task = task.changed(window=window) if window is not None else task
    if model is None or model == task.model.model:
        return task
    free = task.model.joints is None and task.model.drives is None
    joints = design.moving.joint_names if free else task.model.joints
    return task.changed(model=model, joints=joints, equations=None, require=())


def _as_seen_by(design: Design, robot: Robot) -> Trajectory:
    """The motion of all joints of a robot; joints that are not part of the design rest."""
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    known = design.moving.joint_names
    place = np.array([[float(name == other) for other in known] for name in robot.joint_names])
    return design.trajectory.carried(place, np.where(place.any(axis=1), 0.0, rest))


def _goal(target: IdentificationTarget, goal: Task, samples: Samples) -> float | None:
    criterion = instance("criterion", goal.objective.criterion)
    try:
        weighting, more = weighting_of(target, goal), goal_of(target, goal)
    except InputError:  # its noise, prior knowledge or parameters belong to another model or other joints
        return None
    return more.of(criterion).value(weighting.matrix(target.model.assemble(samples)[:, target.base.index]))


def _judgement(design: Design, terms: Task, task: Task) -> Judgement:
    kept = ("rotor", "stribeck_speed", "carried", "joint_rotors", "reflected_rotors")
    same = {name: getattr(terms.model, name) for name in kept}
    moving, known = moving_robot(design.robot, task), terms.known_friction
    same |= {name: without_curve(getattr(terms.model, name), moving, known) for name in FRICTION}
    task = task.changed(**same, nearly_unidentifiable=terms.objective.nearly_unidentifiable)
    target = target_of(design.robot, task)
    given = terms.objective.noise
    fits = given is None or len(given) in (1, len(target.model.row_labels))  # otherwise not comparable
    noise = noise_per_row(given if fits else task.objective.noise, target.model)
    own = design.task.model
    friction = "known" if own.friction_curves is not None else "identified" if own.friction else "left out"
    samples = _as_seen_by(design, target.robot).samples(target.model.times(design.trajectory.duration, RATE))
    return Judgement(
        name=design.name,
        robot=design.robot.name,
        model=name_of(task.model.model),
        channel=task.model.channel,
        moving=target.motion.labels,
        duration=design.trajectory.duration,
        parameters=target.base.rank,
        friction=friction,
        minimised=minimised_text(design.task),
        goal=_goal(target, terms, samples),
        criteria=MotionMeasures.of(target, samples, noise).criteria,
        tightest=max(design.limits, key=lambda use: use.use, default=None),
        feasible=design.feasible,
        unchecked=tuple(each.limit for each in design.unchecked),
        cpu_seconds=float(design.provenance["cpu_seconds"]),
        believed=design.believed,
    )
