"""Repeated identification of an experiment: estimates and half widths of their 99 % intervals."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from experiments import Experiment
from noise import NOISES
from scipy.interpolate import CubicSpline

from excite.identification.identification import Identification
from excite.identification.identify import identify
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from regressors.samples import Array


@dataclass(frozen=True)
class Case:
    """A kind of experiment and of identification.

    Parameters
    ----------
    name : str
    experiment : Experiment
    noise : str
        Kind of the noise of torques or wrench, see `noise.NOISES`.
    level : float
        Its deviation over the root mean square of each channel.
    encoder : float
        Step of the positions [rad]; 0 for exact ones.
    positions : float
        Deviation of white noise of the positions [rad].
    offset : float
        Added to the second torque, or to every force of a wrench [Nm or N].
    late : float
        By which torques or wrench are late [s].
    recipe : Recipe
    plain : bool
        Identify with plain defaults beside the recipe, whose settings are chosen by left-out torques.
    """

    name: str
    experiment: Experiment = field(default_factory=Experiment)
    noise: str = "white"
    level: float = 0.03
    encoder: float = 0.0
    positions: float = 0.0
    offset: float = 0.0
    late: float = 0.0
    recipe: Recipe = field(default_factory=Recipe)
    plain: bool = False


@dataclass(frozen=True, eq=False)
class Outcome:
    """Estimates of k repetitions.

    Parameters
    ----------
    names : tuple of str
    truth : ndarray, shape (p,)
    values, half_widths, deviations : ndarray, shape (k, p)
    warned : ndarray of bool, shape (k, p)
        Whether a warning or a doubt names the parameter.
    notes : tuple of str
        Of the last repetition.
    added : tuple of bool
        Of every term that was added though the truth has it not, whether its interval contains zero.
    wall, cpu : float
        [s]
    """

    names: tuple[str, ...]
    truth: Array
    values: Array
    half_widths: Array
    deviations: Array
    warned: Array
    notes: tuple[str, ...]
    added: tuple[bool, ...]
    wall: float
    cpu: float


def repeat(case: Case, count: int, seed: int) -> Outcome:
    """Identify ``count`` logs that differ in their noise alone, each by the whole chain."""
    experiment = case.experiment
    log = experiment.log
    began, cpu = time.monotonic(), time.process_time()
    values, halves, deviations, warned, notes = [], [], [], [], ()
    added: list[bool] = []
    names = experiment.target.base.names
    for k in range(count):
        result = identified(case, noisy(log, case, seed, k))
        e = result.estimate
        error = e.values - experiment.truth_of(result.target)
        place = {name: j for j, name in enumerate(result.names)}
        kept = [place.get(name, -1) for name in names]  # terms that were added may take a parameter's place

        def of_truth(x: Array, kept: list[int] = kept) -> Array:
            return np.where(np.array(kept) < 0, np.nan, x[kept])

        values.append(of_truth(error) + experiment.truth)
        halves.append(of_truth(e.half_width))
        deviations.append(of_truth(e.deviation))
        said = " ".join(doubt.what for doubt in (*result.doubts, *result.warnings))
        warned.append([re.search(rf"\b{name}\b", said) is not None for name in names])
        added += [bool(abs(error[j]) <= e.half_width[j]) for name, j in place.items() if name not in names]
        notes = e.notes
    spent = time.monotonic() - began, time.process_time() - cpu
    estimates = np.array(values), np.array(halves), np.array(deviations), np.array(warned)
    return Outcome(names, experiment.truth, *estimates, notes, tuple(added), *spent)


def identified(case: Case, log: Log) -> Identification:
    """What one log gives: by the recipe of the case, or by plain defaults."""
    experiment = case.experiment
    if case.plain:
        return identify(experiment.task, log, recipe=case.recipe)
    return estimate_parameters(experiment.description, experiment.task, [log], case.recipe)


def noisy(log: Log, case: Case, seed: int, k: int) -> Log:
    """The log with the noise of repetition k."""
    rng = np.random.default_rng([seed, k])
    channel = "effort" if log.wrench is None else "wrench"
    exact = getattr(log, channel)
    size = case.level * np.sqrt(np.mean(exact**2, axis=0))
    noise = NOISES[case.noise](rng, (1, *exact.shape), case.experiment.rate)[0]
    if case.late:
        exact = CubicSpline(log.time, exact)(np.maximum(log.time - case.late, log.time[0]))
    offset = np.zeros(exact.shape[1])
    offset[slice(1, 2) if channel == "effort" else slice(0, 3)] = case.offset
    changes: dict[str, Any] = {channel: exact + offset + size * noise}
    if case.positions:
        changes["q"] = log.q + case.positions * rng.normal(size=log.q.shape)
    if case.encoder:
        phase = rng.uniform(size=log.q.shape[1])
        changes["q"] = case.encoder * (np.round(log.q / case.encoder + phase) - phase)
    return replace(log, sha256=f"{log.sha256} {seed} {k}", **changes)
