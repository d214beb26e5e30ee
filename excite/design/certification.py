"""Certification of the best of several starts: all metrics, and limits over continuous time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from constraints.certificate import LimitUse
from constraints.enclosure import uses_of
from excite.design.approach import approach_and_return
from excite.design.design import Design
from excite.design.formulation import Formulation
from excite.design.start_results import BestStarts, StartResult
from excite.design.stated_limits import remedy
from excite.design.task_checks import unidentifiable
from excite.errors import NoFeasibleMotionError
from excite.information.matrix import MotionMeasures, noise_per_row, noise_text
from excite.information.nearly_unidentifiable import (
    hardly_excited_note,
    nearly_unidentifiable,
    nearly_unidentifiable_note,
)
from excite.information.weighting import known_with
from excite.trajectories import Trajectory
from regressors.robot.robot import Robot
from regressors.samples import Array

_INSTANTS = 257  # at which the middle of each joint's range is looked for
_SAME = 1e-9  # of the largest number in the equations


def certify(
    robot: Robot,
    formulation: Formulation,
    results: BestStarts | tuple[StartResult, ...],
    provenance: dict[str, object],
    *,
    interrupted: bool = False,
) -> Design:
    """Evaluate the best start: its metrics, and its limits over continuous time."""
    starts = results if isinstance(results, BestStarts) else BestStarts.of(results)
    broken: list[LimitUse] = []
    for result in sorted(starts.best, key=lambda r: (r.value, r.index)):
        trajectory = formulation.problem.information.trajectory(result.coefficients)
        uses = limits_of(formulation, trajectory)
        if all(use.holds for use in uses):
            break
        broken.append(max(uses, key=lambda use: use.use))
    else:
        raise NoFeasibleMotionError(_closest(broken, formulation))
    trajectory, uses = _unwound(robot, formulation, result.coefficients, uses)
    if not np.isfinite(result.value):
        raise NoFeasibleMotionError(unidentifiable(uses))
    samples = trajectory.samples(
        formulation.target.model.times(formulation.task.trajectory.period, formulation.task.output.rate)
    )
    noise = noise_per_row(formulation.task.objective.noise, formulation.target.model)
    ends = trajectory.samples(np.array([0.0, trajectory.duration])).q
    transfers = approach_and_return(
        robot, formulation.task, formulation.target.robot.joint_names, ends, formulation.transfer_limits
    )
    hardly = nearly_unidentifiable(formulation.target, samples, noise)
    notes = (*formulation.notes, *(transfers.notes if transfers is not None else ()))
    if note := hardly_excited_note(formulation.target, samples, formulation.task.objective.noise):
        notes = (note, *notes)
    if hardly:
        what_noise = noise_text(formulation.task.objective.noise, formulation.target.model)
        dropped = formulation.task.objective.nearly_unidentifiable == "drop"
        notes = (nearly_unidentifiable_note(hardly, formulation.target, what_noise, dropped=dropped), *notes)
    if note := starts.note(interrupted=interrupted):
        notes = (*notes, note)
    gap = formulation.target.base.gap
    return Design(
        robot=robot,
        task=formulation.task,
        trajectory=trajectory,
        certified=uses,
        measured=MotionMeasures.of(formulation.target, samples, noise),
        minimised_value=result.value,
        noise=tuple(noise.tolist()),
        equations=tuple(formulation.target.model.row_labels),
        gap=gap if np.isfinite(gap) else None,
        prior=known_with(formulation.target, formulation.task, samples),
        results=starts.best,
        further_starts=starts.further,
        best_start=result.index,
        provenance=provenance,
        notes=notes,
        interrupted=interrupted,
        approach_and_return=transfers,
        formulated=(formulation.target, (*formulation.nonlinear, *formulation.stated)),
        unchecked=formulation.unchecked,
        nearly_unidentifiable=hardly,
        shape=formulation.blueprint.world.world,
    )


def _unwound(
    robot: Robot, formulation: Formulation, x: Array, uses: tuple[LimitUse, ...]
) -> tuple[Trajectory, tuple[LimitUse, ...]]:
    """The motion without whole turns for nothing, nearer to home or to zero, with its certificate.

    A revolute joint that is a coordinate of its own turns by the whole turns that bring the middle of its range nearest
    to there, within its limits. What is not the same after whole turns, such as a ball screw's ratio or a drive's
    position, shows in the equations or in the certificate: then the motion stays as it was found.
    """
    target, problem = formulation.target, formulation.problem
    trajectory, N = problem.information.trajectory(x), target.motion.matrix
    joint = np.argmax(np.abs(N), axis=0)  # of each coordinate
    alone = (np.count_nonzero(N, axis=0) == 1) & (np.count_nonzero(N[joint], axis=1) == 1) & (N.max(axis=0) == 1.0)
    turning = alone & np.array([target.robot.joints[k].kind == "revolute" for k in joint])
    q = trajectory.samples(np.linspace(0.0, trajectory.duration, _INSTANTS)).q[:, joint]
    low, high = q.min(axis=0), q.max(axis=0)
    stated = formulation.task.output.home
    home = robot.home if isinstance(stated, str) else stated
    known = dict.fromkeys(robot.joint_names, 0.0) if home is None else dict(zip(robot.joint_names, home, strict=True))
    near = np.array([known[target.robot.joint_names[k]] for k in joint])
    turns = 2 * np.pi * np.round(((low + high) / 2 - near) / (2 * np.pi))
    limits = target.robot.limits
    within = (low - turns >= limits.lower[joint]) & (high - turns <= limits.upper[joint])
    turns = np.where(turning & within, turns, 0.0)
    if not np.any(turns):
        return trajectory, uses
    moved = problem.information.trajectory(problem.family.moved(x, -turns))
    time = target.model.times(formulation.task.trajectory.period, formulation.task.output.rate)
    samples = trajectory.samples(time)  # of the same velocities, whose signs rounding might change
    before, after = (target.model.assemble(each) for each in (samples, replace(samples, q=samples.q - N @ turns)))
    if not np.allclose(before, after, rtol=0.0, atol=_SAME * float(np.abs(before).max())):
        return trajectory, uses
    certificate = limits_of(formulation, moved)
    return (moved, certificate) if all(use.holds for use in certificate) else (trajectory, uses)


def _closest(broken: list[LimitUse], formulation: Formulation) -> str:
    """Message on the motion that is closest to feasible: which limit it violates, when, by how much; the remedy."""
    use = min(broken, key=lambda use: use.use)
    beyond = f"{-use.margin:.2g} {use.unit} beyond {use.bound:.4g} {use.unit}"
    return (
        "no start ended with a motion that keeps every limit over continuous time; "
        f"the closest motion exceeds {use.label} at {use.time:.3f} s: {use.extreme:.4g} {use.unit}, {beyond}"
        f"{remedy(use.label, formulation.stated, formulation.task)}"
    )


def limits_of(formulation: Formulation, trajectory: Trajectory) -> tuple[LimitUse, ...]:
    """Certificate of every limit for a motion: exact extrema of linear ones, enclosures of the others."""
    return uses_of(trajectory, formulation.limits, (*formulation.nonlinear, *formulation.stated))
