"""Goal of a design: its criterion, with what this takes from the model beside the information matrix.

The regressor does not depend on the parameters, so that neither does M; but relative precision does, since it refers to
values that are known only roughly. For robots r with scales ``s_r`` over those of the described robot, the criterion is
``max_r f(R_r M R_r)``, ``R_r = diag(s_r / s)``: a maximin design in the words of [Atkinson, Donev, Tobias 2007,
chapter 17].

[Atkinson, Donev, Tobias 2007] "Optimum Experimental Designs, with SAS", Oxford University Press.

Parameters of interest, with the others as nuisance: functions of a Schur complement of M.

With the columns of W in two groups, S of the chosen parameters and N of the others, the part of W_S that the other
columns cannot explain has the information matrix

    M_S = M_SS - M_SN M_NN^-1 M_NS,

the inverse of the chosen parameters' block of ``M^-1``: what is known of them when the others are estimated too
[Atkinson, Donev, Tobias 2007, chapter 10]. It does not depend on how the other parameters are chosen or scaled. With
``det`` this is D_s-optimality, with the trace A_s-optimality.

The best motion for some parameters may not show the others at all, with W singular. So what is minimised has a small
part of the D-optimality of all parameters too, which grows without bound there; the value that is reported has not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from excite.information.half_widths import samples_of
from excite.information.prior import prior_of
from excite.information.target import IdentificationTarget, model_of
from excite.information.weighting import base_columns, weighting_of
from excite.registry import instance, name_of
from excite.tasks.criteria import ConditionNumber, Criterion, TorqueCriterion
from excite.tasks.stored_files import TaskMotion, UnopenedFile
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.base import few_states, random_states
from regressors.models.model import RegressorModel
from regressors.robot.columns import FRICTION_KINDS, Column
from regressors.samples import Array, Index, Samples


@dataclass(frozen=True, eq=False)
class Goal:
    """What a criterion takes from the model."""

    chosen: tuple[int, ...] = ()  # columns of the parameters of interest; none where all count alike
    torques: Array | None = None  # (K, b) rows of the torques to be predicted, for a criterion of them
    ratios: Array | None = None  # (R, b) values of parameters of plausible robots over the described ones

    def of(self, criterion: Criterion) -> Criterion:
        """A criterion as a function of M in the chosen convention."""
        if self.torques is not None and isinstance(criterion, TorqueCriterion):
            return criterion.of_rows(self.torques)
        criterion = ChosenParameters(criterion, self.chosen) if self.chosen else criterion
        return criterion if self.ratios is None else WorstRobot(criterion, self.ratios)


def goal_of(target: IdentificationTarget, task: Task) -> Goal:
    """Goal of a task."""
    objective = task.objective
    criterion: Criterion = instance("criterion", objective.criterion)
    name = name_of(objective.criterion)
    if isinstance(criterion, TorqueCriterion):
        if objective.interest or objective.plausible_robots is not None:
            what = "interest" if objective.interest else "plausible_robots"
            raise InputError(
                f"{what}: the criterion {name} is for predicted torques, in which every parameter counts, and which do "
                f"not depend on their values; leave `{what}` out, or give `criterion='trace'`"
            )
        return Goal(torques=task_torques(target, task))
    if objective.task_motion is not None:
        raise InputError(
            f"task_motion: the criterion {name} is not for torques; give `criterion='torque-deviation'` or "
            "`criterion='max-torque-deviation'`"
        )
    chosen = columns_of_interest(target, task)
    if len(chosen) == 1 and isinstance(criterion, ConditionNumber):
        raise InputError(
            f"interest: the criterion {name} of a single parameter is always 1; name several parameters, or give "
            "`criterion='trace'`"
        )
    count = objective.plausible_robots
    return Goal(chosen, ratios=None if count is None else value_ratios(target, task, count))


SEED = 0
_SHARPER = 4.0  # the maximum over robots than the criterion itself


@dataclass(frozen=True, eq=False)
class WorstRobot(Criterion):
    """Largest value of a criterion over several scales of the columns.

    The approximation ``(1/p) log sum_r exp(p f_r)`` of the criterion's own f is never below their largest, and tends to
    it as p grows.
    """

    criterion: Criterion
    ratios: Array  # (R, b) diagonals of ``R_r``
    stages: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)

    @property
    def name(self) -> str:  # type: ignore[override]
        """That of the criterion."""
        return self.criterion.name

    def value(self, M: Array) -> float:
        """``max_r f(R_r M R_r)``."""
        return max(self.criterion.value(M * np.outer(r, r)) for r in self.ratios)

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """The approximation of the class, with ``G = sum_r w_r R_r G_r R_r``."""
        parts = [self.criterion.smooth(M * np.outer(r, r), sharpness) for r in self.ratios]
        p = _SHARPER * sharpness
        powers = p * np.array([value for value, _ in parts])
        weights = scipy.special.softmax(powers)
        terms = zip(weights, self.ratios, parts, strict=True)
        G = sum(w * np.outer(r, r) * of_robot for w, r, (_, of_robot) in terms)
        return float(scipy.special.logsumexp(powers)) / p, np.asarray(G)


def value_ratios(target: IdentificationTarget, task: Task, count: int) -> Array:
    """Values of the base parameters of plausible robots over those of the described one, shape (count + 1, b).

    The first robot is the described one; the others have standard parameters drawn independently from the prior, normal
    with its deviations, with the seed `SEED`. A value counts with at least its prior deviation: relative precision
    about zero has no meaning.
    """
    T = target.transforms[task.objective.base]
    prior = prior_of(target.model, target.base, task.objective.prior)
    known, rng = np.isfinite(prior.deviations), np.random.default_rng(SEED)
    deviations = np.where(known, prior.deviations, 0.0)
    drawn = prior.values + deviations * rng.normal(size=(count, deviations.size))
    values = [np.abs(replace(prior, values=u).base_values(T)) for u in (prior.values, *drawn)]
    least = prior.base_deviations(T)
    floor = np.where(np.isfinite(least), least, 0.0)
    return np.asarray(np.maximum(values, floor) / values[0])


STATES = 500  # where no motion is stated


def task_torques(target: IdentificationTarget, task: Task) -> Array:
    """Regressor of the torques to be predicted, in the criterion's columns, shape (K, b).

    Torques are those of the moving coordinates, divided by their noise where the criterion's rows are. Without a stated
    motion they are those of `STATES` independent states, uniform within the limits of position, velocity and
    acceleration, with the seed `SEED`. Joints that the moving robot does not have count as at rest.
    """
    model = model_of(target.robot, task).instantaneous().restricted(target.motion, task.model.equations)
    states = _states(target, task)
    Y = model.instants(states)[:, [model.names.index(name) for name in target.base.names]]
    weighting = weighting_of(target, task)
    if target.model.window is None:
        Y = weighting.rows(Y)
    return np.asarray(Y @ weighting.transform)


def _states(target: IdentificationTarget, task: Task) -> Samples:
    motion, names = task.objective.task_motion, target.robot.joint_names
    if motion is None:
        return target.motion.states(random_states(target.robot, STATES, SEED))
    if isinstance(motion, UnopenedFile):
        raise motion.missing()
    assert isinstance(motion, TaskMotion), "the formulation reads files"
    if missing := [name for name in names if name not in motion.joints]:
        raise InputError(
            f"task_motion {motion.name} has the joints {', '.join(motion.joints)}; the design needs also "
            f"{', '.join(missing)}"
        )
    return samples_of(motion, names)


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


def _columns(target: IdentificationTarget, task: Task, base: Index, name: str) -> list[int]:
    columns = [target.model.columns[k] for k in base]
    if name in GROUPS:
        numbers = [k for k, inside in enumerate(_in_group(target, task, columns, name)) if inside]
        if not numbers:
            known = ", ".join(column.name for column in columns)
            raise InputError(f"interest: no base parameter is one of the group {name}; they are {known}")
        return numbers
    number = named_parameter(target.model, name, GROUPS)
    if number in base:
        return [base.tolist().index(number)]
    raise InputError(f"interest: {name} is not identifiable on its own{_within(target, task, base, number)}")


def _in_group(target: IdentificationTarget, task: Task, columns: list[Column], name: str) -> list[bool]:
    if name not in _AT_REST:
        return [name in (c.group, c.kind.replace(" ", "-")) for c in columns]
    acts = _act_at_rest(target, task, [c.name for c in columns])
    of_masses = (c.group in ("inertial", "rotor") for c in columns)
    return [inside and at_rest == _AT_REST[name] for inside, at_rest in zip(of_masses, acts, strict=True)]


def _act_at_rest(target: IdentificationTarget, task: Task, names: list[str]) -> list[bool]:
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
    names = [target.model.columns[k].name for k in base[np.abs(parts) > _NOTHING]]
    return f": it is part of {', '.join(names)}; choose those" if names else ": no torque of this motion depends on it"


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
        value, G, _ = self.smooth_and_value(M, sharpness)
        return value, G

    def smooth_and_value(self, M: Array, sharpness: float) -> tuple[float, Array, float]:
        """Both by one factor."""
        ordered, others = self._ordered(M), len(M) - len(self.chosen)
        regular = _factor(ordered, ridge=0.0)
        L = _factor(ordered, ridge=_RIDGE) if regular is None else regular
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
        exact = np.inf if regular is None else self.criterion.value(complement)
        return value - part * float(np.log(np.diag(L)).sum()), G, exact

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
