"""How precisely parameters are to be known after an experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from excite.tasks.stored_files import TaskMotion
from regressors.arguments import checked
from regressors.errors import InputError, check_names

GROUPS = ("gravity", "inertia", "friction")


@checked
@dataclass(frozen=True)
class TaskTorques:
    """Torques of a motion that are to be predicted well.

    Parameters
    ----------
    share : float
        Of the root mean square torque of each joint along the motion: the largest half-width of the root mean square
        error of the predicted torque.
    motion : TaskMotion

    Raises
    ------
    InputError
        A share that is not above zero, or a motion that is none.
    """

    share: float
    motion: TaskMotion

    def __post_init__(self) -> None:
        if not 0.0 < self.share < float("inf"):
            raise InputError(f"precision: share of torques must be a number above zero, given {self.share!r}")

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> TaskTorques:
        """From the entries ``share`` and ``motion``, of which the latter may be what `TaskMotion.to_dict` returned.

        Raises
        ------
        InputError
            Other entries.
        """
        if set(content) != {"share", "motion"}:
            raise InputError(f"precision: torques need `share:` and `motion:`, given {', '.join(map(str, content))}")
        return cls(**content)


@checked
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
        described as about zero, or not at all. See `excite.information.half_widths` for the default.
    torques : TaskTorques, optional
        A motion along which torques are to be predicted that well, beside what is asked of parameters; give ``share``
        None for the torques alone.
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
    torques: TaskTorques | None = None
    level: float = 0.99
    probability: float = 0.95

    def __post_init__(self) -> None:
        if self.groups:
            check_names("group of parameters", self.groups, _groups())
        shares = {"share": self.share, **self.parameters, **self.groups, **self.scales}
        for name, value in shares.items():
            if value is not None and not 0.0 < value < float("inf"):
                raise InputError(f"precision: {name} must be a number above zero, given {value!r}")
        for name in ("level", "probability"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise InputError(f"precision: {name} must be between 0 and 1, given {getattr(self, name)!r}")
        if self.share is None and not self.parameters and not self.groups and self.torques is None:
            raise InputError("precision: nothing is asked for; give `share:`, or shares of `parameters:` or `groups:`")

    def to_dict(self) -> dict[str, Any]:
        """For JSON; a target is made of these entries again."""
        torques = self.torques and {"share": self.torques.share, "motion": self.torques.motion.to_dict()}
        entries = {name: dict(value) if isinstance(value, Mapping) else value for name, value in vars(self).items()}
        return {**entries, "torques": torques}


def _groups() -> tuple[str, ...]:
    """Groups, then the kinds of columns."""
    from regressors.robot.columns import BODY_KINDS, FRICTION_KINDS, ROTOR

    return tuple(dict.fromkeys((*GROUPS, *BODY_KINDS, ROTOR, *FRICTION_KINDS)))
