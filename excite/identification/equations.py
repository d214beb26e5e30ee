"""Equations ``y = W beta`` of a prepared log, with the direction of each drive's friction.

At standstill ``sign(dz)`` is undefined, while the friction of a gear keeps the direction of the last motion. In Dahl's
model the direction s follows the path, ``ds/dz = (1 - s sign(dz)) / d`` [Dahl 1968].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from excite.identification.estimator import Context
from excite.identification.observations import Observations, join_observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe, Sizes
from excite.identification.streamed_rows import HELD, Decimation, RowSource, StreamedRows, held_rows
from excite.information.target import IdentificationTarget
from excite.logs.event import within
from regressors.errors import InputError
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.robot.robot import Robot
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
    if model.window is not None and (recipe.low_pass is not None or recipe.every is not None):
        raise InputError(
            "`low_pass` and `every` are for models of single instants; a model of windows integrates already"
        )
    source = measured_rows(target, samples, recipe.breakaway, recipe.sign_width)
    decimation, kept, moving, time = _selection(target, prepared, recipe)
    source = source if decimation is None else decimation.rows(source)
    observations = Observations(
        W=StreamedRows([source if kept is None else source.at(kept)]),
        y=_selected(model.right_side(samples, prepared.measured).reshape(-1, 1), r, decimation, kept)[:, 0],
        names=base.names,
        units=base.units,
        equation=np.tile(np.arange(r), time.size),
        equations=model.row_labels,
        log=np.broadcast_to(np.intp(0), time.size * r),
        logs=(prepared.log.source,),
        time=np.repeat(time, r),
    )
    return observations if moving is None else observations.rows(moving)


def _selection(
    target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe
) -> tuple[Decimation | None, Index | None, Index | None, Array]:
    """Decimation of a log's equations, which instants are left after it, which rows of these, and the instants left.

    Left are instants and windows that have no part in what is left out, and rows of drives that do not stand; None
    where these are all.
    """
    window, every, decimation, kept, moving = target.model.window, prepared.samples.time, None, None, None
    time = target.model.row_times(every)
    if window is None and (recipe.low_pass is not None or recipe.every is not None):
        decimation = Decimation.of(time, recipe.low_pass, recipe.every)
        time = time[decimation.kept]
    if prepared.left_out:
        begin = None if window is None else every[window.ends(every)[0]]
        kept = np.flatnonzero(~within(time, prepared.left_out, begin))
        time = time[kept]
    if prepared.standing:
        moving = np.flatnonzero(~np.column_stack([within(time, spans) for spans in prepared.standing]))
    return decimation, kept, moving, time


def _selected(y: Array, r: int, decimation: Decimation | None, kept: Index | None) -> Array:
    """Rows of the instants that are kept; r to each instant."""  # y (N r, k)
    y = y.reshape(-1, r, y.shape[1])
    y = y if decimation is None else decimation(y)
    return (y if kept is None else y[kept]).reshape(-1, y.shape[2])


def nuisance_columns(context: Context, change: Callable[[PreparedLog], Array]) -> Array:
    """Columns of the equations, shape (m, k), from the k changes of the measurements along each log, (k, N, n)."""
    target, recipe = context.target, context.recipe
    return np.concatenate([right_sides(target, part, recipe, change(part)) for part in context.prepared])


def instant_columns(context: Context, change: Callable[[PreparedLog], Array]) -> Array:
    """Columns of the equations, shape (m, k), from k changes of them at every instant of each log, (k, N, r)."""
    target, recipe, parts = context.target, context.recipe, context.prepared
    changes = ((part, change(part)) for part in parts)
    return np.concatenate([kept_rows(target, part, recipe, y.reshape(len(y), -1).T) for part, y in changes])


def constants(part: PreparedLog) -> Array:
    """Each component of a log's measurements as one, the others as zero, shape (n, N, n)."""
    n = part.measured.shape[1]
    return np.broadcast_to(np.eye(n)[:, None], (n, *part.measured.shape))


def right_sides(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe, measured: Array) -> Array:
    """Right-hand sides of one log's equations for several measurements along its motion."""  # measured (k, N, n)
    y = np.array([target.model.right_side(prepared.samples, signal) for signal in measured]).T
    return kept_rows(target, prepared, recipe, y)


