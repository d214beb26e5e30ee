"""A design: an optimised motion with its limits, criteria and provenance."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from constraints.bounds.certificate import LimitUse
from constraints.bounds.interpolation import InterpolatedLimits
from constraints.collision.geometry import World
from constraints.nonlinear import NonlinearConstraint
from excite.design.approach import ApproachAndReturn
from excite.design.between_samples import between_samples
from excite.design.designed_motion import DesignedMotion
from excite.design.harmonics_trial import HarmonicsTrial
from excite.design.search_rounds import SearchSummary
from excite.design.start_results import StartResult
from excite.design.stated_limits import Unchecked
from excite.information.metrics import PredictedAccuracy
from excite.information.nearly_unidentifiable import NearlyUnidentifiable
from excite.information.precision_forecast import PrecisionForecast, RunInformation
from excite.information.target import IdentificationTarget
from excite.information.weighting import PriorAndPosterior
from excite.registry import built_in
from excite.storage.manifest import entry_sha256
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import MotionSequence
from regressors.models.base import Base
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

if TYPE_CHECKING:
    from excite.study.period_search import PrecisionSearch


@dataclass(frozen=True, eq=False, repr=False)
class Design(DesignedMotion):
    """One designed motion with its certificate.

    Parameters
    ----------
    robot : Robot
        The whole robot, as described.
    task : Task
    target : IdentificationTarget
        Model to identify, with its base columns.
    trajectory : Trajectory
        Motion of the moving robot's joints.
    criteria : dict of str to float
        See `excite.information.metrics.CONVENTIONS`.
    limits : tuple of LimitUse
        Over continuous time.
    predicted : tuple of PredictedAccuracy
    spectrum : ndarray, shape (b,)
        Singular values of W, largest first.
    rows : int
        Number of rows of W.
    starts : tuple of StartResult
        All of them; the best of a great many.
    best_start : int
    provenance : dict
    notes : tuple of str
    prior : tuple of PriorAndPosterior
        Base parameters before and after the experiment; empty without prior knowledge.
    interrupted : bool
        True if the search was stopped before its end.
    approach_and_return : ApproachAndReturn, optional
        Transfers from home and back, where the task has a home.
    folder : Path, optional
        None; a design does not store the folder that it is saved to.
    nonlinear : tuple of NonlinearConstraint
        Limits of torques, the tool and distances, functions of the joints that move.
    unchecked : tuple of Unchecked
        Kinds of limits that nothing is known of, so that the motion may break them.
    nearly_unidentifiable : tuple of NearlyUnidentifiable
        Base parameters that the motion leaves far more uncertain than they are large; where there are any, the first
        of the notes says so.
    further_starts : int
        Number of starts beside `starts`.
    search : SearchSummary, optional
        Rounds of the search, and its estimate of what more of them would bring.
    harmonics_trials : tuple of HarmonicsTrial
        Numbers of harmonics that a search tried which chose it, in order; none otherwise.
    shape : World, optional
        Shape of the robot by which self-collision was checked, where it is that of the robot's own file.
    run_information : RunInformation, optional
        What one run brings towards the precision that the task asks for.
    precision_search : PrecisionSearch, optional
        Periods that were tried, where the shortest experiment was sought.
    """

    robot: Robot
    task: Task
    target: IdentificationTarget
    trajectory: Trajectory
    criteria: dict[str, float]
    limits: tuple[LimitUse, ...]
    predicted: tuple[PredictedAccuracy, ...]
    spectrum: Array
    rows: int
    starts: tuple[StartResult, ...]
    best_start: int
    provenance: dict[str, object]
    notes: tuple[str, ...] = ()
    prior: tuple[PriorAndPosterior, ...] = ()
    interrupted: bool = False
    approach_and_return: ApproachAndReturn | None = None
    folder: Path | None = None
    nonlinear: tuple[NonlinearConstraint, ...] = ()
    unchecked: tuple[Unchecked, ...] = ()
    nearly_unidentifiable: tuple[NearlyUnidentifiable, ...] = ()
    further_starts: int = 0
    search: SearchSummary | None = None
    harmonics_trials: tuple[HarmonicsTrial, ...] = ()

    @property
    def number_of_starts(self) -> int:
        """Number of starts that the motion is the best of."""
        return len(self.starts) + self.further_starts

    shape: World | None = None
    run_information: RunInformation | None = None
    precision_search: PrecisionSearch | None = None

    @property
    def precision(self) -> PrecisionForecast | None:
        """Runs that meet the precision that the task asks for within its `max_time`, and their half-widths."""
        run = self.run_information
        return None if run is None else run.forecast(self.task.objective.max_time)

    @property
    def moving(self) -> Robot:
        """The robot that the model is written for, with the task's limits."""
        return self.target.robot

    @property
    def base(self) -> Base:
        """Left-to-right base of the model."""
        return self.target.base

    @property
    def minimised_value(self) -> float:
        """Value of the criterion that was minimised, as `excite.information.weighting.minimised_text` names it."""
        return next(start.value for start in self.starts if start.index == self.best_start)

    @property
    def coefficients_sha256(self) -> str:
        """Hash of the motion's coefficients, as ``design.json`` has it."""
        entry = self.trajectory.family.to_dict(self.trajectory.x)
        return entry_sha256({"joints": list(self.moving.joint_names), **entry})

    @property
    def transfers(self) -> ApproachAndReturn | None:
        """Approach and return, where the task has a home."""
        return self.approach_and_return

    @property
    def transfer_limits(self) -> dict[str, tuple[LimitUse, ...]]:
        """Limits on approach and return, per segment; none without a home."""
        return {} if self.approach_and_return is None else self.approach_and_return.limits

    @property
    def samples(self) -> Samples:
        """The motion at the task's rate."""
        return self.trajectory.sampled(self.task.output.rate)

    @cached_property
    def between_samples(self) -> tuple[InterpolatedLimits, ...]:
        """Limits of joints and drives for lines, cubics and quintics through the samples of ``trajectory.csv``."""
        return between_samples(self)

    @property
    def ways(self) -> ApproachAndReturn | None:
        """``approach_and_return``, by its deprecated name."""
        warnings.warn("Design.ways is now Design.approach_and_return", DeprecationWarning, stacklevel=2)
        return self.approach_and_return

    @property
    def played(self) -> MotionSequence:
        """``sequence``, by its deprecated name."""
        warnings.warn("Design.played is now Design.sequence", DeprecationWarning, stacklevel=2)
        return self.sequence

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the design into a folder, which is created if it does not exist.

        Parameters
        ----------
        folder : path
        replace : bool
            Replace a design that is already there.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            The folder holds a design, or cannot be written to.
        """
        files: list[Path] = built_in("writer", "design")(self, folder, replace=replace)
        return files
