"""Equations ``y = W beta`` of a prepared log."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from excite.identification.measured_regressor import measured_regressor
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.saturation import within
from excite.signals.low_pass import decimated
from regressors.errors import InputError
from regressors.samples import Array


def equations_of(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe) -> Observations:
    """Equations of one log in the target's base parameters.

    Parameters
    ----------
    target : IdentificationTarget
    prepared : PreparedLog
    recipe : Recipe
        Low-pass and decimation of the equations.

    Raises
    ------
    InputError
        A low-pass or decimation for a model of time windows, which integrates already.
    """
    model, base, samples = target.model, target.base, prepared.samples
    r = len(model.row_labels)
    W = measured_regressor(target, samples, recipe.breakaway or 0.0, recipe.sign_width or 0.0)
    y = model.right_side(samples, prepared.measured)
    time = model.row_times(samples.time)
    if recipe.low_pass is not None or recipe.every is not None:
        if model.window is not None:
            raise InputError(
                "`low_pass` and `every` are for models of single instants; a model of windows integrates already"
            )
        W, y, time = _filtered(W.reshape(-1, r, base.rank), y.reshape(-1, r), time, recipe)
    count = time.size
    observations = Observations(
        W=W,
        y=y,
        names=base.names,
        units=base.units,
        equation=np.tile(np.arange(r), count),
        equations=model.row_labels,
        log=np.zeros(count * r, dtype=np.intp),
        logs=(prepared.log.source,),
        time=np.repeat(time, r),
    )
    kept = _kept(target, prepared, time)
    return observations if kept is None else observations.rows(np.flatnonzero(kept))


def _kept(target: IdentificationTarget, prepared: PreparedLog, time: Array) -> NDArray[np.bool_] | None:
    """Which rows have no part in what is left out, shape (N r,) for N instants or windows; None for all of them."""
    if not (prepared.saturated or prepared.standing):
        return None
    window, samples = target.model.window, prepared.samples
    begin = None if window is None else samples.time[window.ends(samples.time)[0]]
    kept = np.repeat(~within(time, prepared.saturated, begin)[:, None], len(target.model.row_labels), axis=1)
    for equation, spans in enumerate(prepared.standing):
        kept[:, equation] &= ~within(time, spans)
    return kept.ravel()


def right_sides(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe, measured: Array) -> Array:
    """Right-hand sides of one log's equations for several measurements along its motion.

    Parameters
    ----------
    target : IdentificationTarget
    prepared : PreparedLog
        Its own measurement is not used.
    recipe : Recipe
        Low-pass and decimation of the equations.
    measured : ndarray, shape (k, N, n)
        [Nm or N]

    Returns
    -------
    ndarray, shape (m, k)
    """
    model, samples = target.model, prepared.samples
    r, time = len(model.row_labels), model.row_times(samples.time)
    y = np.array([model.right_side(samples, signal) for signal in measured]).T
    if model.window is None and (recipe.low_pass is not None or recipe.every is not None):
        by_equation = y.reshape(-1, r, len(measured))
        y, _, time = _filtered(by_equation, by_equation[:, :, 0], time, recipe)
    kept = _kept(target, prepared, time)
    return y if kept is None else y[kept]


def _filtered(W: Array, y: Array, time: Array, recipe: Recipe) -> tuple[Array, Array, Array]:
    if recipe.low_pass is None:
        W, y, time = W[:: recipe.every], y[:: recipe.every], time[:: recipe.every]
    else:
        rate, cutoff = (time.size - 1) / float(time[-1] - time[0]), recipe.low_pass
        # equation by equation, so that only a part of a long motion is held twice
        parts = [decimated(W[:, [j]], y[:, [j]], rate, cutoff, recipe.every) for j in range(y.shape[1])]
        W, y = (np.concatenate([part[k] for part in parts], axis=1) for k in (0, 1))
        time = time[parts[0][2]]
    return W.reshape(-1, W.shape[2]), y.reshape(-1), time
