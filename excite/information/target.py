"""Identification target of a task: the moving robot, its model, and the parameters that are identifiable.

Base parameters without those that motions show in theory only.

Which these are, is found on independent states, as many as the motion has samples: from the right, one after the other,
those whose predicted deviation is more than `FACTOR` times their size. What is left of the regressor has a rank of its
own, with the second gap of the singular values behind it, and base columns are chosen of it as of any other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from excite.information.prior import base_sizes, sizes_of
from excite.registry import CONVENTIONS, name_of
from excite.tasks.model_choice import FURTHER_FRICTION, ModelChoice
from excite.tasks.model_options import DriveChoice, numbers_of
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import (
    CHOICES,
    MOST_STATES,
    Base,
    base_of,
    base_parameters,
    bases,
    enough_states,
    few_states,
    random_states,
    triangular_factor,
)
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion, drive_names, of_drives, of_joints, of_loops
from regressors.numerical import DESCRIPTION_CAUSE, ROUNDING, column_lengths, numerical_work, one_thread
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_with_friction, friction_rows, moving_drive_numbers
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def friction_of_moving(friction: FrictionCurves, robot: Robot, moving: Robot) -> FrictionCurves:
    """Friction curves without those of locked joints; of drives that turn along, with those that they follow."""
    friction.check(robot)
    return friction.of(moving.joint_names) if moving.transmission is None else friction.along(moving)


def motion_of(robot: Robot, moving: Robot, task: Task) -> PartialMotion:
    """Partial motion of the moving robot that a task asks for."""
    if moving.closures:
        if task.model.drives is not None:
            raise InputError(
                f"robot {robot.name!r}: `drives` cannot be chosen, since closed loops make joints follow others; leave "
                "it out"
            )
        return of_loops(moving)
    if task.model.drives is not None:
        return of_drives(moving, task.model.drives)
    wanted = task.model.joints
    names = moving.joint_names if wanted is None else [robot.joint_names[robot.joint_index(name)] for name in wanted]
    return of_joints(moving, [moving.joint_names.index(name) for name in names])


def model_of(robot: Robot, task: Task, sign_width: float = 0.0) -> RegressorModel:
    """Model that a task asks for."""
    return task.model.built(robot).softened(sign_width)


@dataclass(frozen=True, eq=False)
class IdentificationTarget:
    """The model to identify, with its base columns.

    Parameters
    ----------
    robot : Robot
        The moving robot.
    motion : PartialMotion
    model : RegressorModel
        Model with exact friction, unless a sign width is given.
    base : Base
        Left-to-right base.
    transforms : dict of str to ndarray, shape (b, b)
        Matrix T per convention, from the base's columns to those of the convention, ``W_c = W_b T``; for
        ``orthonormal`` a factor with the singular values of the full regressor.
    """

    robot: Robot
    motion: PartialMotion
    model: RegressorModel
    base: Base
    transforms: dict[str, Array]


@numerical_work("the search for base parameters", DESCRIPTION_CAUSE)
def left_to_right_base(robot: Robot, task: Task) -> tuple[PartialMotion, Base]:
    """Moving coordinates and left-to-right base of a task, without the other conventions."""
    moving, motion, whole = _moving(robot, task, 0.0)
    model = _shows(_restricted(whole, motion, task), motion, task)
    states = motion.states(random_states(moving, few_states(model)))
    with one_thread():
        return motion, base_parameters(model, states=states, rounding=_rounding(task))


def _rounding(task: Task) -> float:
    """Part of a column that counts as born of rounding; what deviations decide upon is not decided here."""
    return ROUNDING if task.objective.nearly_unidentifiable == "drop-rounding" else 0.0


def _moving(robot: Robot, task: Task, sign_width: float) -> tuple[Robot, PartialMotion, RegressorModel]:
    moving = moving_robot(robot, task)
    return moving, motion_of(task.limits.applied(robot), moving, task), model_of(moving, task, sign_width)


def _restricted(model: RegressorModel, motion: PartialMotion, task: Task) -> RegressorModel:
    """The model of the moving coordinates, which must have columns."""
    model = model.restricted(motion, task.model.equations)
    if not model.columns:
        name = name_of(task.model.model)
        raise InputError(f"no parameter of the {name} model is identifiable from motions of {', '.join(motion.labels)}")
    return model


def _shows(model: RegressorModel, motion: PartialMotion, task: Task) -> RegressorModel:
    """The model whose rows say which parameters are shown: along closed loops always that of the drives' torques.

    There the energy has the same base parameters, but parameters that are hardly seen would be told apart otherwise.
    """
    return model if motion.straight or model.window is None else _restricted(model.instantaneous(), motion, task)


_recent: deque[tuple[Robot, Task, float, bool, IdentificationTarget]] = deque(maxlen=4)  # compiled already


def target_of(
    robot: Robot, task: Task, sign_width: float = 0.0, *, instantaneous: bool = False
) -> IdentificationTarget:
    """Moving robot, model and base columns of a task; one of the last is not made again."""
    moving, motion, whole = _moving(robot, task, sign_width)
    instantaneous = instantaneous or whole.window is None
    asked = robot, task, sign_width, instantaneous
    if (known := next((target for *one, target in _recent if tuple(one) == asked), None)) is not None:
        return known
    model = _restricted(whole.instantaneous() if instantaneous else whole, motion, task)
    states = motion.states(random_states(moving, enough_states(model)))
    with one_thread():
        chosen = bases(_shows(model, motion, task), states, _rounding(task))
        if task.objective.nearly_unidentifiable == "drop" and chosen[0].rank > 0:
            torques = whole.instantaneous().restricted(motion, task.model.equations)
            chosen = visible_bases(model, torques, chosen, states, task)
        base, pivoted = chosen
        transforms = {
            "gautier": np.eye(base.rank),
            "pivoted": base.D[:, pivoted.index],
            "orthonormal": base.full_rank_factor,
        }
    target = IdentificationTarget(
        moving, motion, model, base, {name: transforms[name] for name in CONVENTIONS if base.rank}
    )
    _recent.append((*asked, target))
    return target


_NOTHING = 1e-12  # of a drive's velocity along the motion, or of its torque in an equation


def turning_drives(target: IdentificationTarget) -> tuple[str, ...]:
    """Names of the drives that turn in a target's motions."""
    drives = drives_with_friction(target.robot)
    return tuple(name for name, row in drives if np.any(np.abs(row @ target.motion.matrix) > _NOTHING))


