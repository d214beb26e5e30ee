"""Goal of a design: its criterion, with what this takes from the model beside the information matrix."""

from __future__ import annotations

from dataclasses import dataclass

from excite.information.chosen_parameters import ChosenParameters
from excite.information.criteria import ConditionNumber, Criterion
from excite.information.interest import columns_of_interest
from excite.information.target import IdentificationTarget
from excite.registry import instance, name_of
from excite.tasks.task import Task
from regressors.errors import InputError


@dataclass(frozen=True, eq=False)
class Goal:
    """What a criterion takes from the model.

    Parameters
    ----------
    chosen : tuple of int
        Columns of the parameters of interest; none where all count alike.
    """

    chosen: tuple[int, ...] = ()

    def criterion(self, task: Task) -> Criterion:
        """The task's criterion as a function of M in the chosen convention."""
        criterion: Criterion = instance("criterion", task.objective.criterion)
        return ChosenParameters(criterion, self.chosen) if self.chosen else criterion


def goal_of(target: IdentificationTarget, task: Task) -> Goal:
    """Goal of a task.

    Parameters
    ----------
    target : IdentificationTarget
    task : Task

    Raises
    ------
    InputError
        Parameters of interest that the base does not have, or a single one for a condition number.
    """
    chosen = columns_of_interest(target, task)
    if len(chosen) == 1 and isinstance(instance("criterion", task.objective.criterion), ConditionNumber):
        raise InputError(
            f"interest: the criterion {name_of(task.objective.criterion)} of a single parameter is always 1; "
            "name several parameters, or choose the criterion `trace`"
        )
    return Goal(chosen)
