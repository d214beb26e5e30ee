"""Sizes that standard parameters have: as described, or plausible for a body or a rotor of this robot."""

from __future__ import annotations

import numpy as np

from excite.information.prior import Prior
from regressors.models.base import Base
from regressors.models.columns import BODY_KINDS, FIRST_MOMENT, INERTIA, MASS, ROTOR
from regressors.models.drives import reflections
from regressors.models.model import RegressorModel
from regressors.models.stated_deviations import stated_deviations
from regressors.robot.robot import Robot
from regressors.samples import Array

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
    return _sizes(model, base.D)


def column_sizes(model: RegressorModel) -> Array:
    """Size of each parameter of a model, as `base_sizes`, shape (p,)."""
    return _sizes(model, np.eye(len(model.columns)))


def _sizes(model: RegressorModel, D: Array) -> Array:
    """Of ``D p``."""
    definition, names = model.definition()
    known = standard_sizes(model)
    sizes = np.array([known.get(name, np.inf) for name in names])
    return Prior(D @ definition, sizes, sizes).base_deviations(np.eye(len(D)))


def _typical(robot: Robot) -> tuple[float, float]:
    """Mean mass of the bodies that have one [kg], mean distance between joints that are apart [m]."""
    masses = [float(body.theta[0]) for body in robot.bodies if body.theta is not None and body.theta[0] > 0]
    distances = [d for joint in robot.joints if (d := float(np.linalg.norm(joint.translation))) > 1e-6]
    return float(np.mean(masses or [_MASS])), float(np.mean(distances or [_LENGTH]))
