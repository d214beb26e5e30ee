"""What more harmonics, more time or looser limits would bring, found by improving a design's motion."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from constraints.certificate import LimitUse
from constraints.enclosure import uses_of
from excite.design.blueprint import check_richness, grid_instants, restricted_limits
from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.grid_limits import GridConstraint
from excite.design.initial_guesses import shrunk
from excite.design.problem import Problem
from excite.design.solvers.solver import Solver
from excite.registry import instance, name_of
from excite.storage.codec import Beside
from regressors.errors import InputError
from regressors.numerical import numerical_work, one_thread
from regressors.samples import Array

_RICHER, _LONGER, _LOOSER = 2, 1.5, 1.2
_USED = 0.99  # of a limit, above which it may hold the motion back
_SETTLED = 1e-3  # relative improvement by one more refinement, below which a motion has settled
_REFINEMENTS = 6
_SMALLER = (1.0, 1 - 1e-6, 1 - 1e-4, 0.999, 0.99, 0.95)
_SAME = 1e-9  # of the extent of a motion: difference up to which another family has it too
_INSTANTS = 1001


@dataclass(frozen=True)
class SensitivityRow:
    """One change of a design's problem, and what was found to come of it."""

    change: str
    value: float  # criterion of the motion after the change
    # ``1 - value / reference``: 0.1 where the criterion becomes 10 % lower; negative where it becomes higher
    gain: float


@dataclass(frozen=True)
class Sensitivity:
    """Changes of a design's problem, those that bring most first."""

    beside: ClassVar[Beside] = {"meaning": lambda changes: changes.meaning}

    criterion: str  # the one that the design minimises
    reference: float  # criterion of the design's motion, refined without a change; at most that of the design
    rows: tuple[SensitivityRow, ...]
    cpu_seconds: float

    @property
    def meaning(self) -> str:
        """What the gains are."""
        return (
            "gains are those found by improving this motion after one change at a time, not of the bound, and are a "
            "lower estimate: a search from scratch may find more, also where a gain is negative"
        )


LIKELY_CAUSE = (
    "values of very different sizes are the likely cause: check the limits, `noise` and the description of the robot"
)


@numerical_work("the sensitivity", LIKELY_CAUSE)
def sensitivity(design: Design, progress: Callable[[str], None] = lambda _: None) -> Sensitivity:
    """Change a design's problem in one respect at a time, and improve its motion in the new problem.

    The changes are twice the harmonics (of families with another option that makes them richer, that one), 1.5 times
    the period, and each limit of joints and drives that the motion uses to more than 99 %, looser by 20 % of half its
    range. The motion is first refined without a change until that brings less than 0.1 %. Every gain is relative to the
    same refinement once more, so that it is not that of a longer search; motions of 1.5 times the period begin at three
    motions, since this one is none of them.
    """
    began = time.process_time()
    with one_thread(), np.errstate(all="ignore"):
        change = ProblemChanges.of(design, progress)
        rows = []
        for name, made in change.every():
            progress(f"trying {name}")
            if (changed := made()) is not None:
                _, value = change.best(*changed)
                rows.append(SensitivityRow(name, value, change.gain(value)))
    rows.sort(key=lambda row: -row.gain)
    criterion = str(name_of(design.task.objective.criterion))
    return Sensitivity(criterion, change.reference, tuple(rows), time.process_time() - began)


#: A problem after a change; where improvement begins, one motion or more; and the criterion of a motion that keeps the
#: limits after the change too, infinite where there is none.
ChangedProblem = tuple[Problem, tuple[Array, ...], float]


