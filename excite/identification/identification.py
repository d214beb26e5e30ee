"""An identification: the estimate with the settings behind it, and what its logs say about it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.identification.allowances import FrictionScale
from excite.identification.between_logs import LogScatter, interval_scope, scatter_warning
from excite.identification.choices.left_out import Choice
from excite.identification.doubts import doubts_of, warnings_of
from excite.identification.drive_gains import GainCalibration
from excite.identification.estimator import Estimate
from excite.identification.large_residual import Doubt
from excite.identification.observations import Observations
from excite.identification.prediction import fit_error, instantaneous_target, prediction, with_measured_side
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.result import FitCurves, FitData, FitFacts, PlayedDesign, ReferenceValues, RepetitionSummary
from excite.identification.symmetry import Symmetry
from excite.information.target import IdentificationTarget
from excite.storage.codec import INLINE, OBJECT, named
from excite.storage.records import Saved, chosen, short
from excite.tasks.task import Task
from regressors.errors import InputError, percent
from regressors.numerical import or_none
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import Robot
from regressors.samples import Array

_INSTANTS = 3000  # of estimates over time, in a file


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Saved):
    """An estimate, with the data and settings behind it: the same when it is loaded, but for the logs.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
        Which model, of which joints.
    recipe : Recipe
        With the chosen `sign_width` or `breakaway`.
    estimate : Estimate
    condition_number : float
        cond(W) of the measured equations, left-to-right base columns, SI, unweighted.
    data : FitData, optional
        Logs and equations; None where the result was loaded.
    kept : FitFacts, optional
        What a file keeps of them; computed from them when it is asked for, see `facts`.
    friction : FrictionCurves, optional
        Known friction of the moving drives, which was subtracted.
    friction_file : Path, optional
        File of the friction curves; None where they are the task's own.
    friction_entry : mapping, optional
        File, hash and text of the friction curves in the file that the result was read from.
    choices : tuple of Choice
        Settings that were chosen, with their candidates.
    reference : ReferenceValues, optional
        Values that the estimate is compared with.
    friction_scale : FrictionScale, optional
        Fitted factors of the known friction, with which it was subtracted.
    calibration : GainCalibration, optional
        Gains of the drives, from logs with a load of known mass.
    design : PlayedDesign, optional
        The design whose motion was played.
    provenance : mapping
        Versions and times.
    scatter : LogScatter, optional
        Of the estimates between several logs.
    each : bool
        Whether the estimates of each log are shown.
    repetitions : RepetitionSummary, optional
        Of the experiment in simulation.
    symmetry : Symmetry, optional
        Whether limbs that are tied are equal.
    folder : Path, optional
        Where it was read from; None where it is new.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {
        "estimator": lambda r: r.estimate.method,
        "condition_number": lambda r: {
            "measured": or_none(r.condition_number),
            "designed": None if r.design is None else or_none(r.design.condition_number),
            "convention": "cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled",
        },
        "reference": lambda r: None if r.reference is None else r.reference.kind,
        "parameters": lambda r: r.parameters,
        "noise": lambda r: r.noise,
        "friction_mismatch": lambda r: None if r.estimate.mismatch is None else r.estimate.mismatch.tolist(),
        "friction_scale": lambda r: None if r.friction_scale is None else r.friction_scale.content(),
        "drive_gains": lambda r: None if r.calibration is None else r.calibration.content(),
        "interval_scope": lambda r: r.interval_scope,
        "between_logs": lambda r: r.between_logs,
    }

    robot: Robot
    task: Task = field(metadata=OBJECT)
    recipe: Recipe = field(metadata=OBJECT)
    estimate: Estimate = field(metadata=INLINE)
    condition_number: float = field(metadata=named("measured_condition_number"))
    data: FitData | None = field(default=None, metadata=OBJECT)
    kept: FitFacts | None = field(default=None, metadata=INLINE)
    friction: FrictionCurves | None = field(default=None, metadata=OBJECT)
    friction_file: Path | None = field(default=None, metadata=OBJECT)
    friction_entry: Mapping[str, Any] | None = field(default=None, metadata=OBJECT)
    choices: tuple[Choice, ...] = ()
    reference: ReferenceValues | None = field(default=None, metadata=named("reference_values"))
    friction_scale: FrictionScale | None = field(default=None, metadata=named("scale"))
    calibration: GainCalibration | None = None
    design: PlayedDesign | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    scatter: LogScatter | None = None
    each: bool = False
    repetitions: RepetitionSummary | None = None
    symmetry: Symmetry | None = None
    folder: Path | None = field(default=None, metadata=OBJECT)

    def __post_init__(self) -> None:
        """Check that there is something to say about the logs."""
        if self.data is None and self.kept is None:
            raise InputError("expected the logs of a result, or what is kept of them")

    @property
    def name(self) -> str:
        """Its folder, or the name of its robot."""
        return str(self.folder) if self.folder is not None else f"result for {self.robot.name}"

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

    @cached_property
    def target(self) -> IdentificationTarget:
        """Moving robot, model and base parameters; of a loaded result those of the model at single instants."""
        if self.data is not None:
            return self.data.target
        return instantaneous_target(self.robot, self.task, self.recipe)

    @cached_property
    def target_of_instants(self) -> IdentificationTarget:
        """The target with the model at single instants, also where the model integrates over windows."""
        if self.data is None or self.data.target.model.window is None:
            return self.target
        return instantaneous_target(self.robot, self.task, self.recipe)

    @property
    def prepared(self) -> tuple[PreparedLog, ...]:
        """The logs, ready for the model; a loaded result has none."""
        return self._of_logs().prepared

    @property
    def observations(self) -> Observations:
        """The equations; a loaded result has none."""
        return self._of_logs().observations

    def _of_logs(self) -> FitData:
        if self.data is None:
            raise InputError(f"{self.name} was loaded, and its file has no logs: identify again from them")
        return self.data

    @cached_property
    def facts(self) -> FitFacts:
        """What its logs and equations say about it."""
        return FitFacts.of(self) if self.kept is None else self.kept

    @cached_property
    def curves(self) -> FitCurves:
        """Both sides of its equations over time, and the motion; no rows where it was read without them."""
        if self.kept is not None:
            return self.kept.curves
        return FitCurves.of(self.observations, self.estimate.predicted(self.observations), self.prepared)

    @property
    def equations(self) -> tuple[tuple[str, str], ...]:
        """Names and units of its equations."""
        return self.observations.equations if self.kept is None else self.kept.equations

    @property
    def log_names(self) -> tuple[str, ...]:
        """Files of its logs."""
        return self.observations.logs if self.kept is None else tuple(log.file for log in self.kept.logs)

    @property
    def training(self) -> frozenset[str]:
        """Hashes of the logs that it was identified from."""
        if self.kept is not None:
            return frozenset(log.sha256 for log in self.kept.logs)
        return frozenset(part.log.sha256 for part in self.prepared)

    @cached_property
    def training_error(self) -> float | None:
        """Relative error of the predictions on those logs, at every instant, unfiltered; None if it is not finite."""
        if self.kept is not None:
            return self.kept.prediction_error
        target = self.target_of_instants
        if target.base.names != self.names:
            return None
        if self._of_all_instants:
            error = fit_error(self.observations, self.estimate)
            return error if np.isfinite(error) else None
        squares = np.zeros(2)
        for part in self.prepared:  # one after the other, since those of a long log take much memory
            one = prediction(target, part, self.recipe, self.coefficients, self.friction)
            judged = with_measured_side(target.model.row_labels, np.abs(one.measured).max(axis=0))
            left = (one.measured - one.predicted)[:, judged]
            squares += np.linalg.norm(left) ** 2, np.linalg.norm(one.measured) ** 2
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
        return doubts_of(self) if self.kept is None else self.kept.doubts

    @cached_property
    def warnings(self) -> tuple[Doubt, ...]:
        """What the logs do not determine, with what would help; empty if there is nothing."""
        return warnings_of(self) if self.kept is None else self.kept.warnings

    @property
    def interval_scope(self) -> str:
        """What the intervals hold for."""
        return interval_scope(len(self.training))

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """Each base parameter with its uncertainty, as plain values: null where it is not identified."""
        known = np.full(len(self.names), np.nan) if self.reference is None else self.reference.values
        return [_parameter(self, k, float(known[k])) for k in range(len(self.names))]

    @property
    def noise(self) -> dict[str, dict[str, float | None]]:
        """Standard deviation of the residuals by log and equation."""
        names, rows = [name for name, _ in self.equations], self.estimate.noise.tolist()
        known = zip(self.log_names, rows, strict=True)
        return {log: dict(zip(names, map(or_none, row), strict=True)) for log, row in known}

    @property
    def between_logs(self) -> dict[str, Any] | None:
        """Scatter of each parameter between several logs, as plain values."""
        if self.scatter is None:
            return None
        scatter, each = self.scatter, self.scatter.each
        parameters = [
            {
                "name": name,
                "unit": each.units[j],
                "logs": int(scatter.counts[j]),
                "ratio": or_none(math.sqrt(scatter.ratios[j])),
                "probability": or_none(scatter.probabilities[j]),
                **({"each": _each(scatter, j)} if self.each else {}),
            }
            for j, name in enumerate(each.names)
        ]
        return {
            "logs": list(each.logs),
            "convention": "ratio: scatter between logs over what the noise of each explains; Welch's test",
            "rms_ratio": or_none(scatter.rms),
            "exceeding": list(scatter.exceeding),
            "warning": scatter_warning(scatter),
            "parameters": parameters,
        }

    def __repr__(self) -> str:
        """One line."""
        error = "" if self.training_error is None else f", training error {percent(self.training_error, 3)}"
        return (
            f"<Identification of {self.robot.name}: {len(self.names)} parameters from {len(self.training)} "
            f"log(s){error}>"
        )

    def stored(self) -> Identification:
        """What a file keeps: the facts instead of the logs, and of the estimates over time a part."""
        history = self.estimate.history
        if history is not None:
            part = chosen(history[0].size, _INSTANTS)
            history = history[0][part], short(history[1][part])
        return replace(self, estimate=replace(self.estimate, history=history), kept=self.facts, data=None)

    def _written(self, place: Path, *, replace: bool) -> list[Path]:
        from excite.identification.result_json import save_result

        return save_result(self, place, replace=replace)


