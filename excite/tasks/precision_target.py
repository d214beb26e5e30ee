"""How precisely parameters are to be known after an experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from regressors.errors import InputError, UnknownName

if TYPE_CHECKING:  # what describes options must be imported in no time
    from regressors.samples import Samples

GROUPS = ("gravity", "inertia", "friction")
_MOST_INSTANTS = 200  # of a task motion that are kept


@dataclass(frozen=True)
class TaskMotion:
    """A motion whose torques are to be predicted well.

    Parameters
    ----------
    share : float
        Of the root mean square torque of each joint along the motion: the largest half-width of the root mean square
        error of the predicted torque.
    joints : tuple of str
    q, dq, ddq : tuple of tuple of float, shape (N, joints)
        Positions, velocities and accelerations at some of its instants, alike in time [rad, rad/s, ..., or with m].

    Raises
    ------
    InputError
        A share that is not above zero, or instants that do not fit.
    """

    share: float
    joints: tuple[str, ...]
    q: tuple[tuple[float, ...], ...]
    dq: tuple[tuple[float, ...], ...]
    ddq: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if not 0.0 < _number("share of torques", self.share) < float("inf"):
            raise InputError(f"precision: share of torques must be a number above zero, given {self.share!r}")
        object.__setattr__(self, "joints", tuple(self.joints))
        for name in ("q", "dq", "ddq"):
            rows = tuple(tuple(map(float, row)) for row in getattr(self, name))
            object.__setattr__(self, name, rows)
            if not rows or len(rows) != len(self.q) or any(len(row) != len(self.joints) for row in rows):
                raise InputError(f"precision: {name} of the task motion needs a row of {len(self.joints)} per instant")

    @classmethod
    def of(cls, samples: Samples, joints: Sequence[str], share: float) -> TaskMotion:
        """Of samples at equal steps of time; 200 of their instants at most are kept.

        Parameters
        ----------
        samples : Samples
        joints : sequence of str
            Of the columns of the samples.
        share : float
        """
        step = -(-len(samples.q) // _MOST_INSTANTS)
        q, dq, ddq = (part[::step].tolist() for part in (samples.q, samples.dq, samples.ddq))
        return cls(share, tuple(joints), q, dq, ddq)


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
    torques : TaskMotion, optional
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
    torques: TaskMotion | None = None
    level: float = 0.99
    probability: float = 0.95

    def __post_init__(self) -> None:
        if isinstance(self.torques, Mapping):
            object.__setattr__(self, "torques", TaskMotion(**self.torques))
        for name in self.groups:
            if name not in (known := _groups()):
                raise UnknownName("group of parameters", name, known)
        shares = {"share": self.share, **self.parameters, **self.groups, **self.scales}
        for name, value in shares.items():
            if value is not None and not 0.0 < _number(name, value) < float("inf"):
                raise InputError(f"precision: {name} must be a number above zero, given {value!r}")
        for name in ("level", "probability"):
            if not 0.0 < _number(name, getattr(self, name)) < 1.0:
                raise InputError(f"precision: {name} must be between 0 and 1, given {getattr(self, name)!r}")
        if self.share is None and not self.parameters and not self.groups and self.torques is None:
            raise InputError("precision: nothing is asked for; give a `share`, or shares of `parameters` or `groups`")


def _groups() -> tuple[str, ...]:
    """Groups, then the kinds of columns."""
    from regressors.models.columns import BODY_KINDS, FRICTION_KINDS, ROTOR

    return tuple(dict.fromkeys((*GROUPS, *BODY_KINDS, ROTOR, *FRICTION_KINDS)))


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"precision: {name} must be a number, given {value!r}")
    return float(value)
