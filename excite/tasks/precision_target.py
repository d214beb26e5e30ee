"""How precisely parameters are to be known after an experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from regressors.errors import InputError, UnknownName
from regressors.models.columns import BODY_KINDS, COMBINATION, FIRST_MOMENT, FRICTION_KINDS, INERTIA, MASS, ROTOR

GROUPS = ("gravity", "inertia", "friction")
KINDS = tuple(kind for kind in (*BODY_KINDS, ROTOR, *FRICTION_KINDS, COMBINATION) if kind not in GROUPS)


@dataclass(frozen=True)
class PrecisionTarget:
    """Largest half-width of each parameter's confidence interval, as a share of the parameter's described value.

    Parameters
    ----------
    share : float, optional
        Of every parameter that is not named below, such as 0.05; None asks nothing of these, which are identified too.
    parameters : mapping of str to float
        Share by base parameter, such as ``{"X5": 0.02}``; before those of groups.
    groups : mapping of str to float
        Share by group: ``gravity`` (masses and first moments), ``inertia`` (of bodies and rotors), ``friction``; or by
        a column's kind, such as ``coulomb``, which goes before its group.
    scales : mapping of str to float
        Value that stands for the described one of a base parameter, above zero, in its unit: for parameters that are
        described as about zero, or not at all. See `excite.information.allowed_half_widths` for the default.
    level : float
        Of the confidence intervals.
    probability : float
        With which all half-widths keep to this.

    Raises
    ------
    InputError
        Numbers out of range, or nothing that is asked for.
    UnknownName
        No such group.
    """

    share: float | None = 0.05
    parameters: Mapping[str, float] = field(default_factory=dict)
    groups: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)
    level: float = 0.99
    probability: float = 0.95

    def __post_init__(self) -> None:
        for name in self.groups:
            if name not in (*GROUPS, *KINDS):
                raise UnknownName("group of parameters", name, (*GROUPS, *KINDS))
        shares = {"share": self.share, **self.parameters, **self.groups, **self.scales}
        for name, value in shares.items():
            if value is not None and not 0.0 < _number(name, value) < float("inf"):
                raise InputError(f"precision: {name} must be a number above zero, given {value!r}")
        for name in ("level", "probability"):
            if not 0.0 < _number(name, getattr(self, name)) < 1.0:
                raise InputError(f"precision: {name} must be between 0 and 1, given {getattr(self, name)!r}")
        if self.share is None and not self.parameters and not self.groups:
            raise InputError("precision: nothing is asked for; give a `share`, or shares of `parameters` or `groups`")


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"precision: {name} must be a number, given {value!r}")
    return float(value)


def group_of(kind: str, unit: str) -> str | None:
    """Group in `GROUPS` of a column: friction, gravity or inertia; None for what belongs to none.

    Parameters
    ----------
    kind : str
        Of the column; a combination is told apart by its unit.
    unit : str
    """
    if kind in FRICTION_KINDS:
        return "friction"
    if kind in (MASS, FIRST_MOMENT) or (kind == COMBINATION and unit in ("kg", "kg m")):
        return "gravity"
    return "inertia" if kind in (INERTIA, ROTOR, COMBINATION) else None
