"""Candidate designs judged by the same yardsticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from constraints.certificate import LimitUse, limit_uses
from constraints.linear import linear_limits
from excite.files.design_json import StoredDesign
from excite.subject import subject_of
from excite.task import Task
from excite.yardsticks import measures, noise_per_row

RATE = 100.0


@dataclass(frozen=True)
class Judgement:
    """One design under the common yardsticks.

    Parameters
    ----------
    name : str
        Folder of the design.
    robot : str
    model : str
    moving : tuple of str
        Names of the joints, or of the drives, that move.
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
    model: str
    moving: tuple[str, ...]
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
    return [_judgement(design, designs[0].task) for design in designs]


def _judgement(design: StoredDesign, terms: Task) -> Judgement:
    task = replace(design.task, friction=terms.friction, rotor=terms.rotor, offset=terms.offset)
    subject = subject_of(design.robot, task)
    fits = terms.noise is None or len(terms.noise) in (1, len(subject.model.row_labels))  # if not, nothing compares
    noise = noise_per_row(terms.noise if fits else task.noise, subject.model)
    times = subject.model.times(design.trajectory.duration, RATE)
    uses = [
        use for limit in linear_limits(design.moving) for use in limit_uses(limit, design.trajectory.extrema(limit))
    ]
    return Judgement(
        name=str(design.folder),
        robot=design.robot.name,
        model=task.model,
        moving=subject.motion.labels,
        duration=design.trajectory.duration,
        parameters=subject.base.rank,
        criteria=measures(subject, design.trajectory.samples(times), noise),
        tightest=max(uses, key=lambda use: use.use, default=None),
        feasible=all(use.holds for use in uses),
        cpu_seconds=float(design.content["provenance"]["cpu_seconds"]),
    )
