"""Servos identified from what was commanded and what was measured: known masses take the place of torques.

See `excite.identification.servo_fit` for the fit of their response to the measured positions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from excite.identification.procedure import LogLike, read_logs
from excite.identification.result import provenance_of
from excite.identification.servo_fit import ServoFit, fit_servos
from excite.identification.servo_result import ServoResult, motion_fits
from excite.identification.servo_windows import Places, servo_motion, windows_in
from excite.logs.log import Log
from excite.logs.mapping import LogMapping
from excite.tasks.installation import Installation
from excite.tasks.robot_of_task import robot_and_task
from regressors.arguments import checked
from regressors.errors import listed_names
from regressors.models.servo import ServoModel
from regressors.numerical import numerical_work, one_thread
from regressors.quantities import Tips
from regressors.robot.robot import Robot
from regressors.samples import Array


@checked
@numerical_work(
    "the identification of the servos",
    "commands and positions of very different sizes are the likely cause: check the units of the logs",
)
def identify_servos(
    robot: Robot | str,
    logs: LogLike | Sequence[LogLike],
    /,
    *,
    mapping: LogMapping | str | Path | None = None,
    drop: Iterable[str] = (),
    base_link: str | None = None,
    tip: Tips = None,
    snap_angles: bool = True,
    xacro: bool = False,
    installation: Installation | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> ServoResult:
    """Identify position-controlled servos from commanded and measured positions.

    Parameters
    ----------
    robot : Robot or str
        The arm, whose masses are known: they set the scale of all torques.
    logs : Log, frame, dict of columns, path, or a sequence of them
        With commanded positions.
    mapping : LogMapping or path, optional
        How foreign files are laid out.
    drop : iterable of str
        Faulty rows of files to leave out, see `excite.logs.log_reading.read_log`.
    base_link, tip, snap_angles, xacro, installation
        See `excite.identify`.
    progress : callable
        Called with a description of each step.

    Returns
    -------
    ServoResult

    Raises
    ------
    InputError
        Logs without commands, or too short; a robot whose masses are not known, or whose drives are coupled.
    """
    began, cpu = time.monotonic(), time.process_time()
    whole, _ = robot_and_task(robot, base_link, tip, installation, snap_angles, xacro)
    whole.check_open("the identification of servos")
    places = windows_in([servo_motion(log, whole) for log in read_logs(logs, whole, mapping, tuple(drop), progress)])
    with one_thread():
        fit = fit_servos(places, whole, progress)
    units = [unit for _, unit in ServoModel(whole).row_labels]
    spent = time.monotonic() - began, time.process_time() - cpu
    result = ServoResult(
        whole,
        fit.values,
        fit.half_width,
        motion_fits(_predicted(places, fit), units),
        tuple(motion.log.reference for motion in places.motions),
        len(places.first),
        ratio_half_width=fit.ratio_half_width,
        provenance=provenance_of(spent, mapping, tuple(drop), 0),
    )
    return replace(result, notes=_notes(result), doubts=_doubts(result))


def _predicted(places: Places, fit: ServoFit) -> list[tuple[Log, Array]]:
    """Each log with the positions that the servos have in the windows; NaN elsewhere."""
    paths = [np.full_like(motion.log.q, np.nan) for motion in places.motions]
    for k, rows, left in zip(places.log, places.rows, np.moveaxis(fit.residuals, 0, -1), strict=True):
        paths[k][rows] = places.motions[k].log.q[rows] + left
    return [(motion.log, path) for motion, path in zip(places.motions, paths, strict=True)]


def _notes(result: ServoResult) -> tuple[str, ...]:
    """Which servos are not shown at all, and whose torques have no scale."""
    names, unknown = np.array(result.robot.joint_names), np.isinf(result.half_width)
    no_motion, no_load = unknown.all(axis=1), unknown[:, 0] & ~unknown.all(axis=1)
    little = ~result.known.any(axis=1) & ~no_motion & ~no_load
    still, unloaded, hardly = (names[which].tolist() for which in (no_motion, no_load, little))
    notes = []
    if hardly:
        notes.append(
            f"{listed_names(hardly)}: of the servo at most ratios are known to half of their value; give logs in "
            "which gravity loads the joint differently, of slow and fast motions"
        )
    if still:
        notes.append(f"{listed_names(still)}: the joint hardly moves, so that nothing of its servo is shown")
    if unloaded:
        notes.append(
            f"{listed_names(unloaded)}: the known masses hardly load the joint, so that of stiffness, damping, "
            "inertia, friction and torque limit only the ratios are shown; give logs in which gravity "
            "loads it more, or hold a known mass in further logs and state it by `payload`"
        )
    return tuple(notes)


def _doubts(result: ServoResult) -> tuple[str, ...]:
    """Joints whose command with a delay predicts better."""
    worse = [fit for fit in result.fits if fit.moves and not fit.better]
    return tuple(
        f"{fit.joint}: the servo predicts the logs that it is identified from within {fit.position_error:.3g} "
        f"{fit.unit}, the command alone, {fit.delay:.3g} s late, within {fit.delayed_error:.3g} {fit.unit}"
        for fit in worse
    )
