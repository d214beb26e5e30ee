"""Checks of a task before an optimisation, notes for the user, and what to suspect where no motion is found."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from constraints.certificate import LimitUse
from constraints.diagnosis import ContradictionError
from constraints.linear import LinearConstraint
from excite.design.blueprint import Blueprint
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem
from excite.design.stated_limits import unbounded
from excite.errors import NoFeasibleMotionError
from excite.information.goal import SEED, STATES, named_parameter
from excite.information.nearly_unidentifiable import left_out_by_rounding, rounded_angles
from excite.information.target import (
    Identifiability,
    IdentificationTarget,
    identifying_motion,
    left_out_notes,
    turning_drives,
)
from excite.registry import CRITERIA, instance, name_of
from excite.tasks.criteria import Criterion, TorqueCriterion
from excite.tasks.task import Task
from regressors.errors import InputError, listed_names
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion
from regressors.robot.columns import COULOMB
from regressors.robot.friction.load_and_temperature import Warm, moving_drive_numbers, warm_part
from regressors.robot.robot import Robot
from regressors.robot.symbolic.loops import loops_of
from regressors.samples import Array

_DIRECTIONS, _STEP = 5, 1e-3  # along which gradients are compared with finite differences


def check_loops(robot: Robot, task: Task) -> None:
    """Raise `InputError` where a robot with closed loops cannot be moved, or what is asked for does not know loops."""
    if robot.base_joints:
        robot.check_open("a design")
    if not robot.closures:
        return
    loops = loops_of(robot)
    if loose := [name for name in loops.names if name in robot.passive]:
        raise InputError(
            f"robot {robot.name!r}: no drive moves {listed_names(loose)}, nor do the loops; take a joint with a drive "
            "from `passive:` in its description"
        )
    if task.model.channel != "effort":
        robot.check_open(f"a design for the {name_of(task.model.model)} model")
    if task.output.home is not None:
        robot.check_open("an approach from `home` on straight lines of all joints")


def check_model(target: IdentificationTarget, task: Task) -> None:
    """Raise `InputError` for windows, initial guesses or equations that the model or the motion cannot have."""
    window, motion = target.model.window, target.motion
    if window is not None and window.kind == "short" and window.length >= task.trajectory.period:
        raise InputError(f"a window of {window.length:g} s is longer than the motion of {task.trajectory.period:g} s")
    if len(task.search.start) not in (1, len(motion.labels)):
        raise InputError(f"start: expected one initial guess, or {len(motion.labels)} for {', '.join(motion.labels)}")
    if task.model.equations is not None and not task.model.kind.equations_can_be_chosen:
        raise InputError("equations: the energy model has a single equation, the work; leave `equations` out")
    if target.base.rank == 0:
        name = name_of(task.model.model)
        raise InputError(f"no parameter of the {name} model is identifiable from motions of {', '.join(motion.labels)}")


def check_bounded(motion: PartialMotion, limits: tuple[LinearConstraint, ...]) -> None:
    """Raise `InputError` where neither velocity nor acceleration of a coordinate is bounded."""
    if free := unbounded(motion, limits, 1, 2, 3):
        raise InputError(
            f"no velocity or acceleration limit bounds joint {', '.join(free)}; "
            "give `velocity` and `acceleration`, or limits in the robot's file"
        )


def check_required(target: IdentificationTarget, whole: RegressorModel, task: Task) -> None:
    """Raise `InputError` where a required parameter is not identifiable, naming a motion that identifies it."""
    if not task.objective.require:
        return
    required = [named_parameter(whole, name) for name in task.objective.require]
    identifiability = Identifiability(whole)
    shown = identifiability.shown([identifiability.rows(target.motion, task.model.equations)])
    if hidden := [index for index in required if index not in shown]:
        cure = identifying_motion(whole, hidden[0])
        where = f"move {', '.join(cure)}, which identifies it" if cure else "no motion identifies it on its own"
        labels = ", ".join(target.motion.labels)
        raise InputError(f"{whole.names[hidden[0]]} is not identifiable from motions of {labels}; {where}")


def check_excitable(blueprint: Blueprint, problem: Problem, base: Base) -> None:
    """Raise `InputError` unless random motions of the family identify every base parameter."""
    rank, missing = _identifiable(problem, base)
    if rank == base.rank:
        return
    trajectory = blueprint.task.trajectory
    option, given = trajectory.richness
    needed = next((given + by for by in range(1, 21 - given) if _rank_with(blueprint, by, base) == base.rank), None)
    cure = f"{needed} {option} are enough" if needed else f"more {option} do not help"
    raise InputError(
        f"{option}: {trajectory.name} motions of {given} {option} identify {rank} of {base.rank} parameters, "
        f"but not {', '.join(missing)}; {cure}"
    )


def check_gradient(task: Task, problem: Problem) -> None:
    """Raise `InputError` where the gradient of a user's own criterion is not that of its value.

    Along ``D = L S L'`` with ``M = L L'`` and random symmetric S of norm 1, ``tr(G D)`` must equal the central
    difference of the smooth approximation over ``M - h D`` and ``M + h D``, which are information matrices too.
    """
    if (name := name_of(task.objective.criterion)) in CRITERIA:
        return
    rng, criterion = np.random.default_rng(0), problem.criterion
    M = problem.information.evaluate(random_motion(problem, rng)).M
    L: Array = np.asarray(np.linalg.cholesky(M))
    for sharpness in criterion.stages:
        value, G = criterion.smooth(M, sharpness)
        if np.shape(G) != M.shape or np.ndim(value) != 0:
            raise InputError(
                f"criterion {name}: `smooth` must return a number and a gradient of shape {M.shape}, "
                f"given shapes {np.shape(value)} and {np.shape(G)}"
            )
        stated, measured = np.transpose([_slopes(criterion, M, L, G, sharpness, rng) for _ in range(_DIRECTIONS)])
        wrong = np.abs(stated - measured) > 0.05 * np.maximum(np.abs(stated), np.abs(measured)) + _STEP * abs(value)
        if 2 * np.count_nonzero(wrong) > _DIRECTIONS:
            k = int(np.argmax(np.abs(stated - measured)))
            raise InputError(
                f"criterion {name}: the gradient that `smooth` returns is not that of its value: along one direction "
                f"it is {stated[k]:.3g}, but finite differences give {measured[k]:.3g}; check its sign and its factors"
            )


def _slopes(
    criterion: Criterion, M: Array, L: Array, G: Array, sharpness: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Slope of a criterion along a random direction, by its gradient and by finite differences."""
    S = rng.normal(size=M.shape)
    S = (S + S.T) / np.linalg.norm(S + S.T, 2)
    D = L @ S @ L.T
    low, high = (criterion.smooth(M + h * D, sharpness)[0] for h in (-_STEP, _STEP))
    return float(np.sum(G * D)), float(high - low) / (2 * _STEP)