def kept_rows(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe, y: Array) -> Array:
    """Signals at every row of one log's model, filtered and cut as its equations are."""  # y (N r, k)
    decimation, kept, moving, _ = _selection(target, prepared, recipe)
    y = _selected(y, len(target.model.row_labels), decimation, kept)
    return y if moving is None else y[moving]


def measured_rows(
    target: IdentificationTarget, samples: Samples, breakaway: Sizes | None = None, sign_width: Sizes | None = None
) -> RowSource:
    """Regressor W of a motion in the base columns, to be computed in parts."""
    model, index, friction, torque = target.model, target.base.index, None, None
    r = len(model.row_labels)
    if np.any(breakaway or 0.0) or isinstance(sign_width, tuple):  # else the directions are those that the model has
        if model.window is not None:
            what = "`breakaway`" if np.any(breakaway or 0.0) else "a `sign_width` of each drive"
            raise InputError(
                f"{what} is for the differential model; models of windows integrate friction along the path"
            )
        direction = drive_directions(target.robot, samples, sign_width, breakaway)  # of all instants: it remembers
        assert direction is not None
        friction = friction_drives(target, samples)
        torque = friction.torque(direction)
    if model.window is not None:
        return held_rows(np.ascontiguousarray(model.assemble(samples)[:, index]).reshape(-1, r, index.size))

    def part(which: slice | Index) -> Array:
        """Rows of some instants, with friction torques per unit parameter where the directions differ."""
        W = model.selected(samples.rows(which), index).reshape(-1, r, index.size)
        if friction is not None and torque is not None and friction.columns:
            put_friction(W, friction.columns, torque[which], friction.rows)
        return W

    return RowSource((samples.time.size, r, index.size), part)


def measured_regressor(target: IdentificationTarget, samples: Samples, breakaway: Sizes | None = None) -> Array:
    """Stacked regressor W of a motion in the base columns."""
    return StreamedRows([measured_rows(target, samples, breakaway)]).whole()


@dataclass(frozen=True, eq=False)
class DirectedFriction:
    """Friction columns of a torque model along a motion that have the direction of their drive."""

    columns: tuple[int, ...]  # base columns; one that several drives share is repeated for each
    drives: tuple[int, ...]  # place of the drive of each among the m drives that move, see `drive_directions`
    # (N, k) friction per unit parameter and unit direction: 1 for Coulomb friction, see
    # `regressors.robot.columns.Terms`
    magnitudes: Array
    rows: Array  # (k, r) contribution of a drive's torque to each equation, its row of C' or of N' C'

    def torque(self, direction: Array) -> Array:
        """Friction torques per unit parameter, shape (N, k), for directions of the moving drives, shape (N, m)."""
        return np.asarray(direction[:, list(self.drives)] * self.magnitudes)


def friction_drives(target: IdentificationTarget, samples: Samples) -> DirectedFriction:
    """Directed friction columns of a torque model with their drives."""
    friction = target.model.coulomb_friction()
    if friction is None:
        raise InputError(f"the {type(target.model).__name__} has no friction torque at every instant")
    place = {int(column): k for k, column in enumerate(target.base.index)}
    used = [k for k, column in enumerate(friction.columns) if int(column) in place]
    columns = tuple(place[int(friction.columns[k])] for k in used)
    C = friction_rows(target.robot)
    drives = tuple(int(np.flatnonzero(np.all(row == C, axis=1))[0]) for row in friction.coupling[used])
    return DirectedFriction(columns, drives, friction.magnitudes(samples)[:, used], friction.rows[used])


def put_friction(W: Array, columns: Sequence[int], torque: Array, rows: Array) -> None:
    """Write friction torques per unit parameter into their columns, in place."""
    # W (N, r, b); torque (N, k); rows (k, r)
    W[:, :, list(columns)] = 0.0
    for k, column in enumerate(columns):
        W[:, :, column] += torque[:, k, None] * rows[k]


def predicted_rows(target: IdentificationTarget, samples: Samples, recipe: Recipe, coefficients: Array) -> Array:
    """``W beta`` at every instant of a motion, shape (N, r); W is never held as a whole."""  # coefficients (b,)
    W = StreamedRows([measured_rows(target, samples, recipe.breakaway, recipe.sign_width)])
    return (W @ coefficients).reshape(-1, len(target.model.row_labels))


_ZERO = 1e-12  # stands for zero, whose direction is the sign


def listed(sizes: Sizes | None) -> str:
    """One size, or those of the moving drives, in words."""
    return ", ".join(f"{size:.3g}" for size in np.atleast_1d(sizes or 0.0).tolist())


