"""Equations ``y = W beta`` of a prepared log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.identification.friction_directions import drive_directions, drive_rows
from excite.identification.observations import Observations, join_observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe, Sizes
from excite.identification.streamed_rows import HELD, DecimatedRows, Decimation, HeldRows, RowSource, StreamedRows
from excite.information.target import IdentificationTarget
from excite.logs.saturation import within
from regressors.errors import InputError
from regressors.samples import Array, Index, Samples


def equations(target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe) -> Observations:
    """Equations of several logs in the target's base parameters.

    Their regressor is an array where it is not large (`excite.identification.streamed_rows.HELD`); the rows of a larger
    one are computed when they are read.
    """
    streamed = join_observations([streamed_equations(target, part, recipe) for part in parts])
    return streamed if isinstance(streamed.W, StreamedRows) and streamed.W.nbytes > HELD else streamed.held()


def equations_of(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe) -> Observations:
    """Equations of one log in the target's base parameters; see `equations`."""
    return equations(target, [prepared], recipe)


def streamed_equations(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe) -> Observations:
    """Equations of one log, whose regressor's rows are computed when they are read; arguments as for `equations`."""
    model, base, samples = target.model, target.base, prepared.samples
    r = len(model.row_labels)
    source = measured_rows(target, samples, recipe.breakaway or 0.0, recipe.sign_width or 0.0)
    y = model.right_side(samples, prepared.measured).reshape(-1, r)
    time = model.row_times(samples.time)
    if recipe.low_pass is not None or recipe.every is not None:
        if model.window is not None:
            raise InputError(
                "`low_pass` and `every` are for models of single instants; a model of windows integrates already"
            )
        decimation = Decimation.of(time, recipe.low_pass, recipe.every)
        source, y, time = DecimatedRows(source, decimation), decimation(y), time[decimation.kept]
    kept = _kept(target, prepared, time)
    instants = None if kept is None else np.flatnonzero(kept)
    if instants is not None:
        y, time = y[instants], time[instants]
    observations = Observations(
        W=StreamedRows((source,), (instants,)),
        y=y.reshape(-1),
        names=base.names,
        units=base.units,
        equation=np.tile(np.arange(r), time.size),
        equations=model.row_labels,
        log=np.broadcast_to(np.intp(0), time.size * r),
        logs=(prepared.log.source,),
        time=np.repeat(time, r),
    )
    moving = _moving(target, prepared, time)
    return observations if moving is None else observations.rows(np.flatnonzero(moving))


def _kept(target: IdentificationTarget, prepared: PreparedLog, time: Array) -> NDArray[np.bool_] | None:
    """Which instants or windows have no part in what is left out, shape of ``time``; None for all of them."""
    if not prepared.left_out:
        return None
    window, samples = target.model.window, prepared.samples
    begin = None if window is None else samples.time[window.ends(samples.time)[0]]
    return ~within(time, prepared.left_out, begin)


def _moving(target: IdentificationTarget, prepared: PreparedLog, time: Array) -> NDArray[np.bool_] | None:
    """Which rows are of equations whose drives do not stand, shape (N r,) for N instants; None for all of them."""
    if not prepared.standing:
        return None
    kept = np.ones((time.size, len(target.model.row_labels)), dtype=bool)
    for equation, spans in enumerate(prepared.standing):
        kept[:, equation] = ~within(time, spans)
    return kept.ravel()


def right_sides(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe, measured: Array) -> Array:
    """Right-hand sides of one log's equations for several measurements along its motion."""  # measured (k, N, n)
    y = np.array([target.model.right_side(prepared.samples, signal) for signal in measured]).T
    return kept_rows(target, prepared, recipe, y)


def kept_rows(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe, y: Array) -> Array:
    """Signals at every row of one log's model, filtered and cut as its equations are."""  # y (N r, k)
    model = target.model
    r, time = len(model.row_labels), model.row_times(prepared.samples.time)
    if model.window is None and (recipe.low_pass is not None or recipe.every is not None):
        decimation = Decimation.of(time, recipe.low_pass, recipe.every)
        y, time = decimation(y.reshape(-1, r, y.shape[1])).reshape(-1, y.shape[1]), time[decimation.kept]
    kept = _kept(target, prepared, time)
    if kept is not None:
        y, time = y[np.repeat(kept, r)], time[kept]
    moving = _moving(target, prepared, time)
    return y if moving is None else y[moving]


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
