"""Base columns of the regressor along a measured motion, with the friction that the recipe asks for."""

from __future__ import annotations

import numpy as np

from excite.identification.hysteresis import dahl_direction
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
        self.columns: list[int] = []
        if breakaway > 0:
            self.columns, z, self.directed = friction_drives(target, samples)
            # of all instants: friction remembers them
            self.direction = dahl_direction(z, breakaway) if self.columns else np.zeros((samples.time.size, 0))

    def part(self, first: int, last: int) -> Array:
        """See `RowSource.part`."""
        return self._of(slice(first, last))

    def at(self, instants: Index) -> Array:
        """See `RowSource.at`."""
        return self._of(instants)

    def _of(self, which: slice | Index) -> Array:
        W = self.model.selected(self.samples.rows(which), self.index).reshape(-1, *self.shape[1:])
        if self.columns:
            put_friction(W, self.columns, self.direction[which], self.directed)
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
