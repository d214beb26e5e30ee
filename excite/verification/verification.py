"""Verification on a log that was not used to identify: predicted torques, simulated motion, and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.identification.preparation import PreparedLog
from excite.logs.event import Spans
from excite.simulation.replay import Replay
from excite.storage.codec import INLINE
from excite.storage.records import Shown, chosen, every, short, write_beside
from excite.tasks.further_settings import Tolerances
from excite.verification.simulated_motion import MotionError
from excite.verification.verdict import CorrectedError, TorqueError, Verdict
from regressors.errors import InputError, percent
from regressors.robot.robot import Robot
from regressors.samples import Array

KIND = "verification"
FIGURES = ("torques", "motion")
_REPLAYED = 60_000  # simulated and measured positions in a file; the figure shows their differences, not their rms


@dataclass(frozen=True)
class VerifiedLog:
    """The log of a verification."""

    file: str
    sha256: str
    rows: int
    start: float  # first instant that is used [s]
    end: float  # last one
    notes: tuple[str, ...] = ()  # what was cut, repaired and assumed
    left_out: Spans = ()  # first and last instant of the stretches that make no equations [s]

    @classmethod
    def of(cls, part: PreparedLog) -> VerifiedLog:
        """The facts of a log that is ready for a model."""
        log = part.log
        start, end = float(log.time[0]), float(log.time[-1])
        return cls(log.source, log.sha256, log.count, start, end, tuple(part.notes), tuple(part.left_out))


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Measured positions of the n moving joints."""

    joints: tuple[str, ...] = ()
    time: Array = field(default_factory=lambda: np.zeros(0))  # (K,) [s]; where a motion is simulated, its instants
    q: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (K, n) [rad or m]


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Shown):
    """Verification of a result on one log: the same when it is loaded, at the instants that its file has.

    Parameters
    ----------
    robot : Robot or None
        Of the result; None in a file of an older version whose result is gone.
    log : VerifiedLog
    tolerances : Tolerances
    verdict : Verdict
    relative_error : float
        Over all equations.
    training_error : float or None
        The same on the logs that the result was identified from, where known.
    torques : tuple of TorqueError, length r
    motions : tuple of MotionError, or None
        None where there is no motion, or where it failed.
    corrected : tuple of CorrectedError
        Errors without the noise of the measurement, of each equation.
    corrected_total : CorrectedError or None
        The same over all equations.
    event_free_error : float or None
        Relative error without the rows about what happened to the log, such as impacts and gaps.
    horizon : float or None
        Time after which the simulated motion restarts, shortened where an allowed error of the torques would reject any
        model; None where there is none [s].
    time : ndarray, shape (N,)
        Instants at which the log has measurements [s]; none where the file of curves is gone.
    measured, predicted : ndarray, shape (N, r)
        At those instants; measured ones as recorded, not filtered [units of the equations].
    motion : MeasuredMotion
    replay : Replay or None
        The simulated motion, at the instants of `motion`; None where the model has none.
    step : int
        k where a file has only every k-th instant of `time`; the errors are of all of them.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {
        "holds": lambda v: v.holds,
        "verdict": lambda v: v.verdict.text,
        "corrected_error": lambda v: None if v.corrected_total is None else v.corrected_total.relative,
        "windows": lambda v: v.windows,
        "limited_by": lambda v: {torque.name: torque.limited_by for torque in v.torques},
    }

    robot: Robot | None
    log: VerifiedLog
    tolerances: Tolerances
    verdict: Verdict = field(metadata=INLINE)
    relative_error: float
    training_error: float | None
    torques: tuple[TorqueError, ...]
    motions: tuple[MotionError, ...] | None
    corrected: tuple[CorrectedError, ...] = ()
    corrected_total: CorrectedError | None = None
    event_free_error: float | None = None
    horizon: float | None = None
    time: Array = field(default_factory=lambda: np.zeros(0))
    measured: Array = field(default_factory=lambda: np.zeros((0, 0)))
    predicted: Array = field(default_factory=lambda: np.zeros((0, 0)))
    motion: MeasuredMotion = field(default_factory=MeasuredMotion)
    replay: Replay | None = None
    step: int = 1

    def __post_init__(self) -> None:
        """Check that the curves fit each other and the equations."""
        shape = (len(self.time), len(self.torques))
        if len(self.time) and not self.measured.shape == self.predicted.shape == shape:
            raise InputError(f"expected measured and predicted torques of {shape[1]} equations at {shape[0]} instants")
        if self.motion.q.shape != (len(self.motion.time), len(self.motion.joints)):
            raise InputError("expected positions of every joint at every instant of the motion")
        if self.replay is not None and self.replay.q.shape != self.motion.q.shape:
            raise InputError("expected a simulated position for every measured one")

    @property
    def holds(self) -> bool:
        """True if the result predicts this log within the tolerances."""
        return self.verdict.holds

    @property
    def equations(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of each equation."""
        return tuple((torque.name, torque.unit) for torque in self.torques)

    @property
    def windows(self) -> dict[str, int] | None:
        """How many windows of the motion there are, and of how many it was simulated."""
        if self.replay is None:
            return None
        count = len(self.replay.starts)
        return {"simulated": count, "of": count + self.replay.left_out}

    def __repr__(self) -> str:
        """One line."""
        error = f"torques within {percent(self.relative_error, 3)}"
        return f"<Verification on {self.log.file}: {error}, {'holds' if self.holds else 'does not hold'}>"

    def stored(self) -> Verification:
        """What a file keeps: seven digits of the curves, and of long ones a part of their instants."""
        step = every(2 * self.measured.size)
        kept = self._kept_instants()
        motion, replay = self.motion, self.replay
        if replay is not None:
            replay = replace(
                replay,
                time=replay.time[kept],
                q=short(replay.q[kept]),
                dq=short(replay.dq[kept]),
                starts=tuple(np.searchsorted(kept, [first for first, _ in replay.bounds]).tolist()),
                stops=tuple((np.searchsorted(kept, [stop - 1 for _, stop in replay.bounds]) + 1).tolist()),
            )
        return replace(
            self,
            time=self.time[::step],
            measured=short(self.measured[::step]),
            predicted=short(self.predicted[::step]),
            motion=replace(motion, time=motion.time[kept], q=short(motion.q[kept])),
            replay=replay,
            step=self.step * step,
        )

    def _kept_instants(self) -> Any:
        """Indices of the motion: of a simulated one, the first and last of every window are among them."""
        if self.replay is None:
            return chosen(self.motion.time.size)
        bounds = np.array(self.replay.bounds)
        step = every(2 * self.replay.q.size, _REPLAYED)
        return np.unique(np.concatenate([np.arange(0, self.replay.time.size, step), bounds[:, 0], bounds[:, 1] - 1]))

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

        Raises
        ------
        InputError
            The folder is being written by another process, or cannot be written to; or a file of the name is there
            that is not a verification.
        """
        stem = name if name is not None else f"verification-{Path(self.log.file).stem}"
        return write_beside(self, KIND, Path(folder), stem, [f"{stem}_{part}" for part in FIGURES])
