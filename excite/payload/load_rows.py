"""Equations of a load from prepared logs: joint torques, or the wrench of a sensor behind which it is held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from excite.identification.calibration import at_drives, load_rows
from excite.identification.equations import equations_of
from excite.identification.identification import Identification
from excite.identification.observations import Observations, join_observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.torque_factors import drives_of_torques
from excite.information.target import IdentificationTarget
from excite.payload.known_gains import KnownGains
from excite.payload.load_equations import LoadEquations
from regressors.models.base import Base
from regressors.samples import Array

CHANGED = 0.2
"""Standard deviation of the change of each friction parameter from one log to the next, relative to the parameter."""
_KINDS = ("coulomb", "viscous", "root", "stribeck", "asymmetry")


def paired_equations(
    bare: Identification, loaded: Sequence[PreparedLog], recipe: Recipe, gains: KnownGains
) -> LoadEquations:
    """Equations of logs without and with the load, in torques of the drives and corrected gains."""
    parts = [*(replace(part, standing=()) for part in bare.prepared), *loaded]
    carries = [False] * len(bare.prepared) + [True] * len(loaded)
    observations, load = _rows(bare.target, parts, carries, recipe)
    friction, size = _friction(bare.target.base, observations, load, bare.estimate.coefficients)
    corrected = replace(observations, y=observations.y * gains.factor[observations.equation])
    return LoadEquations(corrected, load, friction, size, gains.relative)


def modelled_equations(
    target: IdentificationTarget,
    loaded: Sequence[PreparedLog],
    recipe: Recipe,
    gains: KnownGains,
    known: Array,
    covariance: Array,
) -> LoadEquations:
    """Equations of logs with the load of a robot whose parameters are known, in torques as they were identified."""
    # known (p,); covariance (p, p)
    observations, load = _rows(target, loaded, [True] * len(loaded), recipe)
    friction, size = _friction(target.base, observations, load, known)
    load = load / gains.factor[observations.equation, None]
    return LoadEquations(observations, load, friction, size, gains.relative, known, covariance, scales_all=False)


def wrench_equations(
    target: IdentificationTarget, bare: Sequence[PreparedLog], loaded: Sequence[PreparedLog], recipe: Recipe
) -> LoadEquations:
    """Equations of a force/torque sensor: its offsets, what it carries without the load, and the load."""
    parts = [equations_of(target, part, recipe) for part in (*bare, *loaded)]
    observations = join_observations(parts)
    K = observations.matrix
    carries = observations.log >= len(bare)
    offsets = np.eye(len(observations.equations))[observations.equation]
    names = tuple(f"offset.{name}" for name, _ in observations.equations)
    units = tuple(unit for _, unit in observations.equations)
    W = np.hstack([K, offsets]) if bare else offsets
    if bare:
        names, units = (*observations.names, *names), (*observations.units, *units)
    observations = replace(observations, W=W, names=names, units=units)
    none = np.zeros((W.shape[0], 0))
    return LoadEquations(observations, K * carries[:, None], none, np.zeros(0), np.zeros((0, 0)))


def _rows(
    target: IdentificationTarget, parts: Sequence[PreparedLog], carries: Sequence[bool], recipe: Recipe
) -> tuple[Observations, Array]:
    names, D = drives_of_torques(target.robot, each=True)
    observations = join_observations([at_drives(equations_of(target, part, recipe), D, names) for part in parts])
    load = [load_rows(part, target, recipe, D) * float(c) for part, c in zip(parts, carries, strict=True)]
    return observations, np.concatenate(load)


def _friction(base: Base, observations: Observations, load: Array, beta: Array) -> tuple[Array, Array]:
    """Columns of friction in the rows with the load, and how far their parameters may be from those without it."""
    own = [k for k, index in enumerate(base.index) if base.columns[int(index)].kind in _KINDS]
    size = CHANGED * np.abs(beta[own])
    kept = size > 0
    columns = observations.matrix[:, own][:, kept] * np.any(load, axis=1)[:, None]
    return columns, size[kept]
