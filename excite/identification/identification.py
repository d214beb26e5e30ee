"""An identification: the estimate, with the data and settings behind it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from excite.identification.between_logs import LogScatter
from excite.identification.choices.choice import Choice
from excite.identification.estimate import Estimate
from excite.identification.observations import Observations
from excite.identification.plausibility.doubt import Doubt
from excite.identification.plausibility.doubts import doubts_of, warnings_of
from excite.identification.prediction import instantaneous_target, prediction, relative_error
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.reference_values import ReferenceValues
from excite.identification.result import IdentificationResult
from excite.information.target import IdentificationTarget
from excite.registry import built_in
from excite.tasks.task import Task
from regressors.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array

if TYPE_CHECKING:
    from excite.identification.calibration import GainCalibration
    from excite.identification.friction_scale import FrictionScale


@dataclass(frozen=True, eq=False, repr=False)
class Identification(IdentificationResult):
    """An estimate, with the data and settings behind it.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
        Which model, of which joints.
    recipe : Recipe
        With the sign width that was used.
    target : IdentificationTarget
    prepared : tuple of PreparedLog
        One per log.
    observations : Observations
    estimate : Estimate
    condition_number : float
        cond(W) of the measured equations, left-to-right base columns, SI, unweighted.
    friction : FrictionCurves, optional
        Known friction of the moving drives, which was subtracted.
    friction_file : Path, optional
        File of the friction curves; None where they are the task's own.
    choices : tuple of Choice
        Settings that were chosen, with their candidates.
    reference : ReferenceValues, optional
        Values that the estimate is compared with.
    friction_scale : FrictionScale, optional
        Fitted factors of the known friction, with which it was subtracted.
    calibration : GainCalibration, optional
        Gains of the drives, from logs with a load of known mass.
    design_summary : mapping, optional
        Folder, hash and condition number of the design whose motion was played.
    provenance : mapping
        Versions and times.
    scatter : LogScatter, optional
        Of the estimates between several logs.
    each : bool
        Whether the estimates of each log are part of the result's file.
    folder : Path, optional
        Always None: the folder that a result is saved to is not kept in it.
    """

    robot: Robot
    task: Task
    recipe: Recipe
    target: IdentificationTarget
    prepared: tuple[PreparedLog, ...]
    observations: Observations
    estimate: Estimate
    condition_number: float
    friction: FrictionCurves | None = None
    friction_file: Path | None = None
    choices: tuple[Choice, ...] = ()
    reference: ReferenceValues | None = None
    friction_scale: FrictionScale | None = None
    calibration: GainCalibration | None = None
    design_summary: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    scatter: LogScatter | None = None
    each: bool = False
    folder: Path | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters."""
        return self.estimate.names

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the base parameters."""
        return self.estimate.units

    @property
    def coefficients(self) -> Array:
        """Values of the base parameters for predictions, shape (p,)."""
        return self.estimate.coefficients

    @property
    def training(self) -> frozenset[str]:
        """Hashes of the logs that it was identified from."""
        return frozenset(part.log.sha256 for part in self.prepared)

    @cached_property
    def training_error(self) -> float | None:
        """Relative error of the predictions on those logs, at every instant, unfiltered; None if it is not finite."""
        target = instantaneous_target(self.robot, self.task, self.recipe)
        if target.base.names != self.names:
            return None
        if self._of_all_instants:
            error = relative_error(self.observations.y, self.estimate.predicted(self.observations))
            return error if np.isfinite(error) else None
        squares = np.zeros(2)
        for part in self.prepared:  # one after the other, since those of a long log take much memory
            one = prediction(target, part, self.recipe, self.coefficients, self.friction)
            squares += np.linalg.norm(one.measured - one.predicted) ** 2, np.linalg.norm(one.measured) ** 2
        return float(np.sqrt(squares[0] / squares[1])) if squares[1] > 0 and np.isfinite(squares).all() else None

    @property
    def _of_all_instants(self) -> bool:
        """Whether the equations are those of every instant as recorded, so that they need not be computed again."""
        recipe, whole = self.recipe, self.target.model.window is None and self.friction is None
        if not whole or recipe.low_pass is not None or recipe.every is not None or recipe.average:
            return False
        return not any(part.left_out or part.standing or not _as_recorded(part) for part in self.prepared)

    @cached_property
    def doubts(self) -> tuple[Doubt, ...]:
        """Reasons why it cannot be right; empty if there are none."""
        return doubts_of(self)

    @cached_property
    def warnings(self) -> tuple[Doubt, ...]:
        """What the logs do not determine, with what would help; empty if there is nothing."""
        return warnings_of(self)

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the result into a folder, made if it does not exist.

        Parameters
        ----------
        folder : path
        replace : bool
            Replace a result that is already there.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            The folder holds a result, or cannot be written to.
        """
        files: list[Path] = built_in("writer", "result")(self, folder, replace=replace)
        return files


def _as_recorded(part: PreparedLog) -> bool:
    """Whether the instants of a motion are some of those recorded, without a gap."""
    first = int(np.searchsorted(part.log.time, part.samples.time[0]))
    return np.array_equal(part.log.time[first : first + part.samples.time.size], part.samples.time)
