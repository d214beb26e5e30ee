"""Checks of a task before any optimisation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from constraints.linear import LinearConstraint, spanned
from excite.design.blueprint import Blueprint
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem
from excite.information.identifiability import Identifiability, identifying_motion
from excite.information.named_parameter import named_parameter
from excite.information.target import IdentificationTarget
from excite.registry import name_of, part
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion


def check_solver(task: Task, what: str) -> None:
    """Raise `InputError` where a task's solver does not take limits that are not linear in x.

    Parameters
    ----------
    task : Task
    what : str
        What makes the limits nonlinear in x, for the message.
    """
    if not part("solver", task.search.solver).takes_nonlinear_limits:
        raise InputError(f"{what} are for the solver sqp, not for {name_of(task.search.solver)}")


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
    bounded = spanned(limits, len(motion.labels), (1, 2, 3))
    if not all(bounded):
        free = [name for name, ok in zip(motion.labels, bounded, strict=True) if not ok]
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
    for index in required:
        if index in shown:
            continue
        cure = identifying_motion(whole, index)
        where = f"move {', '.join(cure)}, which identifies it" if cure else "no motion identifies it on its own"
        raise InputError(
            f"{whole.names[index]} is not identifiable from motions of {', '.join(target.motion.labels)}; {where}"
        )


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


def _rank_with(blueprint: Blueprint, by: int, base: Base) -> int:
    task = blueprint.task.changed(trajectory=blueprint.task.trajectory.finer(by))
    return _identifiable(replace(blueprint, task=task).problem(), base)[0]


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
