"""A campaign of partial motions: the fewest that together identify every parameter [KD96] sections 5.1, 6.

Moving few drives at a time keeps the motion simple and lets parameters be identified a few at a time.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Any

from excite.information.target import Identifiability, model_of, partial_motions
from excite.registry import name_of
from excite.tasks.robot_of_task import installed_robot, moving_robot, one_model, task_of
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.base import base_parameters, enough_states, random_states
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion, drive_names
from regressors.numerical import DESCRIPTION_CAUSE, numerical_work
from regressors.quantities import check
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.work_prediction import FLOAT, announce, check_memory

_MOST_SELECTIONS = 500
_SHORTER = "a lower `at_once` takes less"


@dataclass(frozen=True, eq=False)
class Step:
    """One partial motion of a campaign."""

    drives: tuple[str, ...]  # drives that move; the others hold their coordinate
    rank: int  # number of combinations of parameters that the motion identifies
    expressions: tuple[str, ...]  # these combinations in standard parameters
    # parameters of the whole model that are identifiable individually from this motion and those before it
    parameters: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Campaign:
    """Partial motions that together identify all parameters that the whole motion identifies."""

    robot: str
    joints: tuple[str, ...]
    model: str
    rank: int  # number of base parameters of the whole motion
    steps: tuple[Step, ...]
    # every selection of drives that was considered, and the number of combinations of parameters it identifies
    subsets: tuple[tuple[tuple[str, ...], int], ...]


@checked
@numerical_work("the campaign", DESCRIPTION_CAUSE)
def plan_campaign(
    robot_or_model: RegressorModel | Robot | Task | str, /, at_once: int | None = None, **options: Any
) -> Campaign:
    """Shortest campaign: fewest motions, then fewest moving drives, of at most ``at_once`` drives at a time.

    Parameters
    ----------
    robot_or_model : RegressorModel, Robot, Task or str
        Model to identify; the energy model where a robot, or its name or file, is given, unless ``model`` names
        another one.
    at_once : int, optional
        Largest number of drives at a time; two if not given, or one for a single drive.
    **options
        Model options of a `Task`, by name, such as ``model="differential"``.

    Raises
    ------
    InputError
        No drives, or motions of so few drives never identify all parameters.
    """
    one_model(robot_or_model, options)
    if isinstance(robot_or_model, Robot | str):
        options = {"model": "energy"} | options
    task = task_of(robot_or_model).changed(**options)
    robot = installed_robot(task)
    robot.check_open("a campaign of partial motions")
    moving = moving_robot(robot, task)
    check("at_once", at_once)
    drives = len(drive_names(moving))
    at_once = min(2, drives) if at_once is None else at_once
    if not 1 <= at_once <= drives:
        raise InputError(f"`at_once` must be from 1 to the {drives} drives, given {at_once}")
    whole = model_of(moving, task)
    columns = len(whole.columns)
    selections = float(sum(comb(drives, k) for k in range(1, at_once + 1)))  # each has a triangular factor
    held = f"{selections:.3g} selections of drives"
    check_memory("the campaign", FLOAT * selections * columns**2, held, "lower `at_once`")
    announce("the campaign", campaign_seconds(selections, columns, len(whole.row_labels)), _SHORTER)
    identifiability = Identifiability(whole)
    base = base_parameters(whole, rounding=0.0)  # as `Identifiability` counts
    motions = partial_motions(whole, at_once)
    factors = [identifiability.rows(motion) for _, motion in motions]
    chosen = _fewest(identifiability, factors, [len(names) for names, _ in motions], base.rank)
    if chosen is None:
        raise InputError(
            f"motions of at most {at_once} drive(s) at a time do not identify all {base.rank} parameters; "
            f"allow {at_once + 1} at once"
        )
    subsets = tuple((names, identifiability.rank([R])) for (names, _), R in zip(motions, factors, strict=True))
    steps = _steps(identifiability, [motions[k] for k in chosen], [factors[k] for k in chosen])
    return Campaign(robot.name, moving.joint_names, name_of(task.model.model), base.rank, steps, subsets)


def _fewest(
    identifiability: Identifiability, factors: list[Array], sizes: list[int], rank: int
) -> tuple[int, ...] | None:
    """Smallest selection of motions with full rank; among equal ones, that with the fewest moving drives.

    Where there are too many selections to enumerate, motions are added greedily by the rank that they contribute.
    """
    if identifiability.rank(factors) < rank:
        return None
    for count in range(1, len(factors) + 1):
        if comb(len(factors), count) > _MOST_SELECTIONS:
            break
        for selection in sorted(combinations(range(len(factors)), count), key=lambda s: sum(sizes[k] for k in s)):
            if identifiability.rank([factors[k] for k in selection]) == rank:
                return selection
    chosen: list[int] = []
    while identifiability.rank([factors[k] for k in chosen] or [factors[0][:0]]) < rank:
        ranks = [identifiability.rank([factors[k] for k in (*chosen, new)]) for new in range(len(factors))]
        chosen.append(max(range(len(factors)), key=lambda k: (ranks[k], -sizes[k])))
    return tuple(sorted(chosen))


def _steps(
    identifiability: Identifiability, motions: list[tuple[tuple[str, ...], PartialMotion]], factors: list[Array]
) -> tuple[Step, ...]:
    model = identifiability.model
    known: set[int] = set()
    steps = []
    for k, (names, motion) in enumerate(motions):
        shown = identifiability.shown(factors[: k + 1])
        fresh = tuple(model.names[i] for i in shown if i not in known)
        known |= set(shown)
        part = model.restricted(motion)
        states = motion.states(random_states(model.robot, enough_states(part)))
        base = base_parameters(part, states=states, rounding=0.0)
        steps.append(Step(names, base.rank, base.expressions, fresh))
    return tuple(steps)


_NUMBER = 1.1e-6  # seconds of a triangular factor for each pair of columns and each equation


def campaign_seconds(selections: float, columns: int, equations: int) -> float:
    """Time of the factors of all selections of drives on one core [s]; right within a factor of three.

    The unit that it grows with is a number of these factors: selections times equations times columns times columns.
    Measured with 21 to 127 selections, 13 to 84 columns and 1 to 7 equations.
    """
    return 0.1 + _NUMBER * selections * equations * float(columns) ** 2
