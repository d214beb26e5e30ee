"""Repeated identification of an experiment: estimates and half widths of their 99 % intervals."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from experiments import Experiment
from noise import NOISES

from excite.identification.estimation import estimate_parameters
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
    recipe : Recipe
    prepare : callable, optional
        Changes the log before it is identified, for example by leaving out what is near standstill.
    """

    name: str
    experiment: Experiment = field(default_factory=Experiment)
    noise: str = "white"
    level: float = 0.03
    encoder: float = 0.0
    recipe: Recipe = field(default_factory=Recipe)
    prepare: Callable[[Log], Log] | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """Estimates of k repetitions.

    Parameters
    ----------
    names : tuple of str
    truth : ndarray, shape (p,)
    values, half_widths, deviations : ndarray, shape (k, p)
    notes : tuple of str
        Of the last repetition.
    wall, cpu : float
        [s]
    """

    names: tuple[str, ...]
    truth: Array
    values: Array
    half_widths: Array
    deviations: Array
    notes: tuple[str, ...]
    wall: float
    cpu: float


def repeat(case: Case, count: int, seed: int) -> Outcome:
    """Identify ``count`` logs that differ in their noise alone, each by the whole chain."""
    experiment = case.experiment
    log = experiment.log
    began, cpu = time.monotonic(), time.process_time()
    values, halves, deviations, notes = [], [], [], ()
    for k in range(count):
        result = estimate_parameters(experiment.description, experiment.task, [noisy(log, case, seed, k)], case.recipe)
        e = result.estimate
        values.append(e.values)
        halves.append(e.half_width)
        deviations.append(e.deviation)
        notes = e.notes
    spent = time.monotonic() - began, time.process_time() - cpu
    return Outcome(
        result.names, experiment.truth, np.array(values), np.array(halves), np.array(deviations), notes, *spent
    )


def noisy(log: Log, case: Case, seed: int, k: int) -> Log:
    """The log with the noise of repetition k."""
    rng = np.random.default_rng([seed, k])
    channel = "effort" if log.wrench is None else "wrench"
    exact = getattr(log, channel)
    size = case.level * np.sqrt(np.mean(exact**2, axis=0))
    noise = NOISES[case.noise](rng, (1, *exact.shape), case.experiment.rate)[0]
    changes: dict[str, Any] = {channel: exact + size * noise}
    if case.encoder:
        phase = rng.uniform(size=log.q.shape[1])
        changes["q"] = case.encoder * (np.round(log.q / case.encoder + phase) - phase)
    measured = replace(log, sha256=f"{log.sha256} {seed} {k}", **changes)
    return measured if case.prepare is None else case.prepare(measured)
