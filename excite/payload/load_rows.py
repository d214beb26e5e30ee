"""Equations of a load from logs with and without it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.identification.equations import equations_of
from excite.identification.identification import Identification, stated_covariance
from excite.identification.observations import Observations, join_observations
from excite.identification.preparation import PreparedLog, drives_of_torques, prepare
from excite.identification.procedure import LogLike, at_drives, estimate_parameters, load_rows, read_logs
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from excite.logs.mapping import LogMapping
from excite.payload.known_gains import DRIFT, KnownGains
from excite.payload.load_estimate import LoadEquations
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.robot.robot import Robot
from regressors.samples import Array

LIKELY_CAUSE = (
    "rows that hardly move, or numbers of very different sizes are the likely cause: check the units of the logs"
)
CHANGED = 0.2
"""Standard deviation of the change of each friction parameter from one log to the next, relative to the parameter."""
_KINDS = ("coulomb", "viscous", "root", "stribeck", "asymmetry")
_NOTHING = 1e-9  # N or Nm
_OFFSET, _OF_WRENCH = 0.005, 0.02  # of the root mean square: deviation of the change of an offset between the logs


def paired_equations(
    bare: Identification, loaded: Sequence[PreparedLog], recipe: Recipe, gains: KnownGains
) -> LoadEquations:
    """Equations of logs without and with the load, in torques of the drives and corrected gains."""
    parts = [*(replace(part, standing=()) for part in bare.prepared), *loaded]
    observations, load = _rows(bare.target, parts, len(bare.prepared), recipe)
    friction, size = _friction(bare.target.base, observations, load, bare.estimate.coefficients)
    drifts = _drifts(observations, load, bare.estimate.coefficients)
    corrected = replace(observations, y=observations.y * gains.factor[observations.equation])
    return LoadEquations(corrected, load, friction, size, gains.relative, drifts=drifts)


def modelled_equations(
    target: IdentificationTarget, logs: Sequence[PreparedLog], recipe: Recipe, gains: KnownGains, result: Identification
) -> LoadEquations:
    """Equations of logs with the load of a robot whose parameters are known, in torques as they were identified."""
    known, covariance = known_parameters(result)
    observations, load = _rows(target, logs, 0, recipe)
    friction, size = _friction(target.base, observations, load, known)
    drifts = _drifts(observations, load, known)
    load = load / gains.factor[observations.equation, None]
    return LoadEquations(
        observations, load, friction, size, gains.relative, known, covariance, drifts=drifts, scales_all=False
    )


def wrench_equations(
    target: IdentificationTarget, bare: Sequence[PreparedLog], loaded: Sequence[PreparedLog], recipe: Recipe
) -> LoadEquations:
    """Equations of a force/torque sensor: its offsets, what it carries without the load, and the load."""
    parts = [equations_of(target, part, recipe) for part in (*bare, *loaded)]
    observations = join_observations(parts)
    K = observations.matrix
    carries = observations.log >= len(bare)
    offsets = np.eye(len(observations.equations))[observations.equation]
    names = tuple(f"offset.{name}" for name, _ in observations.equations)
    units = tuple(unit for _, unit in observations.equations)
    W = np.hstack([K, offsets]) if bare else offsets
    if bare:
        names, units = (*observations.names, *names), (*observations.units, *units)
    observations = replace(observations, W=W, names=names, units=units)
    size = np.linalg.norm(_sizes(observations, carries).reshape(-1, 3), axis=1)  # of forces, and of torques
    changing = offsets * carries[:, None] * bool(bare), _OF_WRENCH * np.repeat(np.maximum(size, _NOTHING), 3)
    return LoadEquations(observations, K * carries[:, None], *changing, np.zeros((0, 0)))


def _rows(
    target: IdentificationTarget, parts: Sequence[PreparedLog], bare: int, recipe: Recipe
) -> tuple[Observations, Array]:
    """Rows of some logs, the first of them without the load, and its own, which are zero in those."""
    names, D = drives_of_torques(target.robot, each=True)
    observations = join_observations([at_drives(equations_of(target, part, recipe), D, names) for part in parts])
    load = [load_rows(part, target, recipe, D) * float(k >= bare) for k, part in enumerate(parts)]
    return observations, np.concatenate(load)


def _friction(base: Base, observations: Observations, load: Array, beta: Array) -> tuple[Array, Array]:
    """Columns of friction in the rows with the load, and how far their parameters may be from those without it."""
    own = [k for k, index in enumerate(base.index) if base.columns[int(index)].kind in _KINDS]
    size = CHANGED * np.abs(beta[own])
    kept = size > 0
    columns = observations.matrix[:, own][:, kept] * np.any(load, axis=1)[:, None]
    return columns, size[kept]


def _drifts(observations: Observations, load: Array, beta: Array) -> Array:
    """Changes of the rows with the load by one deviation of the drift of each gain, and of each offset, (m, 2 r)."""
    carries = np.any(load, axis=1)
    each = np.eye(len(observations.equations))[observations.equation] * carries[:, None]
    torque = (observations.matrix @ beta)[:, None]
    return np.hstack([DRIFT * torque * each, _OFFSET * _sizes(observations, carries) * each])


def _sizes(observations: Observations, rows: NDArray[np.bool_]) -> Array:
    """Root mean square of some rows of each equation, shape (r,)."""
    count = np.maximum(np.bincount(observations.equation[rows], minlength=len(observations.equations)), 1)
    return np.sqrt(np.bincount(observations.equation[rows], observations.y[rows] ** 2, count.size) / count)


_LOW_PASS = 15.0  # Hz
_FAST = 8.0  # times as many rows per second


@checked
@dataclass(frozen=True)
class LogChoice:
    """How the logs of a payload are read.

    Parameters
    ----------
    mapping : LogMapping or path, optional
        How foreign files are laid out.
    drop : tuple of str
        Faulty rows to leave out, see `excite.logs.log_reading.read_log`.
    rows, without_rows : str
        Rows of the logs with and without the load: ``auto``, ``all``, or ``FIRST:LAST``.
    cutoff : float, optional
        Of the low-pass of positions [Hz]; that of `low_pass` if not given.
    low_pass : float, optional
        Cutoff of a low-pass on both sides of the equations [Hz]; for logs of a high rate 15 Hz if not given, above
        which loads show nothing but noise.
    """

    mapping: LogMapping | str | Path | None = None
    drop: tuple[str, ...] = ()
    rows: str = "auto"
    without_rows: str = "auto"
    cutoff: float | None = None
    low_pass: float | None = None

    def recipe(self, logs: Sequence[Log], rows: str) -> Recipe:
        """Settings for some logs.

        Parameters
        ----------
        logs : sequence of Log
        rows : str
        """
        fast = min((log.rate for log in logs), default=0.0) >= _FAST * _LOW_PASS
        low_pass = _LOW_PASS if self.low_pass is None and fast else self.low_pass
        return Recipe(rows=rows, cutoff=low_pass if self.cutoff is None else self.cutoff, low_pass=low_pass)

    def read(self, given: LogLike | Sequence[LogLike], robot: Robot, rows: str, progress: Callable[[str], None]) -> Any:
        """The logs, with hashes."""
        only = Recipe(rows=rows).row_numbers
        return read_logs(given, robot, self.mapping, tuple(self.drop), progress, only)


def bare_task(robot: Robot, task: Task) -> Task:
    """The task of a robot's model, with friction that grows with the load where bodies are described."""
    robot.check_open("the identification of a payload")
    known = all(link.theta is not None for link in robot.bodies)
    return task.changed(joint_rotors=True, offset=True, load_share=known)


