"""Goal of a design: its criterion, with what this takes from the model beside the information matrix.

The regressor does not depend on the parameters, so that neither does M; but relative precision does, since it refers to
values that are known only roughly. For robots r with scales ``s_r`` over those of the described robot, the criterion is
``max_r f(R_r M R_r)``, ``R_r = diag(s_r / s)``: a maximin design in the words of [Atkinson, Donev, Tobias 2007,
chapter 17].

[Atkinson, Donev, Tobias 2007] "Optimum Experimental Designs, with SAS", Oxford University Press.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.special

from excite.information.criteria import ConditionNumber, Criterion
from excite.information.interest import ChosenParameters, columns_of_interest
from excite.information.prior import prior_of
from excite.information.target import IdentificationTarget
from excite.information.task_torques import task_torques
from excite.information.torque_deviation import TorqueCriterion
from excite.registry import instance, name_of
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Goal:
    """What a criterion takes from the model."""

    chosen: tuple[int, ...] = ()  # columns of the parameters of interest; none where all count alike
    torques: Array | None = None  # (K, b) rows of the torques to be predicted, for a criterion of them
    ratios: Array | None = None  # (R, b) values of parameters of plausible robots over the described ones

    def of(self, criterion: Criterion) -> Criterion:
        """A criterion as a function of M in the chosen convention."""
        if self.torques is not None and isinstance(criterion, TorqueCriterion):
            return criterion.of_rows(self.torques)
        criterion = ChosenParameters(criterion, self.chosen) if self.chosen else criterion
        return criterion if self.ratios is None else WorstRobot(criterion, self.ratios)


def goal_of(target: IdentificationTarget, task: Task) -> Goal:
    """Goal of a task."""
    objective = task.objective
    criterion: Criterion = instance("criterion", objective.criterion)
    name = name_of(objective.criterion)
    if isinstance(criterion, TorqueCriterion):
        if objective.interest or objective.plausible_robots is not None:
            what = "interest" if objective.interest else "plausible_robots"
            raise InputError(
                f"{what}: the criterion {name} is for predicted torques, in which every parameter counts, and which do "
                f"not depend on their values; leave `{what}` out, or give `criterion='trace'`"
            )
        return Goal(torques=task_torques(target, task))
    if objective.task_motion is not None:
        raise InputError(
            f"task_motion: the criterion {name} is not for torques; give `criterion='torque-deviation'` or "
            "`criterion='max-torque-deviation'`"
        )
    chosen = columns_of_interest(target, task)
    if len(chosen) == 1 and isinstance(criterion, ConditionNumber):
        raise InputError(
            f"interest: the criterion {name} of a single parameter is always 1; name several parameters, or give "
            "`criterion='trace'`"
        )
    count = objective.plausible_robots
    return Goal(chosen, ratios=None if count is None else value_ratios(target, task, count))


SEED = 0
_SHARPER = 4.0  # the maximum over robots than the criterion itself


@dataclass(frozen=True, eq=False)
class WorstRobot(Criterion):
    """Largest value of a criterion over several scales of the columns.

    The approximation ``(1/p) log sum_r exp(p f_r)`` of the criterion's own f is never below their largest, and tends to
    it as p grows.
    """

    criterion: Criterion
    ratios: Array  # (R, b) diagonals of ``R_r``
    stages: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)

    @property
    def name(self) -> str:  # type: ignore[override]
        """That of the criterion."""
        return self.criterion.name

    def value(self, M: Array) -> float:
        """``max_r f(R_r M R_r)``."""
        return max(self.criterion.value(M * np.outer(r, r)) for r in self.ratios)

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """The approximation of the class, with ``G = sum_r w_r R_r G_r R_r``."""
        parts = [self.criterion.smooth(M * np.outer(r, r), sharpness) for r in self.ratios]
        p = _SHARPER * sharpness
        powers = p * np.array([value for value, _ in parts])
        weights = scipy.special.softmax(powers)
        terms = zip(weights, self.ratios, parts, strict=True)
        G = sum(w * np.outer(r, r) * of_robot for w, r, (_, of_robot) in terms)
        return float(scipy.special.logsumexp(powers)) / p, np.asarray(G)


def value_ratios(target: IdentificationTarget, task: Task, count: int) -> Array:
    """Values of the base parameters of plausible robots over those of the described one, shape (count + 1, b).

    The first robot is the described one; the others have standard parameters drawn independently from the prior, normal
    with its deviations, with the seed `SEED`. A value counts with at least its prior deviation: relative precision
    about zero has no meaning.
    """
    T = target.transforms[task.objective.base]
    prior = prior_of(target.model, target.base, task.objective.prior)
    known, rng = np.isfinite(prior.deviations), np.random.default_rng(SEED)
    deviations = np.where(known, prior.deviations, 0.0)
    drawn = prior.values + deviations * rng.normal(size=(count, deviations.size))
    values = [np.abs(replace(prior, values=u).base_values(T)) for u in (prior.values, *drawn)]
    least = prior.base_deviations(T)
    floor = np.where(np.isfinite(least), least, 0.0)
    return np.asarray(np.maximum(values, floor) / values[0])
