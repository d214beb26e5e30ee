"""Parameters of interest: base parameters by name, or by group, in the columns of a criterion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.information.named_parameter import named_parameter
from excite.information.target import IdentificationTarget, model_of
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import few_states, random_states
from regressors.models.columns import FRICTION_KINDS, Column
from regressors.samples import Index

_GROUPS = ("inertial", "rotor", "friction")
_KINDS = ("mass", "first-moment", *(kind.replace(" ", "-") for kind in FRICTION_KINDS))
_AT_REST = {"gravity": True, "inertia": False}  # whether their torques are there at rest
GROUPS = (*_AT_REST, *_GROUPS, *_KINDS)
_NOTHING = 1e-9  # of a column's length


def columns_of_interest(target: IdentificationTarget, task: Task) -> tuple[int, ...]:
    """Numbers of the criterion's columns whose parameters are of interest; none where all count alike.

    A name is that of a base parameter in the task's convention, or of the standard parameter that its column has. A
    group is one of ``inertial``, ``rotor``, ``friction``; a kind of column, such as ``mass``, ``first-moment`` or
    ``coulomb``; ``gravity``, the parameters of bodies and rotors that act on a robot at rest; or ``inertia``, those
    that act only in motion.
    """
    base = base_columns(target, task)
    chosen = [number for name in task.objective.interest for number in _columns(target, task, base, name)]
    return tuple(sorted(set(chosen)))


def base_columns(target: IdentificationTarget, task: Task) -> Index:
    """Numbers of the model's columns that the criterion's convention has, in its order, shape (b,)."""
    T, D = target.transforms[task.objective.base], target.base.D
    return np.array([int(np.argmin(np.linalg.norm(D - column[:, None], axis=0))) for column in T.T])


def _columns(target: IdentificationTarget, task: Task, base: Index, name: str) -> list[int]:
    columns = [target.model.columns[k] for k in base]
    if name in GROUPS:
        numbers = [k for k, inside in enumerate(_in_group(target, task, base, name)) if inside]
        if not numbers:
            raise InputError(
                f"interest: no base parameter is one of the group {name}; they are {', '.join(_names(columns))}"
            )
        return numbers
    number = named_parameter(target.model, name, GROUPS)
    if number in base:
        return [base.tolist().index(number)]
    raise InputError(f"interest: {name} is not identifiable on its own{_within(target, task, base, number)}")


def _in_group(target: IdentificationTarget, task: Task, base: Index, name: str) -> list[bool]:
    columns = [target.model.columns[k] for k in base]
    if name not in _AT_REST:
        return [name in (c.group, c.kind.replace(" ", "-")) for c in columns]
    acts = _act_at_rest(target, task, _names(columns))
    of_masses = (c.group in ("inertial", "rotor") for c in columns)
    return [inside and at_rest == _AT_REST[name] for inside, at_rest in zip(of_masses, acts, strict=True)]


def _act_at_rest(target: IdentificationTarget, task: Task, names: tuple[str, ...]) -> list[bool]:
    """Whether the torques of a robot at rest depend on parameters."""
    model = model_of(target.robot, task).instantaneous().restricted(target.motion, task.model.equations)
    moving = target.motion.states(random_states(target.robot, few_states(model)))
    zero = np.zeros_like(moving.q)
    still = replace(moving, dq=zero, ddq=zero)
    columns = [model.names.index(name) for name in names]
    at_rest, in_motion = (np.linalg.norm(model.instants(one)[:, columns], axis=0) for one in (still, moving))
    return [bool(acts) for acts in at_rest > _NOTHING * in_motion]


def _within(target: IdentificationTarget, task: Task, base: Index, number: int) -> str:
    """The base parameters that a parameter is part of."""
    parts = np.linalg.solve(target.transforms[task.objective.base], target.base.D[:, number])
    names = _names([target.model.columns[k] for k in base[np.abs(parts) > _NOTHING]])
    return f": it is part of {', '.join(names)}; choose those" if names else ": no torque of this motion depends on it"


def _names(columns: list[Column]) -> tuple[str, ...]:
    return tuple(c.name for c in columns)
