"""Columns of a model by the names of parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regressors.errors import UnknownName
from regressors.models.model import RegressorModel


def named_parameter(model: RegressorModel, name: str, also: Sequence[str] = ()) -> int:
    """Number of a parameter by its name, or by that of the standard parameter that it is a multiple of."""
    if name in model.names:
        return model.names.index(name)
    definition, standard = model.definition()
    if name in standard:
        rows = np.flatnonzero(definition[:, standard.index(name)])
        if rows.size == 1 and np.count_nonzero(definition[rows[0]]) == 1:
            return int(rows[0])
    raise UnknownName("parameter", name, (*model.names, *also))
