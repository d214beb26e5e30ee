"""Accuracy that repeats of an experiment will show, predicted from a design and the conditions of measurement."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.design.design import Design
from excite.identification.allowances import DELAY, PRESLIDING
from excite.identification.choices.left_out import Choice
from excite.identification.estimator import Estimator
from excite.identification.identify import identify
from excite.identification.recipe import Recipe
from excite.registry import name_of
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate
from excite.storage.records import Shown, write_beside
from excite.study.rehearsal import (
    FREE,
    Rehearsal,
    StatedNoise,
    TorqueNoise,
    bounded_estimates,
    exact_settings,
    motion_errors,
    motion_settings,
    torque_errors,
)
from excite.tasks.further_settings import Extents
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.nominal import parameter_values
from regressors.numerical import numerical_work
from regressors.quantities import check
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array
from regressors.work_prediction import Steps

_OF_IDENTIFY = {field.name for field in fields(Recipe)} - {field.name for field in fields(SimulationSettings)}
_STEPS = 4  # of progress


@checked
@numerical_work("the prediction of the accuracy", "noise that is far larger than the torques is the likely cause")
def predict_accuracy(
    design: Design,
    settings: SimulationSettings | None = None,
    *,
    noise: TorqueNoise | None = None,
    friction: FrictionCurves | str | Path | None = None,
    recipe: Recipe | None = None,
    estimator: Estimator | str | None = None,
    choose: bool | Collection[str] = True,
    count: int = Extents.count,
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> AccuracyPrediction:
    """Predict the deviation and the bias that repeats of an experiment will show of each parameter.

    The experiment is simulated once and identified as its log will be: that gives the settings that the identification
    chooses, and the weights V of the equations ``y = W beta``. Errors then reach the parameters by
    ``(W' V W)^-1 W' V e`` with random samples of the errors e: noise of the torques of the stated level and colour
    through the filters of the equations; and measured motions, with their noise and encoder counts, through the filter
    and the derivatives of the identification. What repeats share is the bias: the estimate from exact sensors, less the
    truth, such as by friction that the model does not describe. Estimators with bounds get the sum of these errors.

    Parameters
    ----------
    design : Design
    settings : SimulationSettings, optional
        Noise, counts, sample rate, and what the controller and friction do; see `excite.simulate`.
    noise : TorqueNoise, optional
        Noise of the torques instead of that of the settings, such as `measured_noise` of an earlier result.
    friction : FrictionCurves or path, optional
        Friction of the simulated robot, where it is another than that of its description.
    recipe, estimator, choose
        How the log will be identified, see `excite.identify`.
    count : int
        Random samples; the deviations are known to ``1 / sqrt(2 count)``, 3.5 % for 400.
    progress : callable
        Called with a description of each step.
    **options
        By name, such as ``torque_noise=0.5``: fields of the settings, and of the recipe those that
        the settings do not have too, such as ``cutoff=10``.

    Returns
    -------
    AccuracyPrediction

    Raises
    ------
    InputError
        Invalid settings, a model or an estimator that is not supported, or conditions without any noise.
    """
    check("count", count)
    how = {name: options.pop(name) for name in list(options) if name in _OF_IDENTIFY}
    settings = replace(settings if settings is not None else SimulationSettings(), **options)
    white, coloured, corner = settings.torque_noise, settings.coloured_noise, settings.noise_corner
    stated = noise if noise is not None else StatedNoise(white, coloured, corner)
    _check_noise(stated, settings)
    recipe = recipe if recipe is not None else Recipe()
    progress("simulating the experiment once")
    simulation = simulate(design, settings, friction=friction)
    progress("identifying its log")
    result = identify(design.robot, simulation, design=design, recipe=recipe, estimator=estimator, choose=choose, **how)
    rehearsal = Rehearsal(simulation, result, _found(recipe, result.choices))
    seed = settings.seed

    def told(what: str) -> Steps:
        def tell(done: int, total: int) -> None:  # a few times
            if done == total or done % max(1, total // _STEPS) == 0:
                progress(f"{what}: {done} of {total} samples")

        return tell

    torques = torque_errors(result, stated, count, seed, rehearsal.found, told("noise of the torques"))
    motion = np.zeros_like(torques)
    if rehearsal.moves:
        motion = motion_errors(rehearsal, count, seed, told("noise of the motion"))
    parameters = _parameters(rehearsal, torques, motion, told("bounds"))
    return AccuracyPrediction(
        design.name,
        design.robot.name,
        str(name_of(result.task.model.model)),
        parameters,
        count,
        seed,
        settings.to_dict(),
        result.recipe.to_dict(),
        (*simulation.notes, *(f"{choice.name}: {choice.reason}" for choice in result.choices)),
        design.coefficients_sha256,
    )


def _check_noise(noise: TorqueNoise, settings: SimulationSettings) -> None:
    quiet = isinstance(noise, StatedNoise) and not any((*noise.white, *noise.coloured))
    if quiet and motion_settings(settings) == exact_settings(settings):
        raise InputError(
            "without noise repeats do not scatter; give `torque_noise`, `coloured_noise`, `encoder`, `position_noise` "
            "or `velocity_noise`"
        )


def _found(recipe: Recipe, choices: tuple[Choice, ...]) -> frozenset[str]:
    """Settings that every repeat finds again from its own log, so that they scatter too."""
    found = {choice.name for choice in choices} & {DELAY, PRESLIDING}
    if recipe.sign_width is None and not recipe.breakaway:
        found |= {PRESLIDING}
    return frozenset(found)


def _parameters(rehearsal: Rehearsal, torques: Array, motion: Array, progress: Steps) -> tuple[ParameterAccuracy, ...]:
    """What the errors by noise of the torques and of the motion, each of shape (k, p), make of each parameter."""
    result, exact = rehearsal.result, rehearsal.exact
    values = exact.solution.values[: exact.count]
    by_torques, by_motion = (np.std(errors, axis=0, ddof=1) for errors in (torques, motion))
    deviation, mean = np.hypot(by_torques, by_motion), values + motion.mean(axis=0)
    if result.estimate.method not in FREE:
        free = values + torques + motion
        bounded = bounded_estimates(result, exact, free, progress)
        deviation, mean = np.std(bounded, axis=0, ddof=1), mean + (bounded - free).mean(axis=0)
    # true parameters, NaN where the simulated robot has none, as of friction of another form
    truth = parameter_values(result.target.model, result.target.base, dict(rehearsal.simulation.truth))
    return tuple(
        ParameterAccuracy(name, unit, float(m), float(t), float(q), float(s), None if np.isnan(x) else float(m - x))
        for name, unit, m, t, q, s, x in zip(
            result.names, result.units, mean, by_torques, by_motion, deviation, truth, strict=True
        )
    )


KIND = "accuracy"


@dataclass(frozen=True)
class ParameterAccuracy:
    """Predicted accuracy of one parameter, in its unit."""

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"error": lambda parameter: parameter.error}

    name: str
    unit: str
    value: float  # what repeats show on average
    by_torques: float  # standard deviation by noise of the torques
    by_motion: float  # root mean square error by noise and steps of the measured motion, about its mean
    deviation: float  # standard deviation of repeats, by both
    # error that all repeats share, such as by friction that the model does not describe; None where the simulated robot
    # has no such parameter
    bias: float | None

    @property
    def error(self) -> float:
        """Root mean square error, of deviation and bias together."""
        return float(np.hypot(self.deviation, self.bias or 0.0))


@dataclass(frozen=True)
class AccuracyPrediction(Shown):
    """Predicted accuracy of every parameter in repeats of one experiment.

    Parameters
    ----------
    name : str
        Of the design.
    robot, model : str
    parameters : tuple of ParameterAccuracy
    count : int
        Random samples that the deviations are computed from.
    seed : int
    conditions : mapping
        Stated noise and whatever else was simulated, as plain values.
    identification : mapping
        Settings of the identification, as plain values.
    notes : tuple of str
        What was chosen and assumed.
    design_sha256 : str
        Hash of the motion's coefficients.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"precision": lambda prediction: prediction.precision}

    name: str
    robot: str
    model: str
    parameters: tuple[ParameterAccuracy, ...]
    count: int
    seed: int
    conditions: Mapping[str, Any] = field(default_factory=dict)
    identification: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    design_sha256: str = ""

    @property
    def precision(self) -> float:
        """Relative standard deviation of the predicted deviations themselves, ``1 / sqrt(2 (count - 1))``."""
        return float(1 / np.sqrt(2 * (self.count - 1)))

    def __repr__(self) -> str:
        """One-line summary."""
        return f"<AccuracyPrediction of {len(self.parameters)} parameters of {self.robot}, to {self.precision:.1%}>"

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``accuracy.json`` into a folder, created if it does not exist; an older one is replaced.

        Parameters
        ----------
        folder : path

        Raises
        ------
        InputError
            The folder cannot be written to, or holds a file of the name that is no such prediction.
        """
        return write_beside(self, KIND, Path(folder), KIND)