def without_load(
    robot: Robot, task: Task, logs: Sequence[Log], recipe: Recipe, progress: Callable[[str], None]
) -> Identification:
    """The robot's parameters from the logs without the load."""
    try:
        return estimate_parameters(robot, task, logs, recipe, progress=progress)
    except InputError:
        if task.model.load_share is False:
            raise
    return estimate_parameters(robot, task.changed(load_share=False), logs, recipe, progress=progress)


def loaded_parts(bare: Identification, logs: Sequence[Log], rows: str) -> list[PreparedLog]:
    """The logs with the load, for the model of those without."""
    recipe = replace(bare.recipe, rows=rows)
    return [replace(prepare(log, bare.robot, bare.target, recipe), standing=()) for log in logs]


def check_pair(without: Sequence[Log], loaded: Sequence[Log]) -> None:
    """Raise `InputError` where a log is given both with and without the load, or logs are of different robots."""
    if twice := {log.sha256 for log in without} & {log.sha256 for log in loaded}:
        names = ", ".join(log.source for log in loaded if log.sha256 in twice)
        raise InputError(f"{names}: the same log is given with and without the load")
    for log in loaded if without else ():
        if set(log.joints) != set(without[0].joints):
            raise InputError(
                f"the pair is of different robots: {log.source} has the joints {', '.join(log.joints)}, "
                f"{without[0].source} has {', '.join(without[0].joints)}"
            )


def size_of(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


_UNKNOWN = 1e3  # times its size, or one SI unit: deviation of a parameter that was not identified


def known_parameters(result: Identification) -> tuple[Array, Array]:
    """Base parameters of a result, and their covariance."""
    values = np.asarray(result.coefficients, dtype=float)
    stated = stated_covariance(result)
    if stated is None:
        raise InputError(f"{result.name} has no covariance of its parameters; identify the robot again")
    covariance = np.array(stated)
    unknown = ~np.isfinite(np.diag(covariance))
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    covariance[unknown, :] = covariance[:, unknown] = 0.0
    size = np.maximum(np.abs(values), 1.0)
    covariance[unknown, unknown] = (_UNKNOWN * size[unknown]) ** 2
    return values, covariance


def calibrated_gains(result: Identification) -> KnownGains | None:
    """Gains that a result was identified with, as factors on corrected torques, which are one; None where as stated."""
    known = result.calibration
    if known is None:
        return None
    relative = known.deviation / known.factor
    covariance = np.outer(relative, relative) if known.kind == "common" else np.diag(relative**2)
    drives = known.drives
    return KnownGains(drives, np.ones(len(drives)), covariance, "drive gains as calibrated with the robot's parameters")
