"""Whether chains have forgotten where they began [Gelman et al. 2013, Bayesian Data Analysis, sections 11.4, 11.5]."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array


def split_deviation(draws: Array) -> Array:
    """Potential scale reduction R of each parameter, of chains that are split in halves, shape (k,)."""
    # draws (rounds, chains, k)
    half = len(draws) // 2
    parts = np.concatenate([draws[:half], draws[half : 2 * half]], axis=1)
    within = parts.var(axis=0, ddof=1).mean(axis=0)
    between = half * parts.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(((half - 1) / half * within + between / half) / within)
    return np.asarray(np.where(within > 0, ratio, 1.0))


def effective_draws(draws: Array) -> Array:
    """Number of independent draws that say as much of each mean, shape (k,): by Geyer's positive sums."""
    # draws (rounds, chains, k)
    rounds, chains, _ = draws.shape
    centred = draws - draws.mean(axis=(0, 1))
    spectrum = np.fft.rfft(centred, 2 * rounds, axis=0)
    lagged = np.fft.irfft(np.abs(spectrum) ** 2, axis=0)[:rounds].mean(axis=1) / rounds
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where(lagged[0] > 0, lagged / lagged[0], 0.0)
    pairs = r[1 : rounds - 1 : 2] + r[2:rounds:2]
    kept = np.cumprod(pairs > 0, axis=0)
    return np.asarray(rounds * chains / (1 + 2 * np.sum(pairs * kept, axis=0)))
