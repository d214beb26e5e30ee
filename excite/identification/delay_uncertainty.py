"""Change of the equations with the delay of the torques, whose value was found from the same data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from excite.identification.equations import kept_rows
from excite.identification.measured_regressor import predicted_rows
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.samples import Array


def delay_column(
    target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe, coefficients: Array
) -> Array | None:
    """Change of the predicted torques with the delay, ``-d (W beta) / dt``, per sample time, shape (m,).

    Torques that act later belong to an earlier motion.
    """  # coefficients (p,)
    if not recipe.delay or target.model.window is not None:
        return None
    columns = []
    for part in parts:
        sizes = recipe.breakaway or 0.0, recipe.sign_width or 0.0
        change = -np.gradient(predicted_rows(target, part.samples, *sizes, coefficients), axis=0)
        columns.append(kept_rows(target, part, recipe, change.reshape(-1, 1))[:, 0])
    return np.concatenate(columns)
