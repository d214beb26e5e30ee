"""One period that a search for the shortest experiment tried, and the front of robot time against precision."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from excite.design.design import Design
from excite.information.precision_forecast import RunInformation
from excite.precision.out_of_reach import OutOfReach


@dataclass(frozen=True, eq=False)
class PeriodTrial:
    """The best motion found for one period."""

    period: float  # [s]
    richness: int  # number of harmonics, or what the family has instead
    design: Design  # within the limits, with its `run_information`

    @property
    def run(self) -> RunInformation:
        """What one run brings."""
        assert self.design.run_information is not None
        return self.design.run_information

    @property
    def seconds(self) -> float:
        """Robot time of one run, with approach and return [s]."""
        return self.run.seconds

    @property
    def runs(self) -> int:
        """The fewest runs that meet the target."""
        return self.run.fewest_runs()

    @property
    def robot_seconds(self) -> float:
        """Robot time of these runs [s]."""
        return self.runs * self.seconds

    def reach(self, max_time: float) -> float:
        """Largest half-width over the allowed one after as many runs as a robot time leaves room for."""
        return self.run.use(max(1, math.floor(max_time / self.seconds)))


@dataclass(frozen=True)
class FrontPoint:
    """An experiment than which none that was tried is both shorter and more precise."""

    period: float  # [s]
    runs: int
    robot_seconds: float
    use: float  # largest half-width over the allowed one: 1 meets the target just so, 2 a target twice as wide


def pareto_front(trials: Sequence[PeriodTrial], max_time: float) -> tuple[FrontPoint, ...]:
    """Robot time against precision: numbers of runs of all periods, without those that another one dominates."""
    points = [
        FrontPoint(trial.period, runs, runs * trial.seconds, trial.run.use(runs))
        for trial in trials
        for runs in range(1, max(1, math.floor(max_time / trial.seconds)) + 1)
    ]
    front: list[FrontPoint] = []
    for point in sorted(points, key=lambda point: (point.robot_seconds, point.use)):
        if not front or point.use < front[-1].use:
            front.append(point)
    return tuple(front)


@dataclass(frozen=True, eq=False)
class PrecisionSearch:
    """A search for the shortest experiment that meets a precision.

    Parameters
    ----------
    trials : tuple of PeriodTrial
        In the order of their periods.
    front : tuple of FrontPoint
    out_of_reach : OutOfReach, optional
        What keeps the target out of reach, where it is.
    """

    trials: tuple[PeriodTrial, ...]
    front: tuple[FrontPoint, ...]
    out_of_reach: OutOfReach | None = None

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "trials": [
                {
                    "period": trial.period,
                    "harmonics": trial.richness,
                    "seconds_per_run": trial.seconds,
                    "runs": trial.runs,
                    "robot_seconds": trial.robot_seconds,
                    "use_of_one_run": trial.run.use(1),
                }
                for trial in self.trials
            ],
            "front": [asdict(point) for point in self.front],
            **({"out_of_reach": asdict(self.out_of_reach)} if self.out_of_reach is not None else {}),
        }
