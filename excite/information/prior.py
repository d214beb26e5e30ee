"""Prior knowledge of the base parameters: values with their deviations, as an information matrix.

Standard parameters u are known independently of each other, with standard deviations s; unknown ones have an infinite
s. With ``beta = A u`` the prior covariance of beta is ``C = A diag(s^2) A'``, and its inverse P, zero along unknown
directions, adds to the information of the measurements, ``W' S^-1 W + P``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.tasks.objective import Belief
from regressors.errors import InputError, UnknownName
from regressors.models.base import Base
from regressors.models.drives import reflections
from regressors.models.model import RegressorModel
from regressors.models.nominal import standard_values, stated_deviations
from regressors.robot.columns import BODY_KINDS, FIRST_MOMENT, INERTIA, MASS, ROTOR
from regressors.robot.robot import Robot
from regressors.samples import Array

_NOTHING = 1e-9  # of a sum's terms: smaller values and coefficients count as zero


@dataclass(frozen=True, eq=False)
class Prior:
    """Base parameters as known beforehand."""

    A: Array  # (b, s) ``beta = A u``
    values: Array  # (s,) u in SI; NaN where not known
    deviations: Array  # (s,) their standard deviations; infinite where unknown

    @property
    def root(self) -> Array:
        """Rows R with ``P = R'R``: the prior knowledge as equations with noise 1, shape (known, b)."""
        known = np.isfinite(self.deviations)
        N = scipy.linalg.null_space(self.A[:, ~known].T) if not known.all() else np.eye(self.A.shape[0])
        return np.asarray(np.linalg.pinv(N.T @ self.A[:, known] * self.deviations[known]) @ N.T)

    @property
    def precision(self) -> Array:
        """P, the inverse of the covariance, zero along unknown directions, shape (b, b)."""
        return np.asarray(self.root.T @ self.root)

    def base_values(self, T: Array) -> Array:
        """Base parameters in the columns ``W T``, ``T^-1 A u``; NaN where a contributing one is unknown."""
        A = _without_rounding(np.linalg.solve(T, self.A))
        known = np.isfinite(self.values)
        terms = A[:, known] * self.values[known]
        values = terms.sum(axis=1)
        values[np.abs(values) <= _NOTHING * np.abs(terms).sum(axis=1)] = 0.0
        return np.where(np.any(A[:, ~known] != 0.0, axis=1), np.nan, values)

    def base_deviations(self, T: Array) -> Array:
        """Standard deviation of each base parameter in the columns ``W T``; infinite where it is unbounded."""
        A = _without_rounding(np.linalg.solve(T, self.A))
        known = np.isfinite(self.deviations)
        finite = np.linalg.norm(A[:, known] * self.deviations[known], axis=1)
        return np.where(np.any(A[:, ~known] != 0.0, axis=1), np.inf, finite)


def _without_rounding(A: NDArray[np.floating]) -> Array:
    return np.where(np.abs(A) > _NOTHING * np.abs(A).max(axis=1, keepdims=True, initial=0.0), A, 0.0)


def prior_of(model: RegressorModel, base: Base, prior: float | tuple[Belief, ...] | None) -> Prior:
    """Prior of a model's base parameters."""
    definition, names = model.definition()
    values = standard_values(model.robot)
    deviations: dict[str, float] = {}
    if isinstance(prior, int | float):
        deviations = stated_deviations(model.robot, prior)
        if not set(deviations) & set(names):
            raise InputError(
                f"prior: the description of {model.robot.name!r} states no parameter of this model; "
                "give a file of parameters with values and deviations instead"
            )
    elif prior is not None:
        own = [belief.name for belief in prior if belief.name not in names]
        definition, names = _with_own(definition, names, model.names, own)
        values |= {belief.name: belief.value for belief in prior}
        deviations = {belief.name: belief.deviation for belief in prior}
    known = np.array([values.get(name, np.nan) for name in names])
    return Prior(base.D @ definition, known, np.array([deviations.get(name, np.inf) for name in names]))


def _with_own(
    definition: Array, names: tuple[str, ...], columns: tuple[str, ...], own: list[str]
) -> tuple[Array, tuple[str, ...]]:
    """Definition in which some columns are independent quantities, whatever standard parameters they combine."""
    for name in own:
        if name not in columns:
            raise UnknownName("parameter", name, dict.fromkeys((*columns, *names)))
    rows = [columns.index(name) for name in own]
    definition = definition.copy()
    definition[rows] = 0.0
    return np.hstack([definition, np.eye(len(columns))[:, rows]]), (*names, *own)


_MASS, _LENGTH = 1.0, 0.1  # of a robot that describes neither a mass nor a distance
_POWER = {MASS: 0, FIRST_MOMENT: 1, INERTIA: 2}


def standard_sizes(model: RegressorModel) -> dict[str, float]:
    """Size of the standard parameters of a model, by name; of some nothing can be said.

    What the description states counts with the size of the quantity that it belongs to, see `stated_deviations`. A body
    of which it says nothing has the size ``M, M L, M L^2``, with the mean mass M of the bodies described and the mean
    distance L between joints; a rotor whose inertia is not described has ``M L^2`` seen from its drive coordinate.
    Friction that is not described has no size.
    """
    mass, length = _typical(model.robot)
    bodies = {c.name: mass * length ** _POWER[c.kind] for c in model.standard_columns if c.kind in BODY_KINDS}
    seen = reflections(model.robot)
    rotors = {
        c.name: mass * length**2 / seen[c.owner].ratio ** 2
        for c in model.standard_columns
        if c.kind == ROTOR and c.owner is not None
    }
    return {**bodies, **rotors, **stated_deviations(model.robot, 1.0)}


def base_sizes(model: RegressorModel, base: Base) -> Array:
    """Size of each base parameter, the root of the summed squares of its terms; infinite where a term has none."""
    return sizes_of(model, base.D)


def sizes_of(model: RegressorModel, D: Array) -> Array:
    """Size of each of ``D p``, combinations of a model's parameters."""
    definition, names = model.definition()
    known = standard_sizes(model)
    sizes = np.array([known.get(name, np.inf) for name in names])
    return Prior(D @ definition, sizes, sizes).base_deviations(np.eye(len(D)))


def _typical(robot: Robot) -> tuple[float, float]:
    """Mean mass of the bodies that have one [kg], mean distance between joints that are apart [m]."""
    masses = [float(body.theta[0]) for body in robot.bodies if body.theta is not None and body.theta[0] > 0]
    distances = [d for joint in robot.joints if (d := float(np.linalg.norm(joint.translation))) > 1e-6]
    return float(np.mean(masses or [_MASS])), float(np.mean(distances or [_LENGTH]))
