"""Base columns of the regressor along a measured motion, with the friction that the recipe asks for."""

from __future__ import annotations

import numpy as np

from excite.identification.friction_directions import Sizes, directions
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.friction.friction_drives import drives_with_friction
from regressors.models.model import RegressorModel
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

_CHUNK = 8192


def measured_regressor(
    target: IdentificationTarget, samples: Samples, breakaway: Sizes = 0.0, sign_width: Sizes = 0.0
) -> Array:
    """Stacked regressor W of a motion in the base columns.

    Parameters
    ----------
    target : IdentificationTarget
    samples : Samples
        N instants of one motion.
    breakaway : float or tuple of float
        Presliding distance of Coulomb friction, see `excite.identification.hysteresis`, of all drives or of each moving
        one; 0 for the sign function of the model [rad or m].
    sign_width : float or tuple of float
        Velocities over which friction changes its sign, where each drive has its own; one for all is the model's own,
        and is ignored here [rad/s or m/s].

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
        if np.any(breakaway) or isinstance(sign_width, tuple):
            what = "`breakaway`" if np.any(breakaway) else "a `sign_width` of each drive"
            raise InputError(
                f"{what} is for the differential model; models of windows integrate friction along the path"
            )
        return np.ascontiguousarray(model.assemble(samples)[:, index])
    W = _instants(model, samples, index)
    if np.any(breakaway) or isinstance(sign_width, tuple):
        columns, rows, drives = drives_of_columns(target)
        z, dz = (motion @ drive_rows(target.robot).T for motion in (samples.q, samples.dq))
        direction = directions(z, dz, sign_width, breakaway)
        if columns and direction is not None:
            put_friction(W.reshape(samples.time.size, -1, index.size), columns, direction[:, drives], rows)
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
    columns, rows, coupling = coulomb_columns(target)
    return columns, samples.q @ coupling.T, rows


def coulomb_columns(target: IdentificationTarget) -> tuple[list[int], Array, Array]:
    """Coulomb columns as of `friction_drives`, their contributions (k, r), and rows of C of their drives (k, n)."""
    friction = target.model.coulomb_friction()
    if friction is None:
        raise InputError(f"the {type(target.model).__name__} has no friction torque at every instant")
    place = {int(column): k for k, column in enumerate(target.base.index)}
    used = [k for k, column in enumerate(friction.columns) if int(column) in place]
    return [place[int(friction.columns[k])] for k in used], friction.rows[used], friction.coupling[used]


def drives_of_columns(target: IdentificationTarget) -> tuple[list[int], Array, list[int]]:
    """Coulomb columns, their contributions (k, r), and the place of each one's drive among those that move."""
    columns, rows, coupling = coulomb_columns(target)
    C = drive_rows(target.robot)
    return columns, rows, [int(np.flatnonzero(np.all(row == C, axis=1))[0]) for row in coupling]


def drive_rows(robot: Robot) -> Array:
    """Rows of C of the drives that have friction, shape (k, n)."""
    return np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)


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
