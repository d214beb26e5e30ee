"""Verify servos on a log that they were not identified from: the response to its commands alone, and a verdict.

Each servo is simulated from the first row on, see `excite.simulation.servo_motion`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.identification.procedure import LogLike, log_of
from excite.identification.servo_result import MotionFit, ServoResult, load_servos, motion_fits
from excite.identification.servo_windows import ServoMotion, servo_motion
from excite.logs.log import LogReference
from excite.logs.mapping import LogMapping
from excite.simulation.servo_motion import followed
from excite.storage.records import Shown, every, short, write_beside
from regressors.arguments import checked
from regressors.errors import InputError, listed_names
from regressors.models.servo import ServoModel
from regressors.numerical import numerical_work
from regressors.robot.robot import Robot
from regressors.samples import Array

KIND = "servo-verification"
_GAP = 1.5  # median steps, from which on the simulation starts again as measured


@checked
@numerical_work("the verification of the servos", "a log of another robot or in other units is the likely cause")
def verify_servos(
    result: ServoResult | str | Path,
    log: LogLike,
    *,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    training_too: bool = False,
) -> ServoVerification:
    """Verify servos on a log.

    Parameters
    ----------
    result : ServoResult or path
        Just identified or loaded, or its folder.
    log : Log, frame, dict of columns or path
        With commanded positions.
    mapping : LogMapping or path, optional
        How a foreign file is laid out.
    drop : iterable of str
        Faulty rows of a file to leave out, see `excite.logs.log_reading.read_log`.
    training_too : bool
        Accept a log that the servos were identified from.

    Returns
    -------
    ServoVerification

    Raises
    ------
    InputError
        A log that the servos were identified from, or without commands.
    """
    result = load_servos(result) if isinstance(result, str | Path) else result
    log = log_of(log, result.robot, mapping, tuple(drop))
    if log.sha256 in result.training and not training_too:
        raise InputError(
            f"{log.source} is a log that the servos were identified from: it cannot show whether they hold elsewhere; "
            "take another one, or allow it with `training_too`"
        )
    motion = servo_motion(log, result.robot)
    predicted = predict_motion(result, motion)
    units = [unit for _, unit in ServoModel(result.robot).row_labels]
    return ServoVerification(
        result.robot,
        motion.log.reference,
        motion_fits([(motion.log, predicted)], units),
        motion.log.time,
        motion.command,
        motion.log.q,
        predicted,
    )


def predict_motion(result: ServoResult, motion: ServoMotion) -> Array:
    """Positions of all joints under the commands of a log, from its first row on, shape (N, n)."""
    time = motion.log.time
    cuts = np.flatnonzero(np.diff(time) > _GAP * np.median(np.diff(time))) + 1
    parts = [_predicted(result, motion, slice(*ends)) for ends in zip([0, *cuts], [*cuts, time.size], strict=True)]
    return np.concatenate(parts)


def _predicted(result: ServoResult, motion: ServoMotion, rows: slice) -> Array:
    time, command, q = motion.log.time[rows], motion.command[rows], motion.log.q[rows]
    if len(time) < 2:
        return q
    step = (time[-1] - time[0]) / (len(time) - 1)
    return followed(result, command, step, q[0], motion.samples.dq[rows][0])


@dataclass(frozen=True, eq=False, repr=False)
class ServoVerification(Shown):
    """Verdict on servos by the motion of a log; the same when it is loaded."""

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {
        "holds": lambda v: v.holds,
        "verdict": lambda v: v.verdict,
        "position_error": lambda v: {fit.joint: fit.position_error for fit in v.fits},
    }

    robot: Robot
    log: LogReference
    fits: tuple[MotionFit, ...]
    time: Array = field(default_factory=lambda: np.zeros(0))  # (N,) [s]
    command: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (N, n) [rad or m]
    measured: Array = field(default_factory=lambda: np.zeros((0, 0)))
    predicted: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def confirmed(self) -> tuple[str, ...]:
        """Joints whose motion the servos predict better than the command with the best delay."""
        return tuple(fit.joint for fit in self.fits if fit.moves and fit.better)

    @property
    def contradicted(self) -> tuple[str, ...]:
        """Joints whose motion the command with the best delay predicts better."""
        return tuple(fit.joint for fit in self.fits if fit.moves and not fit.better)

    @property
    def undecided(self) -> tuple[str, ...]:
        """Joints that hardly move."""
        return tuple(fit.joint for fit in self.fits if not fit.moves)

    @property
    def holds(self) -> bool:
        """Whether the motion of some joint confirms its servo, and that of none contradicts it."""
        return bool(self.confirmed) and not self.contradicted

    @property
    def verdict(self) -> str:
        """In a sentence."""
        if self.contradicted:
            return (
                f"Do not rely on the servo of {listed_names(self.contradicted)}: the command alone, with the best "
                "delay, predicts this motion better"
            )
        if not self.confirmed:
            return "Nothing is shown: no joint moves enough in this log"
        worst = max((fit for fit in self.fits if fit.moves), key=lambda fit: fit.position_error / fit.travel)
        return (
            f"The servos of {listed_names(self.confirmed)} predict this motion within {worst.position_error:.2g} "
            f"{worst.unit} ({worst.joint}) or better: you can rely on them for its kind"
        )

    def stored(self) -> ServoVerification:
        """What a file keeps: seven digits of the curves, and of long ones a part of their instants."""
        step = every(3 * self.measured.size)
        curves = {name: short(getattr(self, name)[::step]) for name in ("command", "measured", "predicted")}
        return ServoVerification(self.robot, self.log, self.fits, self.time[::step], **curves)

    def save(self, folder: str | Path, *, name: str | None = None) -> list[Path]:
        """Write the verification into a folder, made if it does not exist; one of the same name is replaced.

        Parameters
        ----------
        folder : path
        name : str, optional
            Of the file, without its ending; ``verification-LOG`` if not given.
        """
        stem = name if name is not None else f"verification-{Path(self.log.file).stem}"
        return write_beside(self, KIND, Path(folder), stem, [f"{stem}_motion"])

    def __repr__(self) -> str:
        """One line."""
        return f"<ServoVerification on {self.log.file}: {'holds' if self.holds else 'does not hold'}>"
