"""Base columns of the regressor along a measured motion, with the friction that the recipe asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from excite.identification.friction_directions import drive_directions, drive_rows
from excite.identification.recipe import Sizes
from excite.identification.streamed_rows import HeldRows, RowSource, StreamedRows
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.samples import Array, Index, Samples


class MeasuredRows(RowSource):
    """Base columns of a model of single instants along a motion."""

    def __init__(
        self, target: IdentificationTarget, samples: Samples, breakaway: Sizes = 0.0, sign_width: Sizes = 0.0
    ) -> None:
        self.model, self.index, self.samples = target.model, target.base.index, samples
        self.shape = samples.time.size, len(target.model.row_labels), self.index.size
        direction = own_directions(target, samples, breakaway, sign_width)  # of all instants: friction remembers them
        self.friction = None if direction is None else friction_drives(target, samples)
        if direction is not None and self.friction is not None:
            self.torque = direction[:, list(self.friction.drives)] * self.friction.magnitudes

    def part(self, first: int, last: int) -> Array:
        """See `RowSource.part`."""
        return self._of(slice(first, last))

    def at(self, instants: Index) -> Array:
        """See `RowSource.at`."""
        return self._of(instants)

    def _of(self, which: slice | Index) -> Array:
        W = self.model.selected(self.samples.rows(which), self.index).reshape(-1, *self.shape[1:])
        if self.friction is not None and self.friction.columns:
            put_friction(W, self.friction.columns, self.torque[which], self.friction.rows)
        return W


def measured_rows(
    target: IdentificationTarget, samples: Samples, breakaway: Sizes = 0.0, sign_width: Sizes = 0.0
) -> RowSource:
    """Regressor W of a motion in the base columns, to be computed in parts."""
    model, index = target.model, target.base.index
    if model.window is None:
        return MeasuredRows(target, samples, breakaway, sign_width)
    if np.any(breakaway) or isinstance(sign_width, tuple):
        what = "`breakaway`" if np.any(breakaway) else "a `sign_width` of each drive"
        raise InputError(f"{what} is for the differential model; models of windows integrate friction along the path")
    W = np.ascontiguousarray(model.assemble(samples)[:, index])
    return HeldRows(W.reshape(-1, len(model.row_labels), index.size))


def measured_regressor(
    target: IdentificationTarget, samples: Samples, breakaway: Sizes = 0.0, sign_width: Sizes = 0.0
) -> Array:
    """Stacked regressor W of a motion in the base columns."""
    return StreamedRows((measured_rows(target, samples, breakaway, sign_width),), (None,)).whole()


def own_directions(
    target: IdentificationTarget, samples: Samples, breakaway: Sizes = 0.0, sign_width: Sizes = 0.0
) -> Array | None:
    """Directions of the friction of the moving drives, shape (N, m), where they are not those that the model has."""
    if not (np.any(breakaway) or isinstance(sign_width, tuple)):
        return None
    return drive_directions(target.robot, samples, sign_width, breakaway)


@dataclass(frozen=True, eq=False)
class DirectedFriction:
    """Friction columns of a torque model along a motion that have the direction of their drive."""

    columns: tuple[int, ...]  # base columns; one that several drives share is repeated for each
    drives: tuple[int, ...]  # place of the drive of each among the m drives that move, see `drive_directions`
    # (N, k) friction per unit parameter and unit direction: 1 for Coulomb friction, see
    # `regressors.models.columns.Terms`
    magnitudes: Array
    rows: Array  # (k, r) contribution of a drive's torque to each equation, its row of C' or of N' C'

    def put(self, W: Array, direction: Array) -> None:
        """Write directions of the moving drives, shape (N, m), into their columns of W, shape (N, r, b), in place."""
        put_friction(W, self.columns, direction[:, list(self.drives)] * self.magnitudes, self.rows)


def friction_drives(target: IdentificationTarget, samples: Samples) -> DirectedFriction:
    """Directed friction columns of a torque model with their drives."""
    friction = target.model.coulomb_friction()
    if friction is None:
        raise InputError(f"the {type(target.model).__name__} has no friction torque at every instant")
    place = {int(column): k for k, column in enumerate(target.base.index)}
    used = [k for k, column in enumerate(friction.columns) if int(column) in place]
    columns = tuple(place[int(friction.columns[k])] for k in used)
    C = drive_rows(target.robot)
    drives = tuple(int(np.flatnonzero(np.all(row == C, axis=1))[0]) for row in friction.coupling[used])
    return DirectedFriction(columns, drives, friction.magnitudes(samples)[:, used], friction.rows[used])


def put_friction(W: Array, columns: Sequence[int], torque: Array, rows: Array) -> None:
    """Write friction torques per unit parameter into their columns, in place."""
    # W (N, r, b); torque (N, k); rows (k, r)
    W[:, :, list(columns)] = 0.0
    for k, column in enumerate(columns):
        W[:, :, column] += torque[:, k, None] * rows[k]


def predicted_rows(
    target: IdentificationTarget, samples: Samples, breakaway: Sizes, sign_width: Sizes, coefficients: Array
) -> Array:
    """``W beta`` at every instant of a motion, shape (N, r); W is never held as a whole."""  # coefficients (b,)
    W = StreamedRows((measured_rows(target, samples, breakaway, sign_width),), (None,))
    return (W @ coefficients).reshape(-1, len(target.model.row_labels))