def usual_speeds(robot: Robot, motions: Sequence[Samples]) -> Array:
    """Root mean square of the speed of each drive with friction, shape (k,) [rad/s or m/s]."""
    speeds = np.concatenate([samples.dq for samples in motions]) @ friction_rows(robot).T
    return np.asarray(np.sqrt(np.mean(speeds**2, axis=0)))


def typical_speed(robot: Robot, motions: Sequence[Samples]) -> float:
    """Median of `usual_speeds` over the drives that move; 0 where none does [rad/s or m/s]."""
    usual = usual_speeds(robot, motions)
    return float(np.median(usual[usual > 0])) if np.any(usual > 0) else 0.0


def least_speeds(target: IdentificationTarget, samples: Samples, unit: Array | float = 1.0) -> Array:
    """Least speed of the drives whose torque each equation contains, shape (N, r); infinite where there is none.

    In units of a speed for each drive, shape (k,); drives whose unit is zero do not count.
    """
    equations = target.model.torque_equations()
    assert equations is not None
    rows = friction_rows(target.robot)
    speed = np.abs(samples.dq @ rows.T)
    speed = np.divide(speed, unit, out=np.full(speed.shape, np.inf), where=np.greater(unit, 0.0))
    acts = np.abs(rows @ equations.directions) > _NOTHING
    return np.column_stack([np.min(speed, axis=1, where=drives, initial=np.inf) for drives in acts.T])


def left_out_notes(asked: ModelChoice, target: IdentificationTarget, curves: FrictionCurves) -> tuple[str, ...]:
    """Note on further friction parameters that were asked for, but only of turning drives whose friction is known."""
    numbers = moving_drive_numbers(target.robot)
    turning = {numbers[name] for name in turning_drives(target)}

    def some(chosen: DriveChoice, known: FrictionCurves | None) -> bool:
        left = numbers_of(chosen, target.robot, known)
        return left if isinstance(left, bool) else bool(turning.intersection(left))

    choices = {name.replace("_", " "): getattr(asked, name) for name in FURTHER_FRICTION}
    names = [name for name, chosen in choices.items() if some(chosen, None) and not some(chosen, curves)]
    return (f"{', '.join(names)} columns are left out: friction is known",) if names else ()


_TOLERANCE = 1e-7


class Identifiability:
    """Row spaces of a model under partial motions."""

    def __init__(self, model: RegressorModel) -> None:
        self.model = model
        self._states = random_states(model.robot, MOST_STATES)
        self._scale = column_lengths(triangular_factor(model.instants(self._states)))

    def rows(self, motion: PartialMotion, equations: tuple[str, ...] | None = None) -> Array:
        """Basis of the row space of a partial motion, columns scaled by their norm for motions of all joints."""
        W = self.model.restricted(motion, equations).instants(motion.states(self._states))
        return _independent(triangular_factor(W) / self._scale)

    def rank(self, factors: Iterable[Array]) -> int:
        """Number of parameter combinations that the motions identify together."""
        return len(_independent(np.vstack(list(factors))))

    def shown(self, factors: Iterable[Array]) -> list[int]:
        """Indices of the parameters that the motions together identify individually."""
        V = _independent(np.vstack(list(factors)))
        rest = np.eye(V.shape[1]) - V.T @ V
        return [k for k in range(V.shape[1]) if np.linalg.norm(rest[k]) < _TOLERANCE * 100]


