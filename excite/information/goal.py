"""Goal of a design: its criterion, with what this takes from the model beside the information matrix."""

from __future__ import annotations

from dataclasses import dataclass

from excite.information.chosen_parameters import ChosenParameters
from excite.information.criteria import ConditionNumber, Criterion
from excite.information.interest import columns_of_interest
from excite.information.plausible_robots import WorstRobot, value_ratios
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
