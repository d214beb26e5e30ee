"""Candidate designs judged by the same yardsticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from constraints.certificate import LimitUse, limit_uses
from constraints.linear import linear_limits
from excite.files.design_json import StoredDesign
from excite.formulation import model_of
from excite.yardsticks import measures, noise_per_row
from regressors.base import base_parameters

RATE = 100.0


@dataclass(frozen=True)
class Judgement:
    """One design under the common yardsticks.

    Parameters
    ----------
    name : str
        Folder of the design.
    robot : str
    joints : tuple of str
        Those that move.
    duration : float
        [s]
    parameters : int
        Number of base parameters.
    criteria : dict of str to float
        See `excite.yardsticks.CONVENTIONS`; at 100 Hz whatever rate the design was written at.
    tightest : LimitUse or None
        The limit with the least margin as part of its range.
    feasible : bool
        Every limit holds over continuous time.
    cpu_seconds : float
        That the design took.
    """

    name: str
    robot: str
    joints: tuple[str, ...]
    duration: float
    parameters: int
    criteria: dict[str, float]
    tightest: LimitUse | None
    feasible: bool
    cpu_seconds: float


def judged(designs: Sequence[StoredDesign]) -> list[Judgement]:
    """Every design under the terms (friction, rotors, noise) of the first one.

    Parameters
    ----------
    designs : sequence of StoredDesign

    Returns
    -------
    list of Judgement
        In the order given.
    """
    first = designs[0].task
    return [_judgement(design, first.friction, first.rotor, first.offset) for design in designs]


def _judgement(design: StoredDesign, friction: bool, rotor: bool, offset: bool) -> Judgement:
    task = replace(design.task, friction=friction, rotor=rotor, offset=offset)
    model = model_of(design.moving, task)
    base = base_parameters(model)
    noise = noise_per_row(task.noise, design.moving)
    uses = [
        use for limit in linear_limits(design.moving) for use in limit_uses(limit, design.trajectory.extrema(limit))
    ]
    return Judgement(
        name=str(design.folder),
        robot=design.robot.name,
        joints=design.moving.joint_names,
        duration=design.trajectory.duration,
        parameters=base.rank,
        criteria=measures(model, base, design.trajectory.sampled(RATE), noise),
        tightest=max(uses, key=lambda use: use.use, default=None),
        feasible=all(use.holds for use in uses),
        cpu_seconds=float(design.content["provenance"]["cpu_seconds"]),
    )
