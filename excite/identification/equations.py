"""Equations ``y = W beta`` of a prepared log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from excite.identification.decimated_rows import DecimatedRows, Decimation
from excite.identification.measured_regressor import measured_rows
from excite.identification.observations import Observations, join_observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.streamed_rows import HELD, StreamedRows
from excite.information.target import IdentificationTarget
from excite.logs.saturation import within
from regressors.errors import InputError
from regressors.samples import Array


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
