"""Parameters of interest, with the others as nuisance: functions of a Schur complement of M.

With the columns of W in two groups, S of the chosen parameters and N of the others, the part of W_S that the other
columns cannot explain has the information matrix

    M_S = M_SS - M_SN M_NN^-1 M_NS,

the inverse of the chosen parameters' block of ``M^-1``: what is known of them when the others are estimated too
[Atkinson, Donev, Tobias 2007, chapter 10]. It does not depend on how the other parameters are chosen or scaled. With
``det`` this is D_s-optimality, with the trace A_s-optimality.

The best motion for some parameters may not show the others at all, with W singular. So what is minimised has a small
part of the D-optimality of all parameters too, which grows without bound there; the value that is reported has not.

[Atkinson, Donev, Tobias 2007] "Optimum Experimental Designs, with SAS", Oxford University Press.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from excite.information.criteria import Criterion
from excite.information.target import IdentificationTarget, model_of
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.base import few_states, random_states
from regressors.models.columns import FRICTION_KINDS, Column
from regressors.models.model import RegressorModel
from regressors.samples import Array, Index

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


OTHERS = 0.05  # part of log det^(-1/2b) of all parameters: the chosen deviations were at most 5 % larger with it
_RIDGE = 1e-13  # of the normalised matrix: keeps the factor of a singular one finite


@dataclass(frozen=True, eq=False)
class ChosenParameters(Criterion):
    """A criterion of the Schur complement ``M_S`` of the chosen columns."""

    criterion: Criterion  # applied to ``M_S``
    chosen: tuple[int, ...]  # numbers of the chosen columns

    @property
    def name(self) -> str:  # type: ignore[override]
        """That of the criterion."""
        return self.criterion.name

    @property
    def stages(self) -> tuple[float, ...]:  # type: ignore[override]
        """Those of the criterion."""
        return self.criterion.stages

    def value(self, M: Array) -> float:
        """The criterion of ``M_S``; infinite where M is singular."""
        L = _factor(self._ordered(M), ridge=0.0)
        return np.inf if L is None else self.criterion.value(self._complement(L))

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """Its smooth approximation and `OTHERS` of ``-(1/2b) log det M``, with the gradient of the sum.

        That of the former is ``K G_S K'``, ``K = [E; -M_NN^-1 M_NS]``; of the latter ``-(1/2b) M^-1``.
        """
        value, G, _ = self._smooth(M, sharpness)
        return value, G

    def smooth_and_value(self, M: Array, sharpness: float) -> tuple[float, Array, float]:
        """Both by one factor."""
        value, G, complement = self._smooth(M, sharpness)
        return value, G, self.value(M) if complement is None else self.criterion.value(complement)

    def _smooth(self, M: Array, sharpness: float) -> tuple[float, Array, Array | None]:
        """Smooth approximation, its gradient, and ``M_S``, None where M is singular."""
        ordered, others = self._ordered(M), len(M) - len(self.chosen)
        L = _factor(ordered, ridge=0.0)
        singular = L is None
        if L is None:
            L = _factor(ordered, ridge=_RIDGE)
            assert L is not None
        complement = self._complement(L)
        value, of_complement = self.criterion.smooth(complement, sharpness)
        # M_NN = L_NN L_NN', M_SN = L_SN L_NN': M_NN^-1 M_NS = L_NN^-T L_SN'
        rest = scipy.linalg.solve_triangular(L[:others, :others], L[others:, :others].T, trans="T", lower=True)
        K = np.vstack([-rest, np.eye(len(self.chosen))])
        part = OTHERS / len(M) if others else 0.0
        half = scipy.linalg.solve_triangular(L, np.eye(len(M)), lower=True)  # M^-1 = half' half
        G, order = np.empty_like(M), self._order(len(M))
        G[np.ix_(order, order)] = K @ of_complement @ K.T - 0.5 * part * half.T @ half
        return value - part * float(np.log(np.diag(L)).sum()), G, None if singular else complement

    def _order(self, size: int) -> list[int]:
        """The other columns, then the chosen ones."""
        return [*(k for k in range(size) if k not in self.chosen), *self.chosen]

    def _ordered(self, M: Array) -> Array:
        order = self._order(len(M))
        return np.asarray(M[np.ix_(order, order)])

    def _complement(self, L: Array) -> Array:
        """``M_S = L_SS L_SS'``, from the factor of M with the chosen columns last."""
        own = L[-len(self.chosen) :, -len(self.chosen) :]
        return np.asarray(own @ own.T)


def _factor(M: Array, ridge: float) -> Array | None:
    """Lower triangular L with ``L L' = M``, of the matrix normalised by its diagonal; None if that is singular."""
    diagonal = np.diag(M)
    size = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    normalised = M / np.outer(size, size) + ridge * len(M) * np.eye(len(M))
    try:
        return np.asarray(size[:, None] * np.linalg.cholesky(normalised))
    except np.linalg.LinAlgError:
        return None


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
