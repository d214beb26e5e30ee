"""Identified servos: the record, and how well a predicted motion fits beside what the bare command says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.logs.log import Log, LogReference
from excite.storage.records import Saved, read_record, write_record
from excite.storage.result_folder import check_not_taken
from excite.tasks.stored_files import TaskServos, UnopenedFile
from regressors.errors import InputError
from regressors.models.servo_response import QUANTITIES, RATIOS, SYMBOLS
from regressors.robot.robot import Robot
from regressors.samples import Array

KIND, SERVOS = "servos", "servos.json"
_KNOWN = 0.5  # half of an interval over the value, up to which it is called known
_DELAYS = np.arange(0.0, 0.3, 0.005)  # of a command [s]
LEAST_MOTION = 5.0  # encoder's steps


@dataclass(frozen=True)
class MotionFit:
    """Errors of a joint's predicted motion, root mean square, beside those of the command [rad or m]."""

    joint: str
    unit: str
    position_error: float  # of the simulated response
    command_error: float  # of the command itself
    delayed_error: float  # of the command with the best delay in hindsight
    delay: float  # that delay [s]
    step: float  # of the encoder
    travel: float  # largest less smallest measured position

    @property
    def moves(self) -> bool:
        """Whether the joint moves enough to judge its servo."""
        return self.travel > LEAST_MOTION * self.step

    @property
    def better(self) -> bool:
        """Whether the servo predicts better than its command with the best delay, or as well as the encoder can say."""
        return self.position_error <= max(self.delayed_error, self.step)


def encoder_step(q: Array) -> float:
    """Usual difference between two neighbouring values of a measured position [rad or m]."""
    steps = np.diff(np.unique(q))
    return float(np.median(steps)) if steps.size else 0.0


def motion_fits(predicted: Sequence[tuple[Log, Array]], units: Sequence[str]) -> tuple[MotionFit, ...]:
    """Errors of every joint over the rows of logs for which a position is predicted; NaN where none is."""
    behind, left, q = [], [], []
    for log, path in predicted:
        assert log.command is not None
        rows = np.flatnonzero(np.isfinite(path).all(axis=1))
        late = np.searchsorted(log.time, log.time[rows, None] - _DELAYS, side="right") - 1
        behind.append(log.command[np.maximum(late, 0)] - log.q[rows, None])
        left.append(path[rows] - log.q[rows])
        q.append(log.q[rows])
    of_command, error = (np.sqrt(np.mean(np.concatenate(each) ** 2, axis=0)) for each in (behind, left))
    fits = []
    for j, joint in enumerate(predicted[0][0].joints):
        best, measured = int(np.argmin(of_command[:, j])), np.concatenate(q)[:, j]
        alone, delayed = float(of_command[0, j]), float(of_command[best, j])
        step, travel = encoder_step(measured), float(np.ptp(measured))
        fits.append(MotionFit(joint, units[j], float(error[j]), alone, delayed, float(_DELAYS[best]), step, travel))
    return tuple(fits)


