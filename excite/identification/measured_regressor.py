"""Base columns of the regressor along a measured motion, with the friction that the recipe asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from excite.identification.hysteresis import measured_direction
from excite.identification.streamed_rows import HeldRows, RowSource, StreamedRows
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.samples import Array, Index, Samples


class MeasuredRows(RowSource):
    """Base columns of a model of single instants along a motion.

    Parameters
    ----------
    target : IdentificationTarget
    samples : Samples
        N instants of one motion.
    breakaway : float
        See `measured_regressor`.
    """

    def __init__(self, target: IdentificationTarget, samples: Samples, breakaway: float = 0.0) -> None:
        self.model, self.index, self.samples = target.model, target.base.index, samples
        self.shape = samples.time.size, len(target.model.row_labels), self.index.size
        self.drives = friction_drives(target, samples) if breakaway > 0 else None
        if self.drives is not None:  # of all instants: friction remembers them
            self.direction = measured_direction(self.drives.z, breakaway) if self.drives.columns else self.drives.z

    def part(self, first: int, last: int) -> Array:
        """See `RowSource.part`."""
        return self._of(slice(first, last))

    def at(self, instants: Index) -> Array:
        """See `RowSource.at`."""
        return self._of(instants)

    def _of(self, which: slice | Index) -> Array:
        W = self.model.selected(self.samples.rows(which), self.index).reshape(-1, *self.shape[1:])
        if self.drives is not None and self.drives.columns:
            torque = self.direction[which] * self.drives.magnitudes[which]
            put_friction(W, self.drives.columns, torque, self.drives.rows)
        return W


def measured_rows(target: IdentificationTarget, samples: Samples, breakaway: float = 0.0) -> RowSource:
    """Regressor W of a motion in the base columns, to be computed in parts.

    Parameters
    ----------
    target, samples, breakaway
        See `measured_regressor`.

    Raises
    ------
    InputError
        See `measured_regressor`.
    """
    model, index = target.model, target.base.index
    if model.window is None:
        return MeasuredRows(target, samples, breakaway)
    if breakaway > 0:
        raise InputError(
            "`breakaway` is for the differential model; models of windows integrate friction along the path"
        )
    W = np.ascontiguousarray(model.assemble(samples)[:, index])
    return HeldRows(W.reshape(-1, len(model.row_labels), index.size))


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
    return StreamedRows((measured_rows(target, samples, breakaway),), (None,)).whole()


@dataclass(frozen=True, eq=False)
class DirectedFriction:
    """Friction columns of a torque model along a motion that have the direction of their drive.

    Parameters
    ----------
    columns : tuple of int, length k
        Base columns; one that several drives share is repeated for each.
    z, dz : ndarray, shape (N, k)
        Coordinates of their drives, up to constants, and velocities [rad and rad/s, or with m].
    magnitudes : ndarray, shape (N, k)
        Friction per unit parameter and unit direction: 1 for Coulomb friction, see `regressors.models.columns.Terms`.
    rows : ndarray, shape (k, r)
        Contribution of a drive's torque to each equation, its row of C' or of N' C'.
    """

    columns: tuple[int, ...]
    z: Array
    dz: Array
    magnitudes: Array
    rows: Array

    def put(self, W: Array, direction: Array) -> None:
        """Write directions of friction, shape (N, k), into their columns of W, shape (N, r, b), in place."""
        put_friction(W, self.columns, direction * self.magnitudes, self.rows)


def friction_drives(target: IdentificationTarget, samples: Samples) -> DirectedFriction:
    """Directed friction columns of a torque model with their drives.

    Parameters
    ----------
    target : IdentificationTarget
    samples : Samples

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
    columns = tuple(place[int(friction.columns[k])] for k in used)
    C = friction.coupling[used]
    return DirectedFriction(
        columns, samples.q @ C.T, samples.dq @ C.T, friction.magnitudes(samples)[:, used], friction.rows[used]
    )


def put_friction(W: Array, columns: Sequence[int], torque: Array, rows: Array) -> None:
    """Write friction torques per unit parameter into their columns, in place.

    Parameters
    ----------
    W : ndarray, shape (N, r, b)
    columns : sequence of int, length k
    torque : ndarray, shape (N, k)
        Magnitude times direction.
    rows : ndarray, shape (k, r)
        See `DirectedFriction`.
    """
    W[:, :, list(columns)] = 0.0
    for k, column in enumerate(columns):
        W[:, :, column] += torque[:, k, None] * rows[k]


def predicted_rows(target: IdentificationTarget, samples: Samples, breakaway: float, coefficients: Array) -> Array:
    """``W beta`` at every instant of a motion, shape (N, r); W is never held as a whole.

    Parameters
    ----------
    target, samples, breakaway
        See `measured_regressor`.
    coefficients : ndarray, shape (b,)
        beta
    """
    W = StreamedRows((measured_rows(target, samples, breakaway),), (None,))
    return (W @ coefficients).reshape(-1, len(target.model.row_labels))
