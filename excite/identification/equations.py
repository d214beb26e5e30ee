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
    W = measured_regressor(target, samples, recipe.breakaway or 0.0)
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
    return observations if kept is None else observations.rows(np.flatnonzero(np.repeat(kept, r)))


def _kept(target: IdentificationTarget, prepared: PreparedLog, time: Array) -> NDArray[np.bool_] | None:
    """Which instants or windows have no part in what is left out, shape of ``time``; None for all of them."""
    if not prepared.saturated:
        return None
    window, samples = target.model.window, prepared.samples
    begin = None if window is None else samples.time[window.ends(samples.time)[0]]
    return ~within(time, prepared.saturated, begin)


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
    y = np.array([target.model.right_side(prepared.samples, signal) for signal in measured]).T
    return kept_rows(target, prepared, recipe, y)


def kept_rows(target: IdentificationTarget, prepared: PreparedLog, recipe: Recipe, y: Array) -> Array:
    """Signals at every row of one log's model, filtered and cut as its equations are.

    Parameters
    ----------
    target : IdentificationTarget
    prepared : PreparedLog
    recipe : Recipe
        Low-pass and decimation of the equations.
    y : ndarray, shape (N r, k), or (windows r, k)

    Returns
    -------
    ndarray, shape (m, k)
    """
    model = target.model
    r, time = len(model.row_labels), model.row_times(prepared.samples.time)
    if model.window is None and (recipe.low_pass is not None or recipe.every is not None):
        by_equation = y.reshape(-1, r, y.shape[1])
        y, _, time = _filtered(by_equation, by_equation[:, :, 0], time, recipe)
    kept = _kept(target, prepared, time)
    return y if kept is None else y[np.repeat(kept, r)]


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