@dataclass(frozen=True, eq=False, repr=False)
class ServoResult(Saved):
    """Identified servos; the same when it is loaded.

    Parameters
    ----------
    robot : Robot
        The described arm, whose masses set the scale.
    values : ndarray, shape (n, p)
        Of each joint's servo, the quantities of `regressors.models.servo_response.QUANTITIES` [SI].
    half_width : ndarray, shape (n, p)
        Half of their 99 % intervals, from the scatter between windows.
    fits : tuple of MotionFit
        How well the windows are predicted that the servos were identified from.
    logs : tuple of LogReference
    windows : int
        How many there were of each joint.
    ratio_half_width : ndarray, shape (n, p)
        As `half_width`, of the ratios to the stiffness, which need no known mass; empty in files without them.
    notes, doubts : tuple of str
        What was assumed and found; why the result cannot be right.
    provenance : mapping
    """

    listed: ClassVar[bool] = True
    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"servos": lambda result: result.stated}

    robot: Robot
    values: Array
    half_width: Array
    fits: tuple[MotionFit, ...]
    logs: tuple[LogReference, ...]
    windows: int
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    ratio_half_width: Array = field(default_factory=lambda: np.zeros((0, 0)))
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ratios(self) -> tuple[Array, Array]:
        """What `RATIOS` names, over the stiffness, and halves of their 99 % intervals, each (n, r)."""
        half = self.ratio_half_width if self.ratio_half_width.size else np.full_like(self.values, np.inf)
        return self.values[:, RATIOS] / self.of("K")[:, None], half[:, RATIOS]

    @property
    def known_ratios(self) -> Any:
        """Which ratios the logs show, as `known`, shape (n, r)."""
        ratios, half = self.ratios
        return half <= _KNOWN * np.abs(ratios)

    @property
    def known(self) -> Any:
        """Which values the logs show: an interval of at most half the value to each side, shape (n, p)."""
        return self.half_width <= _KNOWN * np.abs(self.values)

    @property
    def training(self) -> frozenset[str]:
        """Hashes of the logs that the servos were identified from."""
        return frozenset(log.sha256 for log in self.logs)

    @property
    def stated(self) -> dict[str, Any]:
        """Every quantity by joint and name, with its unit, the half of its interval, and its ratio to the stiffness."""
        stated: dict[str, Any] = {
            joint.name: {
                q.name: {"value": value, "half_width": half, "unit": unit_of(q, joint.kind), "symbol": q.symbol}
                for q, value, half in zip(QUANTITIES, values.tolist(), halves.tolist(), strict=True)
            }
            for joint, values, halves in zip(self.robot.joints, self.values, self.half_width, strict=True)
        }
        for joint, *ratios in zip(self.robot.joints, *self.ratios, strict=True):
            for k, value, half in zip(RATIOS, *(each.tolist() for each in ratios), strict=True):
                unit = QUANTITIES[k].over_stiffness[joint.kind == "prismatic"]
                ratio = {"value": value, "half_width": half, "unit": unit}
                stated[joint.name][QUANTITIES[k].name]["over_stiffness"] = ratio
        return stated

    def of(self, symbol: str) -> Array:
        """One quantity of all servos, shape (n,)."""
        return np.asarray(self.values[:, SYMBOLS.index(symbol)])

    @property
    def torque_limit(self) -> Array:
        """L of all servos, shape (n,); infinite where the logs do not reach it."""
        L = self.of("L")
        return np.where(QUANTITIES[SYMBOLS.index("L")].most > L, L, np.inf)

    @property
    def speed_limit(self) -> Array:
        """At which damping takes all of the torque limit, ``L / D``, shape (n,); infinite where none is reached."""
        return np.asarray(self.torque_limit / np.maximum(self.of("D"), 1e-12))

    def _written(self, place: Path, *, replace: bool) -> list[Path]:
        check_not_taken(place, SERVOS, "servos", replace=replace)
        return write_record(self, KIND, place, KIND)

    def __repr__(self) -> str:
        """One line."""
        return f"<ServoResult of {self.robot.name}: {len(self.values)} servos from {len(self.logs)} logs>"


def unit_of(quantity: Any, kind: str) -> str:
    """Unit of a quantity of a joint of some kind."""
    return str(quantity.linear_unit if kind == "prismatic" else quantity.unit)


def load_servos(path: str | Path) -> ServoResult:
    """Load a ``servos.json``, or that of a folder."""
    place = Path(path)
    return read_record(place / SERVOS if place.is_dir() else place, ServoResult, KIND)


def task_servos(given: Any) -> TaskServos:
    """What a task holds of identified servos, or of those of a folder."""
    if isinstance(given, TaskServos):
        return given
    if isinstance(given, UnopenedFile):
        raise given.missing()
    result = load_servos(given) if isinstance(given, str | Path) else given
    if not isinstance(result, ServoResult):
        raise InputError(f"servos: expected identified servos, or their folder; given {type(given).__name__}")
    values = tuple(tuple(map(float, each)) for each in result.values)
    error = tuple(fit.position_error for fit in result.fits)
    return TaskServos(
        str(given) if isinstance(given, str | Path) else result.robot.name, result.robot.joint_names, values, error
    )
