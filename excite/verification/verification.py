"""Verification on a log that was not used to identify: predicted torques, simulated motion, and a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from excite.identification.preparation import PreparedLog
from excite.registry import built_in
from excite.simulation.replay import Replay
from excite.verification.corrected_error import CorrectedError
from excite.verification.predicted_torques import TorqueError
from excite.verification.simulated_motion import MotionError
from excite.verification.verdict import Tolerances, Verdict
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True, eq=False, repr=False)
class Verification:
    """Verification of a result on one log.

    Parameters
    ----------
    robot : Robot
        Of the result.
    tolerances : Tolerances
    prepared : PreparedLog
    equations : tuple of (str, str)
    time : ndarray, shape (N,)
        Instants at which the log has measurements [s].
    measured, predicted : ndarray, shape (N, r)
        At those instants; measured ones as recorded, not filtered [units of the equations].
    torques : tuple of TorqueError
    relative_error : float
        Over all equations.
    training_error : float or None
        The same on the logs that the result was identified from, where known.
    replay : Replay or None
        The simulated motion; None where the model has none.
    motions : tuple of MotionError, or None
        None where there is no motion, or where it failed.
    verdict : Verdict
    corrected : tuple of CorrectedError
        Errors without the noise of the measurement, of each equation.
    corrected_total : CorrectedError or None
        The same over all equations.
    event_free_error : float or None
        Relative error without the rows about what happened to the log, such as impacts and gaps.
    horizon : float or None
        Time after which the simulated motion restarts, shortened where an allowed error of the torques would reject any
        model; None where there is none [s].
    """

    robot: Robot
    tolerances: Tolerances
    prepared: PreparedLog
    equations: tuple[tuple[str, str], ...]
    time: Array
    measured: Array
    predicted: Array
    torques: tuple[TorqueError, ...]
    relative_error: float
    training_error: float | None
    replay: Replay | None
    motions: tuple[MotionError, ...] | None
    verdict: Verdict
    corrected: tuple[CorrectedError, ...] = ()
    corrected_total: CorrectedError | None = None
    event_free_error: float | None = None
    horizon: float | None = None

    @property
    def holds(self) -> bool:
        """True if the result predicts this log within the tolerances."""
        return self.verdict.holds

    def __repr__(self) -> str:
        """One line."""
        error = f"torques within {100 * self.relative_error:.3g} %"
        return f"<Verification on {self.prepared.log.source}: {error}, {'holds' if self.holds else 'does not hold'}>"

    def save(self, folder: str | Path, *, name: str | None = None) -> list[Path]:
        """Write the verification into a folder, made if it does not exist; one of the same name is replaced.

        Parameters
        ----------
        folder : path
        name : str, optional
            Of the file, without its ending; ``verification-LOG`` if not given.

        Returns
        -------
        list of Path
            Files that were written.
        """
        files: list[Path] = built_in("writer", "verification")(self, folder, name=name)
        return files