def _parameter(result: Identification, k: int, reference: float) -> dict[str, Any]:
    estimate, facts = result.estimate, result.facts
    name = estimate.names[k]
    value, deviation = float(estimate.values[k]), float(estimate.deviation[k])
    interval = estimate.interval[k].tolist()
    side, free = facts.motor_sides.get(name), estimate.unconstrained
    at_motor = side and {
        **vars(side),
        "value": or_none(value / side.factor),
        "standard_deviation": or_none(deviation / side.factor),
        "interval": [or_none(x / side.factor) for x in interval],
        "reference": or_none(reference / side.factor),
    }
    return {
        "name": name,
        "expression": facts.expressions[k],
        "unit": estimate.units[k],
        "value": or_none(value),
        "standard_deviation": or_none(deviation),
        "interval": [or_none(x) for x in interval],
        "relative_deviation": or_none(estimate.relative_deviation[k]),
        "seen": name not in estimate.unseen,
        "fit": float(estimate.coefficients[k]),
        **({} if free is None else {"unconstrained": float(free[k])}),
        "reference": or_none(reference),
        **({"motor_side": at_motor} if at_motor else {}),
    }


def _each(scatter: LogScatter, j: int) -> list[dict[str, Any]]:
    """The estimate of a parameter from each log alone."""
    each = scatter.each
    rows = zip(each.logs, each.values[:, j], each.deviations[:, j], strict=True)
    return [{"log": log, "value": or_none(x), "standard_deviation": or_none(s)} for log, x, s in rows]