def drive_directions(
    robot: Robot, samples: Samples, sign_width: Sizes | Array | None, breakaway: Sizes | Array | None
) -> Array | None:
    """Direction of the friction of each moving drive along a motion of the joints, from -1 to 1, shape (N, k)."""
    rows = friction_rows(robot)
    for what, given in (("sign_width", sign_width), ("breakaway", breakaway)):
        if isinstance(given, tuple) and len(given) != len(rows):
            raise InputError(f"`{what}` needs one value, or {len(rows)}, one per moving drive; given {len(given)}")
    distance, width = (np.asarray(0.0 if given is None else given) for given in (breakaway, sign_width))
    if np.any(distance):
        return measured_direction(samples.q @ rows.T, np.maximum(distance, _ZERO), sample_way(samples) @ rows.T)
    return np.asarray(np.tanh(samples.dq @ rows.T / np.maximum(width, _ZERO))) if np.any(width) else None


def sample_way(samples: Samples) -> Array:
    """Way of each joint in one sample time at its velocity, shape (N, n)."""
    return np.asarray(samples.dq * (samples.time[-1] - samples.time[0]) / max(samples.time.size - 1, 1))


_CAME = 0.05  # of the distance: what noise does not move a drive


def measured_direction(z: Array, distance: float | Array, pace: Array | None = None) -> Array:
    """Direction of friction along a measured path, which begins in the midst of a motion, from -1 to 1.

    What came before is not known. A drive is taken to have come the way that it goes on, by its first displacement
    beyond the distance; the direction is zero where there is none.
    """  # z (N, k); distance (k,); pace (N, k)
    moved = z - z[:1]
    first = np.argmax(np.abs(moved) > _CAME * distance, axis=0)
    return dahl_direction(z, distance, np.sign(moved[first, np.arange(z.shape[1])]), pace)


def dahl_direction(z: Array, distance: float | Array, start: Array | None = None, pace: Array | None = None) -> Array:
    """Direction of friction along a sampled path, from -1 to 1.

    z is linear between two samples: ``s_k = u + (s_{k-1} - u) exp(-|dz| / d)`` with ``u = sign(dz)``. Where the way in
    a sample time at each sample's velocity is given, and changes its sign, z turns between them, on a parabola: else
    friction would turn half a sample late on average, which looks like a delay.
    """  # z (N, k); start (k,); pace (N, k)
    way = np.diff(z, axis=0)
    keep = np.exp(-np.abs(way) / distance)
    gain = np.sign(way) * (1.0 - keep)
    if pace is not None:
        turns = np.nonzero(pace[:-1] * pace[1:] < 0)
        before, after, d = pace[:-1][turns], pace[1:][turns], np.broadcast_to(distance, way.shape)[turns]
        to, fro = (np.exp(-(v**2) / np.abs(before - after) / 2 / d) for v in (before, after))
        keep[turns] = to * fro
        gain[turns] = np.sign(before) * (1.0 - to) * fro + np.sign(after) * (1.0 - fro)
    first = np.zeros((1, z.shape[1])) if start is None else np.reshape(start, (1, -1)).astype(float)
    if len(gain):
        gain[:1] += keep[:1] * first
    return np.concatenate([first, _recursion(keep, gain)])


def _recursion(keep: Array, gain: Array) -> Array:
    """``s_k = keep_k s_{k-1} + gain_k`` from zero, shape (N, k), vectorised over blocks of equal length.

    Each block starts from zero; the final value of the block before is added afterwards.
    """
    count, drives = keep.shape
    length = max(1, math.isqrt(count))
    shape = (-(-count // length), length, drives)
    missing = ((0, shape[0] * length - count), (0, 0))
    a, s = (np.pad(x, missing).reshape(shape) for x in (keep, gain))
    for k in range(1, length):
        s[:, k] += a[:, k] * s[:, k - 1]
        a[:, k] *= a[:, k - 1]
    for block in range(1, shape[0]):
        s[block] += a[block] * s[block - 1, -1]
    return np.asarray(s.reshape(-1, drives)[:count])


def nearest(known: Array, time: Array) -> Index:
    """Index of the known instant that each time is."""  # known (N,); time (M,)
    after = np.clip(np.searchsorted(known, time), 1, known.size - 1)
    return np.asarray(after - (time - known[after - 1] < known[after] - time))
