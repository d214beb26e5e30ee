"""Positions across gaps of a log, so that what is resampled there neither swings nor has corners."""

from __future__ import annotations

import numpy as np

from excite.logs.gaps import Gap
from regressors.samples import Array

_DEGREE = 5
_BESIDE = 0.05  # least length of the fit on either side of a gap [s]
_FEWEST = 5  # rows on either side


def bridged(time: Array, x: Array, gaps: tuple[Gap, ...], step: float) -> tuple[Array, Array]:
    """Samples with further ones in the gaps, on polynomials of degree 5 through both sides."""
    # time (N,); x (N, n); result (M,); result (M, n)
    rows = [_bridge(time, x, gap, step) for gap in gaps]
    after = np.concatenate([np.full(t.size, gap.row + 1) for gap, (t, _) in zip(gaps, rows, strict=True)])
    times = np.concatenate([t for t, _ in rows])
    values = np.concatenate([values for _, values in rows])
    return np.insert(time, after, times), np.insert(x, after, values, axis=0)


def _bridge(time: Array, x: Array, gap: Gap, step: float) -> tuple[Array, Array]:
    """Times and values in one gap."""
    count = max(1, round(gap.length / step) - 1)
    inside = gap.time + gap.length * np.arange(1, count + 1) / (count + 1)
    length = max(gap.length, _BESIDE)
    first = min(int(np.searchsorted(time, gap.time - length)), gap.row + 1 - _FEWEST)
    last = max(int(np.searchsorted(time, gap.time + gap.length + length)), gap.row + 1 + _FEWEST)
    near = slice(max(0, first), min(time.size, last))
    middle, scale = gap.time + gap.length / 2, length + gap.length / 2
    powers = ((time[near] - middle) / scale)[:, None] ** np.arange(_DEGREE + 1)
    coefficients = np.linalg.lstsq(powers, x[near], rcond=None)[0]
    return inside, ((inside - middle) / scale)[:, None] ** np.arange(_DEGREE + 1) @ coefficients