def _as_recorded(part: PreparedLog) -> bool:
    """Whether the instants of a motion are some of those recorded, without a gap."""
    first = int(np.searchsorted(part.log.time, part.samples.time[0]))
    return np.array_equal(part.log.time[first : first + part.samples.time.size], part.samples.time)


def torque_target(result: Identification) -> IdentificationTarget:
    """Identification target of a result of a robot's bodies, with the model at single instants."""
    of_robot = result.task.model.bears_robot
    if result.task.model.channel == "wrench" and not of_robot:
        raise InputError(
            f"{result.name} is a result of a load, which has no robot to write: give its parameters (see result.json) "
            "as `payload` of a design or a simulation, or identify the robot from joint torques and export that result"
        )
    target = result.target_of_instants
    if target.motion.straight and target.model.torque_equations() is None and not of_robot:
        raise InputError(
            f"{result.name} is of a model whose equations are not joint torques, so it has no robot to write"
        )
    if target.base.names != result.names:
        raise InputError(
            f"{result.name} has the parameters {', '.join(result.names)}, but its model has "
            f"{', '.join(target.base.names)}; identify again"
        )
    names = {column.name for column in target.model.standard_columns}
    for number, body in zip(target.robot.body_numbers, target.robot.bodies, strict=True):
        if not names >= set(parameter_names(number)):
            raise InputError(f"{result.name}: its model has no inertial parameters of link {body.name!r} to write")
    return target


def stated_covariance(result: Identification) -> Array | None:
    """Covariance of the base parameters, shape (b, b), infinite where one is not identified; None where not stated."""
    C = result.estimate.covariance
    seen = np.isfinite(np.diag(C))
    return C if np.isfinite(C[np.ix_(seen, seen)]).all() else None


def unconstrained_estimate(result: Identification) -> Array:
    """Base parameters by the data alone, without bounds where the result has them, shape (b,)."""
    free = result.estimate.unconstrained
    return result.coefficients if free is None else free
