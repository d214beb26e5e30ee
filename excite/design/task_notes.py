"""Notes on a task for the user to read before the robot moves."""

from __future__ import annotations

from constraints.linear import LinearConstraint, spanned
from excite.information.friction_notes import left_out_notes, turning_drives
from excite.information.rounded_angles import left_out_by_rounding
from excite.information.target import IdentificationTarget
from excite.information.task_torques import SEED, STATES
from excite.information.torque_deviation import TorqueCriterion
from excite.registry import instance
from excite.tasks.task import Task
from regressors.friction.curves import Warm
from regressors.friction.friction_drives import moving_drive_numbers
from regressors.friction.temperature import warm_part
from regressors.models.columns import COULOMB
from regressors.models.partial import PartialMotion


def task_notes(target: IdentificationTarget, task: Task, limits: tuple[LinearConstraint, ...]) -> tuple[str, ...]:
    """Notes on the robot's description, limits, prior knowledge and friction."""
    return (
        *left_out_by_rounding(target.robot, target.base),
        *target.robot.reading_notes,
        *_limit_notes(target.motion, limits),
        *_prior_notes(task),
        *_torque_notes(task),
        *_friction_notes(target, task),
    )


def _limit_notes(motion: PartialMotion, limits: tuple[LinearConstraint, ...]) -> tuple[str, ...]:
    bounded = spanned(limits, len(motion.labels), (2,))
    free = [name for name, ok in zip(motion.labels, bounded, strict=True) if not ok]
    if not free:
        return ()
    return (f"no acceleration limit is known for {', '.join(free)}; give one with `acceleration`",)


def _prior_notes(task: Task) -> tuple[str, ...]:
    if task.objective.prior is None or task.objective.noise is not None:
        return ()
    return ("prior knowledge is weighed against the noise of the measurements, assumed to be 1; give it with `noise`",)


def _torque_notes(task: Task) -> tuple[str, ...]:
    """Whose torques a criterion of them is for, where nothing is stated."""
    criterion = instance("criterion", task.objective.criterion)
    if not isinstance(criterion, TorqueCriterion) or criterion.rows is not None or task.objective.task_motion:
        return ()
    return (
        f"torques are predicted for {STATES} states, uniform within the limits (seed {SEED}); `task_motion` states the "
        "motion that they are wanted for",
    )


def _friction_notes(target: IdentificationTarget, task: Task) -> tuple[str, ...]:
    """Notes on moving drives without a curve, on parameters of those with one, and on temperatures."""
    curves = task.known_friction
    if curves is None:
        return ()
    turning = turning_drives(target)
    imposed = (*task.limits.imposed(curves), task.limits.stated_torque(curves))
    limited = any(limit is not None and limit.friction is curves for limit in imposed)
    warm = {name: curve for name in turning if (curve := warm_part(curves.curve(name))) is not None} if limited else {}
    notes = tuple(f"torque limits use friction of {name} {_temperatures(curve)}" for name, curve in warm.items())
    without = [name for name in turning if curves.curve(name) is None]
    terms, numbers = task.model.terms_of(target.robot), moving_drive_numbers(target.robot)
    identified = [name for name in without if terms.include(COULOMB, numbers[name])]
    frictionless = [name for name in without if name not in identified]
    in_limits = "; torque limits use the friction of the robot's description" if limited else ""
    causes = (
        (identified, "identified with the rest"),
        (frictionless, "assumed to have no friction in identification, as asked"),
    )
    said = (f"no friction curve of {', '.join(names)}: {how}{in_limits}" for names, how in causes if names)
    return (*said, *notes, *left_out_notes(task.model, target, curves))


def _temperatures(curve: Warm) -> str:
    """Temperatures at which a torque limit evaluates friction, as text."""
    if curve.range is None:
        return f"at {curve.reference:.4g} deg C only: its file has no range"
    low, high = (f"{end:.4g}" for end in curve.range)
    return f"at {low} deg C only: its file has no wider range" if low == high else f"from {low} to {high} deg C"
