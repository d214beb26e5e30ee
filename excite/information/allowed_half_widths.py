"""Largest half-width that a precision target allows each base parameter.

A parameter is about zero where its described value is below `ABOUT_ZERO` of its size, the root of the summed squares of
the magnitudes of its terms (`excite.information.parameter_sizes`): a share of such a value asks for what no torque
depends on. Its size stands for its value then.
"""

from __future__ import annotations

import numpy as np

from excite.information.parameter_groups import group_of
from excite.information.parameter_sizes import base_sizes
from excite.information.prior import prior_of
from excite.information.target import IdentificationTarget
from excite.tasks.precision_target import PrecisionTarget
from regressors.errors import InputError, UnknownName
from regressors.models.columns import Column
from regressors.samples import Array

ABOUT_ZERO = 0.2


def precision_scales(precision: PrecisionTarget, target: IdentificationTarget) -> Array:
    """Value of each base parameter that a share is taken of, shape (b,); NaN where nothing is known of it.

    Its given scale; or the magnitude of its described value; or, where that is about zero, its size.
    """
    base = target.base
    value = np.abs(prior_of(target.model, base, None).base_values(np.eye(base.rank)))
    size = base_sizes(target.model, base)
    scale = np.where(value >= ABOUT_ZERO * size, value, np.where(np.isfinite(size) & (value >= 0), size, np.nan))
    for name, given in precision.scales.items():
        scale[_place(base.names, name)] = given
    return scale


def allowed_half_widths(precision: PrecisionTarget, target: IdentificationTarget) -> Array:
    """Largest half-width of each base parameter, in its unit, shape (b,); infinite where nothing is asked of it."""
    base = target.base
    scale = precision_scales(precision, target)
    share = np.array([_share(precision, base.columns[k]) for k in base.index])
    for name, own in precision.parameters.items():
        share[_place(base.names, name)] = own
    unknown = [name for name in precision.parameters if np.isnan(scale[_place(base.names, name)])]
    if unknown:
        raise InputError(
            f"precision: the description of {target.robot.name!r} states no value of {', '.join(unknown)}; "
            "give one in `scales`"
        )
    allowed = np.where(np.isfinite(scale), share * np.nan_to_num(scale), np.inf)
    if not np.any(np.isfinite(allowed)) and precision.torques is None:
        raise InputError(
            f"precision: it asks nothing of the {base.rank} base parameters, since the description of "
            f"{target.robot.name!r} states no value of those that it names; give values in `scales`"
        )
    return np.asarray(allowed)


def _share(precision: PrecisionTarget, column: Column) -> float:
    """Share of a column's kind, of its group, or of all; infinite where nothing is asked."""
    for name in (column.kind, group_of(column.kind, column.unit)):
        if name is not None and name in precision.groups:
            return precision.groups[name]
    return np.inf if precision.share is None else precision.share


def _place(names: tuple[str, ...], name: str) -> int:
    if name not in names:
        raise UnknownName("base parameter", name, names)
    return names.index(name)
