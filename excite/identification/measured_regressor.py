"""Base columns of the regressor along a measured motion, with the friction that the recipe asks for."""

from __future__ import annotations

import numpy as np

from excite.identification.hysteresis import measured_direction
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.samples import Array, Index, Samples

_CHUNK = 8192


def measured_regressor(target: IdentificationTarget, samples: Samples, breakaway: float = 0.0) -> Array:
    """Stacked regressor W of a motion in the base columns.

    Parameters
    ----------
    target : IdentificationTarget
    samples : Samples
        N instants of one motion.
    breakaway : float
        Presliding distance of Coulomb friction, see `excite.identification.hysteresis`; 0 for the sign function of the
        model [rad or m].

    Returns
    -------
    ndarray, shape (N r, b), or (windows r, b)

    Raises
    ------
    InputError
        A presliding distance for a model without a friction torque at every instant.
    """
    model, index = target.model, target.base.index
    if model.window is not None:
        if breakaway > 0:
            raise InputError(
                "`breakaway` is for the differential model; models of windows integrate friction along the path"
            )
        return np.ascontiguousarray(model.assemble(samples)[:, index])
    W = _instants(model, samples, index)
    if breakaway > 0:
        columns, z, rows = friction_drives(target, samples)
        if columns:
            put_friction(W.reshape(samples.time.size, -1, index.size), columns, measured_direction(z, breakaway), rows)
    return W


def _instants(model: RegressorModel, samples: Samples, index: Index) -> Array:
    """Base columns, computed in chunks to limit memory."""
    r = len(model.row_labels)
    W = np.empty((samples.time.size * r, index.size))
    for start in range(0, samples.time.size, _CHUNK):
        piece = samples.rows(slice(start, start + _CHUNK))
        W[start * r : (start + _CHUNK) * r] = model.instants(piece)[:, index]
    return W


def friction_drives(target: IdentificationTarget, samples: Samples) -> tuple[list[int], Array, Array]:
    """Coulomb columns of a torque model with their drives.

    Parameters
    ----------
    target : IdentificationTarget
    samples : Samples

    Returns
    -------
    columns : list of int
        Base columns; one that several drives share is repeated for each.
    z : ndarray, shape (N, k)
        Coordinates of their drives, up to constants [rad or m].
    rows : ndarray, shape (k, r)
        Contribution of a drive's torque to each equation, its row of C' or of N' C'.

    Raises
    ------
    InputError
        The model has no friction torque at every instant.
    """
    friction = target.model.coulomb_friction()
    if friction is None:
        raise InputError(f"the {type(target.model).__name__} has no friction torque at every instant")
    place = {int(column): k for k, column in enumerate(target.base.index)}
    used = [k for k, column in enumerate(friction.columns) if int(column) in place]
    columns = [place[int(friction.columns[k])] for k in used]
    return columns, samples.q @ friction.coupling[used].T, friction.rows[used]


def put_friction(W: Array, columns: list[int], direction: Array, rows: Array) -> None:
    """Write directions of friction into the Coulomb columns, in place.

    Parameters
    ----------
    W : ndarray, shape (N, r, b)
    columns : list of int, length k
    direction : ndarray, shape (N, k)
    rows : ndarray, shape (k, r)
        See `friction_drives`.
    """
    W[:, :, columns] = 0.0
    for k, column in enumerate(columns):
        W[:, :, column] += direction[:, k, None] * rows[k]
