"""Errors of an estimate that is held to bounds or pulled, such as to physically possible bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from excite.accuracy.linear_equations import LinearEquations
from excite.identification.estimator import Context
from excite.identification.identification import Identification
from regressors.models.nominal import standard_values
from regressors.samples import Array

FREE = ("weighted", "least-squares", "recursive", "huber")  # linear in the measurements, or nearly so


def bounded_estimates(
    result: Identification,
    linear: LinearEquations,
    values: Array,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Array:
    """What an estimator makes of measurements whose weighted least-squares estimates are given, shape (k, p).

    The rows are condensed to p equations ``R beta = R values`` with ``R'R = W' V W``, of noise one.
    """  # values (k, p)
    if result.estimate.method in FREE:
        return values
    estimator, target = result.recipe.chosen_estimator(), result.target
    context = Context(target, result.prepared, result.recipe, standard_values(target.robot))
    p, root, rows = linear.count, linear.root, linear.rows
    first: np.ndarray = np.zeros(p, dtype=np.intp)
    condensed = replace(
        rows,
        W=root,
        y=np.zeros(p),
        names=rows.names[:p],
        units=rows.units[:p],
        equation=first,
        equations=rows.equations[:1],
        log=first,
        time=np.zeros(p),
        noise=np.ones((1, 1)),
    )
    bounded = []
    for k, one in enumerate(values, 1):
        bounded.append(estimator.estimate(replace(condensed, y=root @ one), context).coefficients)
        progress(k, len(values))
    return np.array(bounded)
