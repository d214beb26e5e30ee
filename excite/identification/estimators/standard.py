"""Least squares over the standard parameters of every body: what base parameters consist of, and what is possible.

The base parameters are ``beta = A theta``. Of the many theta that give the same beta, some or none are physically
possible: each body's pseudo-inertia must be positive definite, rotor inertias and friction positive [Wensing, Kim,
Slotine 2018].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from excite.identification.estimators.least_squares import GroupWeights
from excite.identification.observations import Observations
from regressors.errors import InputError, UnknownName
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.models.nominal import standard_values
from regressors.robot.columns import BODY_KINDS, COULOMB, ROTOR, VISCOUS
from regressors.robot.inertia import PARAMETERS_PER_LINK, from_pseudo_inertia, pseudo_inertia
from regressors.samples import Array, Index

WEAK = 1e-6  # information per squared scale that determines what the data does not, for rows of unit noise
_MASS, _LENGTH = 1.0, 0.1  # of a body without known parameters
_POSITIVE = (ROTOR, COULOMB, VISCOUS)
_ROTOR = 1e-4
_EXACT = 1e-8  # of the length of a group's y: noise below it counts as that
_EXACT_NOTE = "the data has hardly any noise: possible bodies fit it to about 1e-8 of its size, not to its noise"


@dataclass(frozen=True)
class Quadratic:
    """Prior knowledge of single parameters: adds ``sum ((theta_k - value_k) / deviation_k)^2 / 2``."""

    values: Mapping[str, float]  # standard parameters and their prior standard deviations, for the same names
    deviations: Mapping[str, float]

    def __post_init__(self) -> None:
        for name in {*self.values} ^ {*self.deviations}:
            raise InputError(f"pull: {name} must have a value and a deviation, given one of them")
        for name, deviation in self.deviations.items():
            if not deviation > 0:
                raise InputError(f"pull: the deviation of {name} must be greater than zero, given {deviation}")


@dataclass(frozen=True)
class Entropic:
    """Prior knowledge of whole bodies: adds ``weight * sum_i d(J_i || J0_i)`` [Lee, Wensing, Park 2020].

    ``d(J || J0) = tr(J0^-1 J) - log det(J0^-1 J) - 4`` depends neither on units nor on the frame.
    """

    values: Mapping[str, float]  # standard parameters; a body is pulled if all ten of its parameters are given
    weight: float  # in units of half a squared standard deviation of the noise

    def __post_init__(self) -> None:
        if not self.weight > 0:
            raise InputError(f"pull: the weight must be greater than zero, given {self.weight}")


Pull = Quadratic | Entropic


@dataclass(frozen=True, eq=False)
class Body:
    """Ten of the standard parameters that belong to one rigid body."""

    name: str
    index: Index  # (10,)
    reference: Array  # (4, 4) A possible pseudo-inertia of its size


@dataclass(frozen=True, eq=False)
class StandardProblem:
    """``min ||G theta - r||^2 / 2 + ||(theta - prior) / deviation||^2 / 2`` over possible standard parameters."""

    names: tuple[str, ...]
    A: Array  # (b, t) ``beta = A theta``
    G: Array  # (k, t) ``R A`` with the triangular factor R of the rows divided by their noise
    r: Array  # (k,)
    S: Array  # (t, f) ``theta = S phi``: the robot's structure, zeros and equal parameters
    bodies: tuple[Body, ...]
    positive: Index  # rotor inertias and friction coefficients
    scale: Array  # (t,) typical size of each parameter
    prior: Array  # (t,)
    deviation: Array = field(repr=False)  # (t,)

    def objective(self, theta: Array) -> float:
        """Value of the objective for given standard parameters."""
        misfit = float(np.sum((self.G @ theta - self.r) ** 2))
        return (misfit + float(np.sum(((theta - self.prior) / self.deviation) ** 2))) / 2

    def margins(self, theta: Array) -> Array:
        """Smallest eigenvalue of each body's pseudo-inertia, shape (bodies,) [of kg m^2 and kg together]."""
        return np.array([float(np.linalg.eigvalsh(pseudo_inertia(theta[body.index]))[0]) for body in self.bodies])


def standard_problem(
    observations: Observations,
    problem: GroupWeights,
    model: RegressorModel,
    base: Base,
    pull: Quadratic | None = None,
    reference: Mapping[str, float] | None = None,
) -> StandardProblem:
    """Set up the problem for observations in a model's base columns."""
    if observations.names != base.names:
        raise InputError(
            f"observations have the parameters {', '.join(observations.names)}, "
            f"the base of the model has {', '.join(base.names)}"
        )
    p, exact = base.rank, _exact(problem)
    R = problem.factors.stacked(np.maximum(problem.scale, _exact_scale(problem))) if np.any(exact) else problem.R
    return problem_of_factor(R[:p, :p], R[:p, p], model, base, pull, reference)


def exact_torques(problem: GroupWeights) -> tuple[str, ...]:
    """A note where rows have less noise than the numbers of the conic solver."""
    return (_EXACT_NOTE,) if np.any(_exact(problem)) else ()


