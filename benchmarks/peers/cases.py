"""The problems that every system is given: base columns, limits, described parameters, and noise.

P1 and P2 are those of `problems`, in the left-to-right base; the IRp-6 is `irp6_model`. All three are Pinocchio's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import irp6_model
import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]
from judge import (
    Array,
    base_columns,
    column_names,
    described_parameters,
    leftmost_columns,
    numbers_in_pinocchio,
    random_states,
    regressor,
    standard_names,
    torque_limits,
)
from problems import HARMONICS, PERIOD, PROBLEMS

NAMES = ("IRp-6", "P1", "P2")
NOISE = 0.01  # of a torque limit

#: Per derivative L, lower, upper of ``lower <= L q^(d) <= upper``.
Limits = tuple[tuple[Array, Array, Array], ...]


@dataclass(frozen=True, eq=False)
class Case:
    """One arm, its limits and its parameters.

    Parameters
    ----------
    name, title : str
    limits : tuple
        See `Limits`; units rad, rad/s, rad/s^2.
    columns : callable
        ``columns(q, dq, ddq)`` is the stacked W of the joints' torques, instant by instant, shape (N n, b).
    whitening : ndarray, shape (n, n)
        What makes the noise of an instant's torques white with unit variance [1/Nm].
    names, units : tuple of str
        Of the b parameters.
    values : ndarray, shape (b,)
        As described.
    """

    name: str
    title: str
    limits: Limits
    columns: Callable[[Array, Array, Array], Array]
    whitening: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    period: float = PERIOD
    harmonics: int = HARMONICS

    @property
    def middle(self) -> Array:
        """The position nearest to the middle of all ranges, shape (n,)."""
        L, lower, upper = self.limits[0]
        return np.asarray(np.linalg.lstsq(L, (lower + upper) / 2)[0])


def _unit(name: str) -> str:
    """Unit of a parameter of a link by its name."""
    return "kg m^2" if name.startswith("I") else "kg m" if "c" in name else "kg"


def _arm(name: str) -> Case:
    problem = PROBLEMS[name]
    names, eye = column_names(problem), np.eye(len(problem.lower))
    chosen = [names.index(column) for column in base_columns(name)["gautier"]]
    Y = regressor(problem, *(states[:200] for states in random_states(problem)))
    return Case(
        name=name,
        title=problem.title,
        limits=tuple((eye, *problem.bounds(derivative)) for derivative in range(3)),
        columns=lambda *state: regressor(problem, *state)[:, chosen],
        whitening=np.diag(1 / (NOISE * torque_limits(problem))),
        names=tuple(names[k] for k in chosen),
        units=tuple(_unit(names[k]) for k in chosen),
        values=np.linalg.lstsq(Y[:, chosen], Y @ described_parameters(problem))[0],
    )


def _irp6() -> Case:
    read, names_values = irp6_model.description(), irp6_model.parameters()
    joints, drives = (read[part][: irp6_model.AXES] for part in ("joints", "drives"))
    C = irp6_model.coupling()
    ranges = [(row, joint["limits"]["position"]) for row, joint in zip(np.eye(len(C)), joints, strict=True)]
    ranges += [(row, d["limits"]["position"]) for row, d in zip(C, drives, strict=True) if "position" in d["limits"]]
    lower, upper = np.array([limit for _, limit in ranges]).T
    rates = [np.array([drive["limits"][kind] for drive in drives]) for kind in ("velocity", "acceleration")]
    names = tuple(names_values[0])
    units = ("kg m^2",) * 5 + ("kg m",) * 2 + ("Nm",) * 3 + ("Nm s",) * 3
    return Case(
        name="IRp-6",
        title="IRp-6, axes 1 to 3, 13 parameters with friction",
        limits=((np.array([row for row, _ in ranges]), lower, upper), *((C, -rate, rate) for rate in rates)),
        columns=irp6_model.regressor,
        whitening=np.linalg.inv(C * NOISE * np.array([[drive["limits"]["torque"]] for drive in drives])).T,
        names=names,
        units=units,
        values=names_values[1],
    )


@cache
def ur10e_model() -> tuple[Any, Any]:
    """Pinocchio's model of the built-in UR10e, without its masses, on which no column depends."""
    arm, parent = pin.Model(), 0
    for k, joint in enumerate(irp6_model.description("ur10e")["joints"]):
        parent = arm.addJoint(parent, pin.JointModelRZ(), irp6_model.placement(joint), f"q{k + 1}")
    return arm, arm.createData()


def _ur10e_regressor(q: Array, dq: Array, ddq: Array) -> Array:
    arm, data = ur10e_model()
    rows = [pin.computeJointTorqueRegressor(arm, data, *state).copy() for state in zip(q, dq, ddq, strict=True)]
    return np.concatenate(rows)[:, numbers_in_pinocchio(len(q[0]))]


@cache
def _ur10e() -> Case:
    """The built-in UR10e with friction, as the default of `excite design` has it, accelerations up to 15 rad/s^2."""
    n, rng = 6, np.random.default_rng(0)
    speed = np.deg2rad([120.0] * 2 + [180.0] * 4)
    limits = tuple((np.eye(n), -bound, bound) for bound in (np.full(n, 2 * np.pi), speed, np.full(n, 15.0)))
    chosen = leftmost_columns(_ur10e_regressor(*(rng.uniform(lower, upper, (500, n)) for _, lower, upper in limits)))

    def columns(q: Array, dq: Array, ddq: Array) -> Array:
        friction = [(part[:, :, None] * np.eye(n)).reshape(-1, n) for part in (np.sign(dq), dq)]
        return np.hstack([_ur10e_regressor(q, dq, ddq)[:, chosen], *friction])

    standard = standard_names(n)
    names = tuple(standard[k] for k in chosen) + tuple(f"F{k + 1}{kind}" for kind in "cv" for k in range(n))
    units = (*(_unit(standard[k]) for k in chosen), *("Nm",) * n, *("Nm s",) * n)
    unknown = {"whitening": np.eye(n), "values": np.zeros(len(names))}
    return Case(
        "ur10e", "UR10e, 6 axes, 48 parameters with friction", limits, columns, names=names, units=units, **unknown
    )


@cache
def case(name: str) -> Case:
    """The case of that name; besides `NAMES`, ``ur10e``, whose parameters and noise are not stated."""
    others = {"IRp-6": _irp6, "ur10e": _ur10e}
    return others[name]() if name in others else _arm(name)