def _rank_with(blueprint: Blueprint, by: int, base: Base) -> int:
    task = blueprint.task.changed(trajectory=blueprint.task.trajectory.finer(by))
    return _identifiable(replace(blueprint, task=task).problem((), ()), base)[0]


def _identifiable(problem: Problem, base: Base) -> tuple[int, list[str]]:
    """Number of base parameters that random motions identify, and the names of the others."""
    rng = np.random.default_rng(0)
    best, missing = 0, list(base.names)
    for _ in range(3):
        M = problem.information.evaluate(random_motion(problem, rng)).M
        scale = np.sqrt(np.where(np.diag(M) > 0, np.diag(M), 1.0))
        eigenvalues, V = np.linalg.eigh(M / np.outer(scale, scale))
        hidden = eigenvalues < 1e-13 * eigenvalues[-1]
        if base.rank - int(hidden.sum()) > best:
            best = base.rank - int(hidden.sum())
            share = np.sum(V[:, hidden] ** 2, axis=1)
            missing = [name for name, weight in zip(base.names, share, strict=True) if weight > 1e-6]
    return best, missing


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
    free = unbounded(motion, limits, 2)
    what = f"accelerations of {listed_names(free, 3)} are not limited: none is stated; give one with `acceleration`"
    return (what,) if free else ()


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


_NEARLY_USED = 0.9  # a limit that is used less does not hinder a motion


@contextmanager
def suspecting(robot: Robot) -> Iterator[None]:
    """Put the most suspicious thing of a description before the message that no motion keeps the limits."""
    try:
        yield
    except (ContradictionError, NoFeasibleMotionError) as error:
        if doubts := _doubts(robot, str(error)):
            more = f" (and {len(doubts) - 1} more, see the notes)" if len(doubts) > 1 else ""
            raise type(error)(f"look at the description first: {doubts[0]}{more}; {error}") from error
        raise


def _doubts(robot: Robot, message: str) -> list[str]:
    """Suspicious findings, those on joints and links that the message names first; then angles as if rounded."""
    named = _words(message) - {"joint", "joints", "link", "links"}
    notes = [note for note in robot.notes if note.kind == "suspicious"]
    notes.sort(key=lambda note: named.isdisjoint(_words(note.where)))
    angles = [f"{angle}, as if an angle had been rounded; state angles exactly" for angle in rounded_angles(robot)]
    return [*map(str, notes), *angles]


def _words(text: str) -> set[str]:
    """Words without the punctuation around them."""
    return {word.strip(".,:;()'\"") for word in text.split()}


def unidentifiable(uses: tuple[LimitUse, ...]) -> str:
    """Message that motions within the limits do not show every parameter, and what would help.

    A limit is not to be widened unless the motion comes near to it.
    """
    said = "no start found a motion within the limits from which every parameter is identifiable"
    use = max(uses, key=lambda use: use.use, default=None)
    cures = "give more `harmonics` or a longer `period`, or leave parameters out with `nearly_unidentifiable='drop'`"
    if use is None or use.use <= _NEARLY_USED:
        closest = "" if use is None else f": the one used most, {use.label}, is used at {100 * use.use:.0f} %"
        return f"{said}, and limits are not the cause{closest}; {cures}"
    return (
        f"{said}; the limit used most is that of {use.label}, {100 * use.use:.0f} % of {use.bound:.4g} {use.unit}: "
        f"widen it if the robot allows more, or {cures}"
    )