@dataclass(frozen=True, eq=False)
class ProblemChanges:
    """Changes of one design problem."""

    formulation: Formulation
    solver: Solver
    x: Array  # A motion of the moving coordinates that refinement without a change has settled at
    reference: float  # criterion after one more refinement

    @classmethod
    def of(cls, design: Design, progress: Callable[[str], None] = lambda _: None) -> ProblemChanges:
        """Refine the motion of a design without a change."""
        formulation, solver, x = reformulated(design)
        problem = formulation.problem
        value = problem.exact_value(x)
        progress("refining the motion")
        for _ in range(_REFINEMENTS):
            before, (x, value) = value, best_of(problem, solver, x, value)
            if value > (1.0 - _SETTLED) * before:
                break
        return cls(formulation, solver, x, best_of(problem, solver, x, value)[1])

    def best(self, problem: Problem, starts: tuple[Array, ...], known: float) -> tuple[Array, float]:
        """The best motion found, and its criterion; where nothing better is found than what is known, that."""
        return min((best_of(problem, self.solver, x, known) for x in starts), key=lambda end: end[1])

    def gain(self, value: float) -> float:
        """``1 - value / reference``."""
        return 1.0 - value / self.reference

    def every(self) -> Iterator[tuple[str, Callable[[], ChangedProblem | None]]]:
        """All changes: what each is, and a call that makes it, None where it is impossible."""
        choice = self.formulation.task.trajectory
        option, count = choice.richness
        yield f"{_RICHER * count} {option} instead of {count}", self.richer
        longer, as_fast = _LONGER * choice.period, math.ceil(_LONGER * count)
        yield f"{longer:g} s instead of {choice.period:g} s", self.longer
        if as_fast > count:
            yield f"{longer:g} s instead of {choice.period:g} s, with {as_fast} {option}", partial(self.longer, as_fast)
        for use in self.uses(self.x):
            if use.use > _USED:
                yield f"{use.label} limit looser by 20 %", partial(self.looser, use.label)

    def uses(self, x: Array) -> tuple[LimitUse, ...]:
        """Use of each limit of joints and drives by a motion, over continuous time."""
        return uses_of(self.formulation.problem.information.trajectory(x), self.formulation.limits)

    def looser(self, label: str, factor: float = _LOOSER) -> ChangedProblem:
        """The range of one limit about its middle enlarged by a factor."""
        problem = self.formulation.problem
        linear = tuple(loosened(limit, (label,), factor) for limit in problem.limits.linear)
        return _with_linear(problem, linear), (self.x,), self.reference

    def richer(self) -> ChangedProblem | None:
        """Twice the harmonics, or what the family has instead."""
        option, count = self.formulation.task.trajectory.richness
        changed = self._problem(**{option: _RICHER * count})
        start = None if changed is None else same_motion(self.formulation.problem, self.x, changed)
        if changed is None or start is None:
            return None
        # as many instants per harmonic as the reference has, so that the bounds on the grid are as tight
        grid = changed.family.on_grid(_RICHER * grid_instants(self.formulation.problem.family.richness))
        limits = restricted_limits(self.formulation.limits, self.formulation.blueprint.motion)
        linear = tuple(GridConstraint.on_coordinates(limit, grid) for limit in limits)
        return _with_linear(changed, linear), (start,), self.reference

    def longer(self, richness: int | None = None) -> ChangedProblem | None:
        """Motions that last 1.5 times as long, begun with the same shape, and with the same speed and a rest."""
        choice = self.formulation.task.trajectory
        option, count = choice.richness
        changed = self._problem(period=_LONGER * choice.period, **{option: richness or count})
        if changed is None:
            return None
        stretched = same_motion(self.formulation.problem, self.x, changed)
        own_speed = (self._with_rest(changed, after) for after in (0.0, 1.0))
        return changed, (*([] if stretched is None else [stretched]), *own_speed), np.inf

    def _with_rest(self, longer: Problem, after: float) -> Array:
        """The motion nearest to this one at its own speed, before or after (0 or 1) a rest for the rest of the time."""
        short = self.formulation.problem.family
        time_there = np.linspace(0.0, longer.family.duration, _INSTANTS)
        begin = after * (longer.family.duration - short.duration)
        q = short.motion(self.x, np.clip(time_there - begin, 0.0, short.duration), 0)
        return longer.family.nearest(time_there, q)

    def _problem(self, **options: Any) -> Problem | None:
        """The problem with other options of the family; None where it cannot be had with them."""
        formulation = self.formulation
        try:
            choice = formulation.task.trajectory
            own = choice.trajectory
            kind: Any = own if isinstance(own, str | type) else type(own)  # a family object becomes its class
            task = formulation.task.changed(trajectory=replace(choice, trajectory=kind, **options))
            check_richness(task)
            return replace(formulation.blueprint, task=task).problem(formulation.nonlinear, formulation.stated)
        except InputError:
            return None


def reformulated(design: Design) -> tuple[Formulation, Solver, Array]:
    """The problem of a design, its solver, and the x of its motion in the moving coordinates."""
    formulation = formulate(design.robot, design.task)
    motion = formulation.blueprint.motion
    inverse = np.asarray(np.linalg.pinv(motion.matrix), dtype=float)
    x = design.trajectory.carried(inverse, -inverse @ motion.offset).x
    return formulation, instance("solver", design.task.search.solver), x


def loosened(limit: GridConstraint, labels: Collection[str], factor: float) -> GridConstraint:
    """The constraint with the bounds of some of its functions, if it has them, further from their middle."""
    mine = np.array([each in labels for each in limit.function.constraint.labels])
    if not mine.any():
        return limit
    extra = np.where(mine, 0.5 * (factor - 1.0) * (limit.upper - limit.lower), 0.0)
    scale = np.where(mine, factor * limit.scale, limit.scale)
    return replace(limit, lower=limit.lower - extra, upper=limit.upper + extra, scale=scale)


def _with_linear(problem: Problem, linear: tuple[GridConstraint, ...]) -> Problem:
    return replace(problem, limits=replace(problem.limits, linear=linear))


def same_motion(problem: Problem, x: Array, other: Problem) -> Array | None:
    """The x of the same motion, over the whole duration, in the family of another problem; None if that has it not."""
    u = np.linspace(0.0, 1.0, _INSTANTS)
    wanted = problem.family.motion(x, u * problem.family.duration, 0)
    time_there = u * other.family.duration
    starts = [other.family.nearest(time_there, wanted)]
    if x.shape == starts[0].shape:
        starts.append(x)
    errors = [float(np.abs(other.family.motion(start, time_there, 0) - wanted).max()) for start in starts]
    return starts[int(np.argmin(errors))] if min(errors) <= _SAME * float(np.ptp(wanted, axis=0).max()) else None


def best_of(problem: Problem, solver: Solver, x: Array, value: float = np.inf) -> tuple[Array, float]:
    """The best of a motion and of what a solver makes of it, and its criterion as results report it.

    The solver goes on from the motion twice: in the last stage of the criterion, and through all of them, where it may
    leave a local minimum.
    """
    ends = [(x, value)]
    for improve in (solver.refine, lambda limited, start: solver.solve(limited, [start])):
        limited, start = problem, _inside(problem, x)
        found = improve(limited, start).x
        while (more := limited.with_broken(found)) is not limited:
            limited, start = more, _inside(more, x)
            found = improve(limited, start).x
        ends += [(each, problem.exact_value(each)) for each in (start, found)]
    return min(ends, key=lambda end: end[1])


def _inside(problem: Problem, x: Array) -> Array:
    """The motion, as little smaller as the limits on the grid require."""
    for part in _SMALLER:
        smaller = x if part == 1.0 else problem.drawn(x, part)
        if problem.violation(smaller) <= 0.0 and problem.nonlinear_hold(smaller):
            return smaller
    return shrunk(problem, problem.drawn(x, min(1.0, 0.999 * problem.reach(x))))
