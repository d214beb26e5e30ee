"""Weighted least squares with described bodies as prior knowledge: linear, so that many columns can be tried."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.left_out import Estimate, least_squares_of_products, left_out
from excite.identification.estimators.standard import near_described
from excite.information.target import IdentificationTarget
from regressors.samples import Array

_WITHIN = (10.0, 3.0, 1.0)  # of the described bodies, in their sizes


def best_pulled(target: IdentificationTarget, described: Mapping[str, float], statistics: BlockStatistics) -> Estimate:
    """`pulled_least_squares` with the deviation that predicts left-out blocks best."""
    every = range(target.base.rank)
    estimates = [pulled_least_squares(target, described, within, every) for within in _WITHIN]
    return min(estimates, key=lambda estimate: left_out(statistics, estimate).score)


def pulled_least_squares(
    target: IdentificationTarget, described: Mapping[str, float], within: float, columns: Sequence[int]
) -> Estimate:
    """Least squares with the prior ``beta ~ N(A theta0, A D^2 A')`` of the base parameters that bodies are part of."""
    definition, names = target.model.definition()
    A = np.asarray(target.base.D @ definition)[list(columns)]
    pull = near_described(target.model, described, within)
    spread = A * np.array([pull.deviations.get(name, 0.0) for name in names])
    center = A @ np.array([pull.values.get(name, 0.0) for name in names])
    known = np.flatnonzero(np.any(spread != 0.0, axis=1))
    length = np.linalg.norm(spread[known], axis=1)
    inverse = np.linalg.pinv((spread[known] / length[:, None]).T)
    information = inverse @ inverse.T / np.outer(length, length) if known.size else np.zeros((0, 0))

    def estimate(products: Array, weights: Array) -> Array:
        p = products.shape[-1] - 1
        prior = np.zeros((p + 1, p + 1))
        prior[np.ix_(known, known)] = information
        prior[known, -1] = prior[-1, known] = information @ center[known]
        return least_squares_of_products(np.concatenate([products, prior[None]]), np.append(weights, 1.0))

    return estimate