def _exact(problem: GroupWeights) -> NDArray[np.bool_]:
    return np.asarray(problem.scale < _exact_scale(problem))


def _exact_scale(problem: GroupWeights) -> Array:
    """Least divisor of each group's rows, whose weights are then within the solver's range, shape (groups,)."""
    return _EXACT * problem.factors.sizes() * np.sqrt(problem.factors.count)


def problem_of_factor(
    R: Array,
    r: Array,
    model: RegressorModel,
    base: Base,
    pull: Quadratic | None = None,
    reference: Mapping[str, float] | None = None,
) -> StandardProblem:
    """Set up the problem for a triangular factor of a model's base columns, ``min ||R A theta - r||``."""
    # R (k, b); r (k,)
    definition, names = model.definition()
    A = np.asarray(base.D @ definition)
    known = standard_values(model.robot) if reference is None else reference
    bodies, prior, scale = _bodies(model, known)
    if (torque := float(np.linalg.norm(R @ A @ prior))) > 0 and np.any(r):
        bodies, prior, scale = _bodies(model, known, float(np.linalg.norm(r)) / torque)
    deviation = scale / np.sqrt(WEAK)
    for name in pull.values if pull is not None else ():
        if name not in names:
            raise UnknownName("standard parameter", name, names)
        assert pull is not None
        k = names.index(name)
        prior[k], deviation[k] = pull.values[name], pull.deviations[name]
    positive = np.array([k for k, c in enumerate(model.standard_columns) if c.kind in _POSITIVE], dtype=np.intp)
    S = _structure(model, names)
    return StandardProblem(names, A, R @ A, r, S, bodies, positive, scale, prior, deviation)


def _structure(model: RegressorModel, names: tuple[str, ...]) -> Array:
    """Matrix of ``theta = S phi``, one column per parameter that is free."""
    structure = model.robot.structure
    leader = {name: group[0] for group in structure.equal for name in group[1:]}
    free = [name for name in names if name not in structure.zero and name not in leader]
    S = np.zeros((len(names), len(free)))
    for row, name in enumerate(names):
        target = leader.get(name, name)
        if target in free:
            S[row, free.index(target)] = 1.0
    return S


def _bodies(
    model: RegressorModel, known: Mapping[str, float], size: float = 1.0
) -> tuple[tuple[Body, ...], Array, Array]:
    """Bodies, reference values and sizes of all parameters; unknown ones for torques of about a size."""
    columns = model.standard_columns
    reference = np.array([known.get(c.name, size * _ROTOR if c.kind == ROTOR else 0.0) for c in columns])
    scale = np.where(reference != 0.0, np.abs(reference), size)
    labels = {
        number: f"link {body.name}" for number, body in zip(model.robot.body_numbers, model.robot.bodies, strict=True)
    }
    bodies = []
    for owner in dict.fromkeys(c.owner for c in columns if c.kind in BODY_KINDS):
        ten = [k for k, c in enumerate(columns) if c.kind in BODY_KINDS and c.owner == owner]
        if len(ten) != PARAMETERS_PER_LINK:
            continue
        index = np.array(ten, dtype=np.intp)
        J = possible_inertia(known, [columns[k].name for k in ten], size)
        bodies.append(Body("load" if owner is None else labels[owner], index, J))
        reference[index] = from_pseudo_inertia(J)
        scale[index] = _sizes(J)
    return tuple(bodies), reference, scale


def near_described(model: RegressorModel, described: Mapping[str, float], within: float) -> Quadratic:
    """Pull of every body that is described towards its description."""
    values: dict[str, float] = {}
    deviations: dict[str, float] = {}
    columns = model.standard_columns
    for owner in dict.fromkeys(c.owner for c in columns if c.kind in BODY_KINDS):
        names = [c.name for c in columns if c.kind in BODY_KINDS and c.owner == owner]
        if len(names) != PARAMETERS_PER_LINK or not is_possible(
            J := pseudo_inertia([described.get(n, np.nan) for n in names])
        ):
            continue
        values.update((name, described[name]) for name in names)
        deviations.update(zip(names, (within * _sizes(J)).tolist(), strict=True))
    return Quadratic(values, deviations)


def _sizes(J: Array) -> Array:
    """Typical size of each of a body's ten parameters, shape (10,)."""
    mass, length = J[3, 3], np.sqrt(np.trace(J[:3, :3]) / J[3, 3])
    return np.asarray(mass * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2]))


def is_possible(J: Array) -> bool:
    """True if a pseudo-inertia is known and positive definite."""
    return bool(np.all(np.isfinite(J)) and np.linalg.eigvalsh(J)[0] > 0)


def possible_inertia(known: Mapping[str, float], names: Sequence[str], mass: float = _MASS) -> Array:
    """Pseudo-inertia of a body if its ten parameters are known and possible; else of a small ball, shape (4, 4)."""
    J = pseudo_inertia([known.get(name, np.nan) for name in names])
    if is_possible(J):
        return J
    return mass * np.diag([_LENGTH**2] * 3 + [1.0])
