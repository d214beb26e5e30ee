"""Weighted information matrix of a criterion: rows divided by noise, prior knowledge, scaled columns.

``M = T' (W' S^-1 W + P) T / N``: S the covariance of the noise, alike at all instants and independent from equation to
equation; P the inverse of the prior covariance, and the information of earlier experiments; T from the left-to-right
base to the chosen columns, each multiplied by the scale of its parameter: its unit, its prior deviation, its value, or
what a precision allows. The smallest eigenvalue of M then bounds the
largest relative deviation of any combination of parameters, and criteria take the accuracy of the measurements and of
the prior knowledge into account [PG93].

[PG93] C. Presse, M. Gautier, "New criteria of exciting trajectories for robot identification", ICRA 1993.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.information.earlier_precision import deviations_of, earlier_root
from excite.information.half_widths import allowed_half_widths, torque_precision
from excite.information.matrix import noise_per_row
from excite.information.prior import Prior, prior_of
from excite.information.target import IdentificationTarget
from excite.registry import name_of
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import few_states, random_states
from regressors.numerical import or_none
from regressors.samples import Array, Index, Samples

_SCALES = {"value": "values", "prior": "prior deviations", "precision": "allowed half-widths"}
_LITTLE = 1e-6  # of what is asked, added where a task motion does not show a parameter
_NO_SAY = 30.0  # by which columns of parameters that do not matter are longer than those that do


@dataclass(frozen=True, eq=False)
class Weighting:
    """Weighting of the rows of W in the information matrix of a criterion."""

    noise: Array  # (r,) divisor of the rows of each equation: their noise, or 1
    # (b, b) P in the columns of the left-to-right base; zero without prior knowledge and earlier experiments
    precision: Array
    transform: Array  # (b, b) T

    def rows(self, W: Array) -> Array:
        """Rows of W, of all equations at each instant in turn, divided by their noise."""
        return W / np.tile(self.noise, W.shape[0] // self.noise.size)[:, None]

    def matrix(self, W: Array) -> Array:
        """M of a stacked regressor in the left-to-right base, shape (b, b)."""
        weighted, N = self.rows(W), W.shape[0] // self.noise.size
        return np.asarray(self.transform.T @ (weighted.T @ weighted + self.precision) @ self.transform / N)


def weighting_of(target: IdentificationTarget, task: Task) -> Weighting:
    """Weighting that a task asks for."""
    objective = task.objective
    noise = noise_per_row(objective.noise if _by_noise(task) else (1.0,), target.model)
    T, in_hand = target.transforms[objective.base], earlier_root(target, task)
    precision = in_hand.T @ in_hand
    if objective.prior is None and objective.scale == "unit":
        return Weighting(noise, precision, T)
    if objective.scale == "precision":
        return Weighting(noise, precision, _precision_transform(target, task))
    prior = prior_of(target.model, target.base, objective.prior)
    precision = precision if objective.prior is None else precision + prior.precision
    return Weighting(noise, precision, T * _scale(target, task, prior, T))


def _by_noise(task: Task) -> bool:
    """Whether rows are divided by their noise: asked for, or weighed against what is known beforehand or allowed."""
    asked = task.objective
    return asked.weighted or asked.prior is not None or len(asked.after) > 0 or asked.scale == "precision"


def _scale(target: IdentificationTarget, task: Task, prior: Prior, T: Array) -> Array:
    if task.objective.scale == "unit":
        return np.ones(T.shape[1])
    by_value = task.objective.scale == "value"
    scale = np.abs(prior.base_values(T)) if by_value else prior.base_deviations(T)
    bad = np.flatnonzero(~(np.isfinite(scale) & (scale > 0.0)))
    if bad.size:
        what = "values are zero or not known" if by_value else "no prior deviation is known"
        names = ", ".join(target.model.names[k] for k in base_columns(target, task)[bad])
        raise InputError(f"scale {task.objective.scale}: {what} for {names}")
    return scale


def _precision_transform(target: IdentificationTarget, task: Task) -> Array:
    """Columns times allowed half-widths; or such that A-optimality adds what is asked of parameters and torques.

    With ``R'R = sum of G_i / a_i^2 + diag(1 / a_j^2)`` and ``T = R^-1``, ``tr((T' M T)^-1) = tr(M^-1 R'R)``.
    """
    precision = task.objective.precision
    assert isinstance(precision, PrecisionTarget)
    if precision.torques is None:
        return np.diag(_precision_scale(target, task, precision))
    wanted = torque_precision(precision.torques, target).information
    wanted = wanted + np.diag(allowed_half_widths(precision, target) ** -2.0)
    size = np.sqrt(np.diag(wanted) + _LITTLE * np.trace(wanted) / len(wanted) * (np.diag(wanted) == 0.0))
    scaled = wanted / np.outer(size, size) + _LITTLE * np.eye(len(wanted))
    return np.asarray(np.linalg.inv(np.linalg.cholesky(scaled).T * size))


def _precision_scale(target: IdentificationTarget, task: Task, precision: PrecisionTarget) -> Array:
    """Allowed half-widths; parameters of which nothing is asked get scales that leave them no say."""
    if task.objective.base != "gautier":
        raise InputError("scale precision: a precision is that of the base parameters; leave out `base`")
    allowed = allowed_half_widths(precision, target)
    free = ~np.isfinite(allowed)
    if not free.any():
        return allowed
    states = target.motion.states(random_states(target.robot, few_states(target.model)))
    length = np.linalg.norm(target.model.instants(states)[:, target.base.index], axis=0)
    typical = float(np.median((length * allowed)[~free]))
    return np.asarray(np.where(free, _NO_SAY * typical / np.where(length > 0, length, 1.0), allowed))


def base_columns(target: IdentificationTarget, task: Task) -> Index:
    """Numbers of the model's columns that the criterion's convention has, in its order, shape (b,)."""
    T, D = target.transforms[task.objective.base], target.base.D
    return np.array([int(np.argmin(np.linalg.norm(D - column[:, None], axis=0))) for column in T.T])


def minimised_text(task: Task) -> str:
    """What a task minimises, such as ``condition, base gautier, rows divided by their noise``."""
    objective = task.objective
    parts = [name_of(objective.criterion), f"base {objective.base}"]
    if objective.interest:
        parts.append(f"parameters of interest {' and '.join(objective.interest)}, the others as nuisance")
    if objective.task_motion is not None:
        parts.append(f"torques of {objective.task_motion}")
    if objective.servos is not None:
        parts.append(f"along the motion that the servos {objective.servos} make")
    if _by_noise(task):
        parts.append("rows divided by their noise")
    if isinstance(objective.prior, int | float):
        parts.append(f"the description's values known to {100 * objective.prior:g} %")
    elif objective.prior is not None:
        parts.append(f"{len(objective.prior)} parameters known beforehand")
    if objective.after:
        parts.append(f"after {', '.join(dict.fromkeys(map(str, objective.after)))}")
    if objective.scale != "unit":
        parts.append(f"columns times the {_SCALES[objective.scale]} of parameters")
    if objective.plausible_robots is not None:
        parts.append(f"worst of {objective.plausible_robots} plausible robots and the described one")
    return ", ".join(parts)


@dataclass(frozen=True)
class PriorAndPosterior:
    """One base parameter before and after the experiment.

    Parameters
    ----------
    name : str
    value : float or None
        Prior value; None if unknown.
    deviation : float or None
        Prior standard deviation; None if unknown.
    after : float
        Standard deviation of the estimate from measurements and prior knowledge together.
    """

    name: str
    value: float | None
    deviation: float | None
    after: float


def known_with(target: IdentificationTarget, task: Task, samples: Samples) -> tuple[PriorAndPosterior, ...]:
    """Before and after the experiment, ``sqrt(diag((W' S^-1 W + P)^-1))``, of each parameter."""
    if task.objective.prior is None and not task.objective.after:
        return ()
    prior, eye = prior_of(target.model, target.base, task.objective.prior), np.eye(target.base.rank)
    in_hand = earlier_root(target, task)
    known = in_hand if task.objective.prior is None else np.vstack([in_hand, prior.root])
    before = deviations_of(known) if len(in_hand) else prior.base_deviations(eye)
    values = prior.base_values(eye) if task.objective.prior is not None else np.full(target.base.rank, np.nan)
    W = weighting_of(target, task).rows(target.model.assemble(samples)[:, target.base.index])
    after = deviations_of(np.vstack([W, known]))
    return tuple(
        PriorAndPosterior(name, or_none(value), or_none(deviation), float(s))
        for name, value, deviation, s in zip(target.base.names, values, before, after, strict=True)
    )
