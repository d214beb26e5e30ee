"""What keeps a precision out of reach: parameters that move together, and what would separate them.

Half-widths fall with the root of the robot time, so time alone always helps, and seldom enough. What separates
parameters is another motion: every change of the problem is made in turn, and the motion is improved in the changed
problem, as in `excite.optimality.sensitivity`; gains are relative to the same improvement without a change, and are
lower estimates: a search from scratch may find more. A load that is known is tried too, as carried in every other run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.problem import Problem
from excite.design.solvers.solver import Solver
from excite.information.half_widths import ParameterPrecision, RunInformation
from excite.information.target import inverse_half, target_of
from excite.optimality.sensitivity import best_of, loosened, same_motion
from excite.registry import instance
from excite.tasks.installation import Installation
from regressors.errors import InputError
from regressors.samples import Array

_WIDER = 1.5  # limits
_LOAD = (2.0, 0.0, 0.0, 0.05)  # mass [kg] and centre [m] in the frame of the last link
_TOGETHER = 0.7  # correlation from which two parameters count as moving together
_PARTNERS = 3
_WORTH = 1.05  # times narrower, from which a change is said to help


@dataclass(frozen=True)
class TooWide:
    """A parameter whose half-width stays too large."""

    name: str
    unit: str
    half_width: float  # after as many runs as the robot time leaves room for
    allowed: float
    # parameters that it moves with, and the correlation of the estimates, the closest first
    together: tuple[tuple[str, float], ...]

    @property
    def text(self) -> str:
        """By how much it is too wide, and what it moves with."""
        partners = ", ".join(f"{name} ({correlation:+.2f})" for name, correlation in self.together)
        moves = f"moves together with {partners}" if partners else "moves with no other parameter"
        return f"{self.name}: {self.half_width / self.allowed:.3g} times the allowed half-width, {moves}"


@dataclass(frozen=True)
class SeparationTrial:
    """One change of the problem, tried."""

    change: str
    narrower: float  # factor by which the widest half-width, relative to the allowed one, becomes narrower
    robot_seconds: float  # robot time in which the target would be met then [s]


@dataclass(frozen=True)
class OutOfReach:
    """What keeps a precision out of reach."""

    parameters: tuple[TooWide, ...]  # the widest first
    robot_seconds: float  # robot time in which more runs of the same motion would meet the target [s]
    trials: tuple[SeparationTrial, ...]  # what was tried, the one that helps most first

    @property
    def best(self) -> SeparationTrial | None:
        """The change that helps most; None if none does."""
        return self.trials[0] if self.trials and self.trials[0].narrower > _WORTH else None


def out_of_reach(design: Design, report: Callable[[str], None] = lambda _: None) -> OutOfReach | None:
    """Say which parameters stay too uncertain, what they move with, and what separates them; None if none does."""
    run, forecast = design.run_information, design.precision
    if run is None or forecast is None or design.task.objective.scale != "precision":
        raise InputError("the design was not made for a precision; `design_for_precision` makes one")
    wide = forecast.too_wide
    if not wide:
        return None
    needed = run.fewest_runs() * run.seconds
    with threadpool_limits(1), np.errstate(all="ignore"):
        narrower = [*_changes(design, report), (_LOAD_NAME, _with_load(design, run))]
    trials = [SeparationTrial(change, factor, needed / factor**2) for change, factor in narrower]
    trials.sort(key=lambda trial: -trial.narrower)
    return OutOfReach(tuple(_too_wide(run, parameter) for parameter in wide), needed, tuple(trials))


_LOAD_NAME = f"a known load of {_LOAD[0]:g} kg in every other run"


def _too_wide(run: RunInformation, parameter: ParameterPrecision) -> TooWide:
    names = run.target.base.names
    assert parameter.allowed is not None
    if parameter.name not in names:  # the torque of a joint
        return TooWide(parameter.name, parameter.unit, parameter.half_width, parameter.allowed, ())
    k = names.index(parameter.name)
    unit = run.half / np.linalg.norm(run.half, axis=1)[:, None]
    correlation = unit @ unit[k]
    order = [int(j) for j in np.argsort(-np.abs(correlation)) if j != k and abs(correlation[j]) >= _TOGETHER]
    together = tuple((names[j], float(correlation[j])) for j in order[:_PARTNERS])
    return TooWide(parameter.name, parameter.unit, parameter.half_width, parameter.allowed, together)


def _changes(design: Design, report: Callable[[str], None]) -> Iterator[tuple[str, float]]:
    """Each change of limits and of the highest frequency, and how many times narrower the widest half-width becomes."""
    formulation = formulate(design.robot, design.task)
    problem, motion = formulation.problem, formulation.blueprint.motion
    solver: Solver = instance("solver", design.task.search.solver)
    inverse = np.asarray(np.linalg.pinv(motion.matrix), dtype=float)
    x = design.trajectory.carried(inverse, -inverse @ motion.offset).x
    report("trying what separates the parameters: the same problem once more")
    x, value = best_of(problem, solver, x, problem.exact_value(x))
    for quantity in ("velocity", "acceleration", "position"):
        changed = _with_wider(problem, quantity)
        if changed is not None:
            report(f"trying what separates the parameters: {quantity} limits {_WIDER:g} times as wide")
            yield f"{quantity} limits {_WIDER:g} times as wide", value / best_of(changed, solver, x, value)[1]
    if (faster := _faster(formulation, problem, x)) is not None:
        report("trying what separates the parameters: twice the highest frequency")
        yield "twice the highest frequency", value / best_of(faster[0], solver, faster[1], value)[1]


def _with_wider(problem: Problem, quantity: str) -> Problem | None:
    """The problem with wider ranges of one quantity of all joints and drives; None if it is not limited."""
    linear = problem.limits.linear
    labels = [
        label
        for limit in linear
        if getattr(limit.function.constraint, "quantity", "") == quantity
        for label in limit.function.constraint.labels
    ]
    if not labels:
        return None
    for label in labels:
        linear = tuple(loosened(limit, label, _WIDER) for limit in linear)
    return replace(problem, limits=replace(problem.limits, linear=linear))


def _faster(formulation: Formulation, problem: Problem, x: Array) -> tuple[Problem, Array] | None:
    """The problem with twice the harmonics, and the same motion in it; None where the family has it not."""
    task = formulation.task
    option, count = task.trajectory.richness
    try:
        changed = task.changed(**{option: 2 * count})
        richer = replace(formulation.blueprint, task=changed).problem(formulation.nonlinear, formulation.stated)
    except InputError:
        return None
    start = same_motion(problem, x, richer)
    return None if start is None else (richer, start)


def _with_load(design: Design, run: RunInformation) -> float:
    """How many times narrower the widest half-width becomes where every other run carries a load that is known.

    The torque of a known load is subtracted, so that the parameters keep their columns; only friction that depends on
    what a drive carries sees it.
    """
    robot = Installation(payload=_LOAD).applied(design.robot)
    target = target_of(robot, design.task)
    columns = [name for name in run.target.base.names if name in target.model.names]
    if len(columns) < len(run.target.base.names):
        return 1.0
    task = design.task
    samples = design.trajectory.samples(target.model.times(task.trajectory.period, task.output.rate))
    noise = formulate(design.robot, task).blueprint.noise
    W = target.model.assemble(samples)[:, [target.model.names.index(name) for name in columns]]
    W = W / np.tile(noise, W.shape[0] // noise.size)[:, None]
    own = np.linalg.inv(run.half @ run.half.T)
    M = 0.5 * (W.T @ W + own)
    length = np.sqrt(np.diag(M))
    half = inverse_half(np.linalg.cholesky(M / np.outer(length, length)).T * length)
    return float(run.use(1) / replace(run, half=half).use(1))
