"""What a result keeps of the logs and the equations that it was computed from."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from excite.design.design import Design
from excite.identification.covariance import noise_density
from excite.identification.large_residual import Doubt
from excite.identification.noise import GroupResidual, residual_diagnostics
from excite.identification.observations import Observations
from excite.identification.prediction import fit_error
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.event import Event
from excite.logs.log import Log
from excite.logs.mapping import LogMapping, read_mapping
from excite.storage.codec import named
from excite.storage.records import chosen, every, short
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.models.nominal import MotorSide, motor_sides, parameter_values, standard_values
from regressors.robot.columns import COULOMB, ROOT, STRIBECK, VISCOUS
from regressors.robot.symbolic.vectorised import evaluation
from regressors.samples import Array, Index, Samples

if TYPE_CHECKING:
    from excite.identification.identification import Identification


@dataclass(frozen=True)
class FitData:
    """Logs ready for a model, and their equations: what a result has while it is new, and no file holds."""

    target: IdentificationTarget
    prepared: tuple[PreparedLog, ...]  # one per log
    observations: Observations


@dataclass(frozen=True)
class IdentifiedLog:
    """A log of an identification."""

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"from": lambda log: log.start, "to": lambda log: log.end}

    file: str
    sha256: str
    rows: int  # that were recorded
    start: float  # first and last instant [s]
    end: float
    instants: int  # at which there is a motion, at a mean `rate` [Hz]
    rate: float
    notes: tuple[str, ...] = ()  # what was cut, repaired and assumed
    events: tuple[Event, ...] = ()
    left_out_share: float = 0.0  # of the instants, because of events

    @classmethod
    def of(cls, part: PreparedLog) -> IdentifiedLog:
        """The facts of a log that is ready for a model."""
        log, time = part.log, part.samples.time
        ends, rate = (float(log.time[0]), float(log.time[-1])), float((time.size - 1) / (time[-1] - time[0]))
        notes, events = tuple(part.notes), tuple(part.events)
        return cls(log.source, log.sha256, log.count, *ends, time.size, rate, notes, events, part.left_out_share)


@dataclass(frozen=True, eq=False)
class FitCurves:
    """Both sides of m equations over time, and the measured motion: what figures and the player draw."""

    # (m,) instant [s], log and equation of each row; none where the file of curves is gone
    time: Array = field(default_factory=lambda: np.zeros(0))
    log: Index = field(default_factory=lambda: np.zeros(0, dtype=int))  # (m,)
    equation: Index = field(default_factory=lambda: np.zeros(0, dtype=int))  # (m,)
    measured: Array = field(default_factory=lambda: np.zeros(0))  # (m,) [units of the equations]
    predicted: Array = field(default_factory=lambda: np.zeros(0))  # (m,)
    step: int = 1  # k where only the rows of every k-th instant are there
    joints: tuple[str, ...] = ()
    motion_time: Array = field(default_factory=lambda: np.zeros(0))  # (K,) instants of the motion [s], and their logs
    motion_log: Index = field(default_factory=lambda: np.zeros(0, dtype=int))  # (K,)
    motion_q: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (K, n) [rad or m]

    def __post_init__(self) -> None:
        """Check that the arrays fit each other."""
        if any(x.shape != self.time.shape for x in (self.log, self.equation, self.measured, self.predicted)):
            raise InputError("expected a log, an equation, a measured and a predicted value of every row")
        if self.motion_q.shape != (self.motion_time.size, len(self.joints)) or self.motion_log.ndim != 1:
            raise InputError("expected positions of every joint at every instant of the motion")
        if self.motion_log.shape != self.motion_time.shape:
            raise InputError("expected a log of every instant of the motion")

    @classmethod
    def of(cls, observations: Observations, predicted: Array, prepared: tuple[PreparedLog, ...]) -> FitCurves:
        """All equations, and as many instants of the motion as a player shows."""
        o = observations
        rows = (np.asarray(o.time), o.log, o.equation, o.y, predicted)
        if not prepared:
            return cls(*rows)
        kept = [(part.samples, chosen(part.samples.time.size)) for part in prepared]
        return cls(
            *rows,
            joints=tuple(prepared[0].log.joints),
            motion_time=np.concatenate([samples.time[index] for samples, index in kept]),
            motion_log=np.repeat(np.arange(len(kept)), [index.size for _, index in kept]),
            motion_q=np.concatenate([samples.q[index] for samples, index in kept]),
        )

    def stored(self) -> FitCurves:
        """What a file keeps: seven digits, and of long logs a part of their instants."""
        step = every(2 * self.time.size)
        new = np.ones(self.time.size, dtype=bool)
        new[1:] = (self.time[1:] != self.time[:-1]) | (self.log[1:] != self.log[:-1])
        kept = np.flatnonzero((np.cumsum(new) - 1) % step == 0)
        return replace(
            self,
            time=self.time[kept],
            log=self.log[kept].astype(np.int16),
            equation=self.equation[kept].astype(np.int16),
            measured=short(self.measured[kept]),
            predicted=short(self.predicted[kept]),
            step=self.step * step,
            motion_log=self.motion_log.astype(np.int16),
        )


@dataclass(frozen=True, eq=False)
class FitFacts:
    """What a result keeps of its logs and equations."""

    logs: tuple[IdentifiedLog, ...]
    equations: tuple[tuple[str, str], ...]  # names and units
    rows: int
    rank: int = field(metadata=named("base.rank"))  # of the columns of the base parameters
    columns: tuple[str, ...] = field(metadata=named("base.columns"))
    gap: float = field(metadata=named("base.gap"))
    expressions: tuple[str, ...] = field(metadata=named("base.expressions"))  # of each in standard parameters
    motor_sides: Mapping[str, MotorSide]  # rotor inertias behind base parameters, by the parameters' names
    relative_error: float  # of the equations
    # of the predictions on the logs, at every instant, unfiltered; None if it is not finite
    prediction_error: float | None
    residuals: tuple[GroupResidual, ...]
    noise_density: Mapping[str, float] | None  # of each equation; None where that of one is not known
    doubts: tuple[Doubt, ...] = ()  # why the result cannot be right, and what the logs do not determine
    warnings: tuple[Doubt, ...] = ()
    # of each drive over speed, such as ``F1c + F1v``, whose parts may make up for each other: half of the 99 % interval
    # of the whole over its size, both at the instants of the logs
    friction_of_drives: Mapping[str, float] = field(default_factory=dict)
    curves: FitCurves = field(default_factory=FitCurves)

    def __post_init__(self) -> None:
        """Check that the curves are of these logs and equations."""
        c, logs = self.curves, len(self.logs)
        if not _within(c.log, logs) or not _within(c.equation, len(self.equations)) or not _within(c.motion_log, logs):
            raise InputError(f"expected curves of {logs} log(s) and {len(self.equations)} equation(s)")

    @classmethod
    def of(cls, result: Identification) -> FitFacts:
        """The facts of a new result."""
        estimate, observations, base = result.estimate, result.observations, result.target.base
        density = noise_density(estimate, observations)
        names = [name for name, _ in observations.equations]
        return cls(
            logs=tuple(map(IdentifiedLog.of, result.prepared)),
            equations=observations.equations,
            rows=len(observations.y),
            rank=base.rank,
            columns=base.names,
            gap=base.gap,
            expressions=base.expressions,
            motor_sides=motor_sides(result.target.model, base),
            relative_error=fit_error(observations, estimate),
            prediction_error=result.training_error,
            residuals=residual_diagnostics(estimate, observations),
            noise_density=dict(zip(names, density.tolist(), strict=True)) if np.isfinite(density).all() else None,
            doubts=result.doubts,
            warnings=result.warnings,
            friction_of_drives=dict(_friction_of_drives(result)),
            curves=result.curves,
        )


WHOLE = " + "  # between the parts of a drive's friction
_OVER_SPEED = (COULOMB, VISCOUS, ROOT, STRIBECK)
_INSTANTS = 500


def _friction_of_drives(result: Identification) -> Iterator[tuple[str, float]]:
    estimate, target = result.estimate, result.target_of_instants
    columns = [target.base.columns[j] for j in target.base.index]
    motion = Samples.joined([part.samples for part in result.prepared])
    some = motion.rows(np.unique(np.linspace(0, motion.time.size - 1, _INSTANTS).astype(int)))
    Y = target.model.selected(some, target.base.index)
    for drive in dict.fromkeys(column.owner for column in columns if column.kind == COULOMB):
        parts = [k for k, column in enumerate(columns) if column.owner == drive and column.kind in _OVER_SPEED]
        rows, C = Y[:, parts], estimate.covariance[np.ix_(parts, parts)]
        size = np.sum((rows @ estimate.coefficients[parts]) ** 2)
        if size > 0 and np.isfinite(C).all():
            variance = max(0.0, np.sum((rows @ C) * rows))
            yield WHOLE.join(estimate.names[k] for k in parts), float(estimate.quantile * np.sqrt(variance / size))


def _within(numbers: Index, count: int) -> bool:
    return not numbers.size or (numbers.dtype.kind == "i" and numbers.min() >= 0 and numbers.max() < count)


@dataclass(frozen=True)
class PlayedDesign:
    """The design whose motion was played: its file and folder, the hash of the file, and cond(W) as designed."""

    file: str | None
    sha256: str | None
    folder: str | None
    condition_number: float


@dataclass(frozen=True)
class RepeatedParameter:
    """A parameter over repetitions in simulation, in its unit; `coverage` of the truth by its 99 % intervals."""

    name: str
    unit: str
    deviation: float
    predicted_deviation: float
    bias: float
    bias_error: float
    coverage: float


@dataclass(frozen=True)
class RepetitionSummary:
    """Statistics of repetitions of an identification in simulation."""

    count: int
    seed: int
    parameters: tuple[RepeatedParameter, ...]


_PACKAGES = ("excite-trajectories", "casadi", "clarabel", "numpy", "scipy")


def played_design(design: Design) -> PlayedDesign:
    """The design whose motion was played."""
    if design.folder is None:
        return PlayedDesign(None, None, None, design.condition_number)
    file = design.folder / "design.json"
    digest = sha256(read_bytes(file)).hexdigest()
    return PlayedDesign(str(file), digest, str(design.folder), design.condition_number)


def provenance_of(spent: tuple[float, float], mapping: object, drop: tuple[str, ...], seed: int) -> Mapping[str, Any]:
    """Date, seed, files, times [s] and versions."""
    wall, cpu = spent
    file = Path(mapping) if isinstance(mapping, str | Path) else None
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": seed,
        "mapping": None if file is None else {"file": str(file), "sha256": sha256(read_bytes(file)).hexdigest()},
        "drop": list(drop),
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "evaluation": evaluation(),
        "python": platform.python_version(),
        "versions": {package: version(package) for package in _PACKAGES},
    }


def check_played(design: Design | None, mapping: LogMapping | str | Path | None) -> None:
    """Refuse a design that is not the one that a log mapping names."""
    if design is None or mapping is None:
        return
    named = (read_mapping(mapping) if isinstance(mapping, str | Path) else mapping).design
    if named is not None and named not in (design.file_sha256, design.coefficients_sha256):
        raise InputError(
            f"the log mapping is of a recording of another design: it names the SHA-256 {named[:12]}..., and "
            f"{design.name} has {(design.file_sha256 or design.coefficients_sha256)[:12]}...; give the `design` "
            "that was played, or the mapping that was written with this one"
        )


@dataclass(frozen=True, eq=False)
class ReferenceValues:
    """Values that an estimate is compared with."""

    listed: ClassVar[bool] = True

    kind: str  # "truth" of a simulated log, or as in the robot's "description"
    values: Array  # (p,) NaN where unknown


def reference_of(target: IdentificationTarget, logs: Sequence[Log]) -> ReferenceValues:
    """True values of simulated logs, else those of the robot's description."""
    truths: list[Mapping[str, float]] = [log.truth for log in logs if log.truth]
    model, base = target.model, target.base
    if truths and len(truths) == len(logs) and all(truth == truths[0] for truth in truths):
        return ReferenceValues("truth", parameter_values(model, base, dict(truths[0])))
    return ReferenceValues("description", parameter_values(model, base, standard_values(target.robot)))