def _independent(rows: Array) -> Array:
    """Orthonormal basis of a row space, shape (rank, p)."""
    if rows.shape[0] == 0:
        return rows
    _, sigma, V = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(V[sigma > _TOLERANCE * sigma[0]]) if sigma[0] > 0 else V[:0]


def partial_motions(model: RegressorModel, at_once: int) -> list[tuple[tuple[str, ...], PartialMotion]]:
    """Motions of every selection of at most ``at_once`` drives, fewest first."""
    names = drive_names(model.robot)
    sizes = range(1, min(at_once, len(names)) + 1)
    return [(moving, of_drives(model.robot, moving)) for size in sizes for moving in combinations(names, size)]


def identifying_motion(model: RegressorModel, parameter: int) -> tuple[str, ...] | None:
    """Fewest drives whose motion identifies a parameter individually; None if no motion does."""
    identifiability = Identifiability(model)
    motions = partial_motions(model, len(drive_names(model.robot)))
    shown = ((moving, identifiability.shown([identifiability.rows(motion)])) for moving, motion in motions)
    return next((moving for moving, parameters in shown if parameter in parameters), None)


FACTOR = 100.0
_ALONE = 0.3  # part of a column that the others must explain, or it counts as nothing
_NEGLIGIBLE = 1e-6  # of a coefficient of what is explained


def inverse_half(W: Array) -> Array:
    """H with ``(W'W)^-1 = H H'``, shape (b, b), of columns of any size."""  # W (k, b)
    length = column_lengths(W)
    return np.asarray(np.linalg.pinv(np.linalg.qr(W / length, mode="r"), rcond=1e-15) / length[:, None])


def visible_bases(
    model: RegressorModel, torques: RegressorModel, bases: tuple[Base, ...], states: Samples, task: Task
) -> tuple[Base, ...]:
    """Base columns of both choices, without parameters that are nearly unidentifiable."""
    base = bases[0]
    given = (1.0,) if model.window is not None or task.objective.noise is None else task.objective.noise
    rows = len(torques.row_labels)
    noise = np.broadcast_to(np.asarray(given if len(given) in (1, rows) else (1.0,), dtype=float), (rows,))
    W = torques.instants(states)[:, [torques.names.index(name) for name in base.names]]
    W = W / np.tile(noise, states.time.size)[:, None]
    count = task.trajectory.period * task.output.rate
    kept = _kept(W * np.sqrt(count / states.time.size), base_sizes(model, base))
    if len(kept) == base.rank:
        return bases
    R = triangular_factor(model.instants(states))
    visible = R[:, base.index] @ _explained(R[:, base.index], kept) @ base.D
    chosen = (base_of(model, visible, choice) for choice in CHOICES)
    values = _singular_values(R, sizes_of(model, np.eye(len(model.columns))))
    return tuple(replace(part, singular_values=values) for part in chosen)


def _singular_values(R: Array, size: Array) -> Array:
    """Of columns in units of their sizes; one without a size is as long as the longest one with."""
    length = np.linalg.norm(R, axis=0)
    known = np.isfinite(size)
    longest = float((length[known] * size[known]).max(initial=0.0)) or 1.0
    unit = np.where(known, size, longest / np.where(length > 0, length, np.inf))
    return np.asarray(np.linalg.svd(R * unit, compute_uv=False), dtype=float)


def _kept(W: Array, size: Array) -> list[int]:
    """Columns that are left when those seen too badly are taken away from the right."""
    kept = list(range(W.shape[1]))
    while kept:
        deviation = np.linalg.norm(inverse_half(W[:, kept]), axis=1)
        hidden = np.flatnonzero(deviation > FACTOR * size[kept])
        if hidden.size == 0:
            break
        del kept[hidden[-1]]
    return kept


def _explained(R: Array, kept: list[int]) -> Array:
    """Every column by those kept, shape (b, b): itself, a combination of them, or nothing."""
    A = np.zeros((R.shape[1],) * 2)
    A[kept, kept] = 1.0
    for j in sorted(set(range(R.shape[1])) - set(kept)):
        part = np.linalg.lstsq(R[:, kept], R[:, j], rcond=None)[0]
        size = np.linalg.norm(R[:, j])
        if np.linalg.norm(R[:, j] - R[:, kept] @ part) > _ALONE * size:
            continue
        part[np.abs(part) * np.linalg.norm(R[:, kept], axis=0) < _NEGLIGIBLE * size] = 0.0
        nearest = np.round(part)
        A[kept, j] = np.where(np.abs(part - nearest) < _NEGLIGIBLE, nearest, part)
    return A
