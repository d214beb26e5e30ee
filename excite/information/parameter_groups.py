"""Groups of parameters of which a precision can be asked."""

from __future__ import annotations

from regressors.models.columns import COMBINATION, FIRST_MOMENT, FRICTION_KINDS, INERTIA, MASS, ROTOR


def group_of(kind: str, unit: str) -> str | None:
    """Group in `excite.tasks.precision_target.GROUPS` of a column; None for what belongs to none."""
    if kind in FRICTION_KINDS:
        return "friction"
    if kind in (MASS, FIRST_MOMENT) or (kind == COMBINATION and unit in ("kg", "kg m")):
        return "gravity"
    return "inertia" if kind in (INERTIA, ROTOR, COMBINATION) else None
