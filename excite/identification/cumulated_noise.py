"""Noise of long windows, which is a cumulated sum: a row holds the noise of all instants since the first one.

With ``e_k = sum_{j <= k} n_j``, the estimate's error ``(W' V W)^-1 sum_k v W_k e_k`` is
``(W' V W)^-1 sum_j v U_j n_j``,
with the sums of the rows from j to the end, ``U_j = sum_{k >= j} W_k``. The differences n of the residuals are noise
like that of any other model, so everything else follows as there, with U in place of W.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from excite.identification.equations import right_sides
from excite.identification.estimate import Estimate
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.streamed_rows import Rows
from excite.information.target import IdentificationTarget
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class NoiseOrigin:
    """Where the noise in the rows comes from."""

    cumulated: bool = False  # True for long windows, whose rows hold the noise of all instants since the first one
    # (m, c) change of each row with each measured channel, by which its noise enters; for time windows, whose noise
    # is multiplied by velocities or rotated. Not given where each row holds the noise of its own channel alone
    channels: Array | None = None


def noise_origin(target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe) -> NoiseOrigin:
    """Where the noise in the equations of a target comes from."""
    window = target.model.window
    if window is None:
        return NoiseOrigin()
    sides = []
    for part in parts:
        count = part.measured.shape[1]
        one = np.zeros((count, *part.measured.shape))
        one[range(count), :, range(count)] = 1.0
        sides.append(right_sides(target, part, recipe, one))
    return NoiseOrigin(window.kind == "long", np.concatenate(sides))


@dataclass(frozen=True, eq=False)
class NoisePaths:
    """How noise enters the rows and the estimate, row by row."""

    noise: Array  # (m,) its estimate n, from the residuals [units of the equations]
    rows: Rows  # (m, p) rows X of ``n = n_true - X (estimate - truth)``
    sums: Rows  # (m, p) rows U: the estimate's error is ``(W' V W)^-1 sum_i v_i U_i n_i``
    channels: Array  # (m, c) by which the noise of each channel enters


def noise_paths(estimate: Estimate, observations: Observations, origin: NoiseOrigin) -> NoisePaths:
    """How noise enters observations of single instants and short windows, or of long windows."""
    e, W, D = estimate.residual(observations), observations.W, origin.channels
    D = np.broadcast_to(1.0, (e.size, 1)) if D is None else D
    if not origin.cumulated:
        return NoisePaths(e, W, W, D)
    noise, rows, sums, channels = np.empty_like(e), np.empty(W.shape), np.empty(W.shape), D.copy()
    group = observations.group
    for g in np.flatnonzero(np.bincount(group)):
        part = np.flatnonzero(group == g)
        of_group = W[part]
        noise[part], rows[part] = _changes(e[part]), _changes(of_group)
        sums[part] = np.cumsum(of_group[::-1], axis=0)[::-1]
        if origin.channels is not None:
            channels[part] = _changes(D[part])
    return NoisePaths(noise, rows, sums, channels)


def _changes(x: Array) -> Array:
    return np.diff(x, axis=0, prepend=np.zeros((1, *x.shape[1:])))
