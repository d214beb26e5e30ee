"""The next motion of a sequence of experiments: what is known too little, the motion that adds it, and when to stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from excite.design.design import Design
from excite.design.formulation import with_information_in_hand
from excite.design.optimisation import Progress, design_trajectory
from excite.information.earlier_precision import InformationInHand, deviations_of, information_in_hand
from excite.information.half_widths import ABOUT_ZERO, allowed_half_widths, torque_precision
from excite.information.precision_forecast import PrecisionForecast
from excite.information.prior import base_sizes
from excite.information.target import IdentificationTarget, inverse_half, target_of
from excite.storage.records import Shown
from excite.study.design_for_precision import design_for_precision, precise_task, with_offsets
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.robot_of_task import installed_robot, one_model, task_of
from excite.tasks.stored_files import DESIGN
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.robot.robot import Robot
from regressors.samples import Array

_OF = ("measured", "described")


@dataclass(frozen=True)
class PrecisionInHand:
    """How precisely one base parameter, or a torque along a task motion, is known, and is to be known.

    Parameters
    ----------
    name, expression, unit : str
    value : float or None
        Estimate by all results in hand together; None without one.
    allowed : float
        Largest half-width of its interval; infinite where nothing is asked of it.
    half_width : float
        Of its interval by what is in hand; infinite where nothing is known of it.
    expected : float
        The same after the next motion, as it is kept to with the probability of the target; `half_width` where none is
        needed.
    """

    name: str
    expression: str
    unit: str
    value: float | None
    allowed: float
    half_width: float
    expected: float

    @property
    def enough(self) -> bool:
        """Whether its interval is narrow enough."""
        return self.half_width <= self.allowed


@dataclass(frozen=True, eq=False, repr=False)
class NextMotion(Shown):
    """Whether what is in hand is enough, and else the motion to play next.

    Parameters
    ----------
    robot : str
    parameters : tuple of PrecisionInHand
    design : Design or None
        The next motion; None where what is in hand is enough.
    planned : tuple of str
        Designs in hand that are still to be played.
    task : Task
        With the information in hand, and the precision that is asked for.
    """

    robot: str
    parameters: tuple[PrecisionInHand, ...]
    design: Design | None
    planned: tuple[str, ...]
    task: Task

    @property
    def enough(self) -> bool:
        """Whether every interval is narrow enough."""
        return all(parameter.enough for parameter in self.parameters)

    @property
    def missing(self) -> tuple[PrecisionInHand, ...]:
        """Parameters whose interval is too wide, the one that is furthest from its allowed half-width first."""
        wide = (parameter for parameter in self.parameters if not parameter.enough)
        return tuple(sorted(wide, key=lambda one: -one.half_width / one.allowed))

    @property
    def forecast(self) -> PrecisionForecast | None:
        """Runs of the next motion and what is expected of them; None where none is needed."""
        return None if self.design is None else self.design.precision

    @property
    def runs(self) -> int:
        """Number of runs of the next motion; 0 where none is needed."""
        return 0 if self.forecast is None else self.forecast.runs

    def __repr__(self) -> str:
        """One line."""
        if self.enough:
            return f"<NextMotion of {self.robot}: enough, {len(self.parameters)} parameters>"
        return f"<NextMotion of {self.robot}: {len(self.missing)} parameters missing, {self.runs} run(s)>"


@checked
def next_motion(
    robot_or_model: RegressorModel | Robot | Task | str,
    /,
    precision: PrecisionTarget | float | str | None = None,
    *,
    of: str = "measured",
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> NextMotion:
    """Say whether what is in hand is enough for a precision, and else design the motion that adds most to it.

    With the information in hand P and that of one run ``W' S^-1 W``, the motion minimises the largest ratio of a
    parameter's standard deviation by ``P + W' S^-1 W`` to its allowed half-width, so that the worst of the missing
    parameters drives it. The number of runs n is the least for which every half-width by ``P + n W' S^-1 W`` is
    allowed, see `excite.information.half_widths`.

    Parameters
    ----------
    robot_or_model : RegressorModel, Robot, Task or str
        See `excite.design_trajectory`.
    precision : PrecisionTarget, float or str
        Largest half-width of each parameter's interval: a share of every parameter, such as 0.05 or ``"5%"``, or a
        target; that of the task if not given.
    of : {"measured", "described"}
        Of which values the shares are: those that the results in hand have measured, as far as they have, or those of
        the robot's description. A measured value whose interval does not reach `ABOUT_ZERO` of the parameter's size is
        about zero, and the size stands for it; one that may be about zero counts as that large at least. Of a parameter
        without a size, such as friction that is not described, nothing is asked while its interval reaches zero.
    progress : callable, optional
        Called with each start's result.
    report : callable
        Called with a sentence on each period that is tried.
    **options
        Options of a `Task`: `after`, the results and designs in hand; `noise`, `home`, `search` and others. Where no
        `period` is given here, nor ``scale="precision"`` with a task, it is the one of the shortest experiment, see
        `excite.design_for_precision`.

    Returns
    -------
    NextMotion

    Raises
    ------
    InputError
        See `excite.design_trajectory`; or no precision, or one that asks nothing of this model's parameters.
    """
    one_model(robot_or_model, options)
    if of not in _OF:
        raise InputError(f"`of` must be one of {', '.join(_OF)}, given {of!r}")
    given = {} if precision is None else {"precision": precision}
    task = task_of(robot_or_model).changed(**given, **options)
    robot = installed_robot(task)
    task = with_information_in_hand(robot, task)
    asked = task.objective.precision
    if not isinstance(asked, PrecisionTarget):
        raise InputError("no precision is asked for; give `precision`, such as 0.05")
    target = target_of(robot, task)
    b = target.base.rank
    in_hand = information_in_hand(target, task) or InformationInHand(np.zeros((0, b)), 0, np.full(b, np.nan))
    freedom = max(in_hand.degrees_of_freedom, 1)
    factor = float(scipy.special.stdtrit(freedom, 0.5 + 0.5 * asked.level))  # half-width over standard deviation
    if of == "measured":
        asked = _of_measured(asked, target, in_hand.values, factor * deviations_of(in_hand.R))
        task = task.changed(precision=asked)
    now = _in_hand(asked, target, in_hand, factor)
    if all(one.enough for one in now):
        design = None
    elif "period" in options or task.objective.scale == "precision":
        design = design_trajectory(with_offsets(precise_task(task)), progress=progress)
    else:
        design = design_for_precision(task, progress=progress, report=report)
    planned = tuple(dict.fromkeys(one.name for one in task.objective.after if one.kind == DESIGN))
    return NextMotion(robot.name, _with_expected(now, design), design, planned, task)


def _of_measured(
    asked: PrecisionTarget, target: IdentificationTarget, values: Array, half_widths: Array
) -> PrecisionTarget:
    """The target with measured values as scales, of parameters that have one and no scale of their own."""
    size = base_sizes(target.model, target.base)
    sized, magnitude = np.isfinite(size), np.abs(values)
    at_least = np.where(sized, ABOUT_ZERO * size, 0.0)
    about_zero = magnitude + half_widths < at_least
    scale = np.where(about_zero, size, np.maximum(magnitude, at_least))
    scale[~sized & (magnitude <= half_widths)] = np.nan  # a share of what may be zero asks for what nothing measures
    known = {name: float(x) for name, x in zip(target.base.names, scale, strict=True) if np.isfinite(x) and x > 0.0}
    return replace(asked, scales={**known, **asked.scales})


def _in_hand(
    asked: PrecisionTarget, target: IdentificationTarget, in_hand: InformationInHand, factor: float
) -> list[PrecisionInHand]:
    """Half-widths by what is in hand: of the base parameters, and of torques along a task motion where there is one."""
    base, deviation = target.base, deviations_of(in_hand.R)
    allowed = allowed_half_widths(asked, target)
    known = [None if np.isnan(value) else float(value) for value in in_hand.values]
    rows = list(zip(base.names, base.expressions, base.units, known, allowed, deviation, strict=True))
    if asked.torques is not None:
        torques = torque_precision(asked.torques, target)
        names, identified = torques.names, bool(np.all(np.isfinite(deviation)))
        errors = torques.deviations(inverse_half(in_hand.R)) if identified else np.full(len(names), np.inf)
        rows += zip(names, names, torques.units, [None] * len(names), torques.allowed, errors, strict=True)
    return [
        PrecisionInHand(name, expression, unit, value, float(most), float(factor * s), float(factor * s))
        for name, expression, unit, value, most, s in rows
    ]


def _with_expected(now: Sequence[PrecisionInHand], design: Design | None) -> tuple[PrecisionInHand, ...]:
    forecast = None if design is None else design.precision
    if forecast is None:
        return tuple(now)
    then = {parameter.name: parameter.half_width for parameter in forecast.parameters}
    return tuple(replace(one, expected=then[one.name]) for one in now)
