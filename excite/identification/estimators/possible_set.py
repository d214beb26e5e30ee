"""Least squares over the standard parameters of every body: what base parameters consist of, and what is possible.

The base parameters are ``beta = A theta``. Of the many theta that give the same beta, some or none are physically
possible: each body's pseudo-inertia must be positive definite, rotor inertias and friction positive [Wensing, Kim,
Slotine 2018].
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import clarabel
import numpy as np
import scipy
from numpy.typing import NDArray

from excite.errors import ConicSolverError
from excite.identification.estimator import Estimate
from excite.identification.estimators.least_squares import GroupWeights
from regressors.errors import InputError, UnknownName
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.models.nominal import standard_values
from regressors.models.reduction import free_parameters
from regressors.robot.columns import BODY_KINDS, COULOMB, ROTOR, VISCOUS
from regressors.robot.inertia import PARAMETERS_PER_LINK, from_pseudo_inertia, pseudo_inertia
from regressors.samples import Array, Index

WEAK = 1e-6  # information per squared scale that determines what the data does not, for rows of unit noise
_LENGTH = 0.1  # of a body without known parameters
_POSITIVE = (ROTOR, COULOMB, VISCOUS)
_ROTOR = 1e-4
_EXACT = 1e-8  # of the length of a group's y: noise below it counts as that
_EXACT_NOTE = "the data has hardly any noise: possible bodies fit it to about 1e-8 of its size, not to its noise"


Described = Mapping[str, float]  # standard parameters by name, as a description states them
# prior knowledge of single parameters, value and deviation: adds ``sum ((theta_k - value_k) / deviation_k)^2 / 2``
Pull = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Body:
    """Ten of the standard parameters that belong to one rigid body."""

    name: str
    index: Index  # (10,)
    reference: Array  # (4, 4) A possible pseudo-inertia of its size


@dataclass(frozen=True, eq=False)
class StandardProblem:
    """``min ||G theta - r||^2 / 2 + ||(theta - prior) / deviation||^2 / 2`` over possible standard parameters."""

    names: tuple[str, ...]
    A: Array  # (b, t) ``beta = A theta``
    G: Array  # (k, t) ``R A`` with the triangular factor R of the rows divided by their noise
    r: Array  # (k,)
    S: Array  # (t, f) ``theta = S phi``: the robot's structure, zeros and equal parameters
    bodies: tuple[Body, ...]
    positive: Index  # rotor inertias and friction coefficients
    scale: Array  # (t,) typical size of each parameter
    prior: Array  # (t,)
    deviation: Array = field(repr=False)  # (t,)

    def margins(self, theta: Array) -> Array:
        """Smallest eigenvalue of each body's pseudo-inertia, shape (bodies,) [of kg m^2 and kg together]."""
        return np.array([float(np.linalg.eigvalsh(pseudo_inertia(theta[body.index]))[0]) for body in self.bodies])


def standard_problem(
    problem: GroupWeights,
    model: RegressorModel,
    base: Base,
    pull: Pull | None = None,
    reference: Described | None = None,
) -> StandardProblem:
    """Set up the problem for observations in a model's base columns."""
    if problem.observations.names != base.names:
        raise InputError(
            f"observations have the parameters {', '.join(problem.observations.names)}, "
            f"the base of the model has {', '.join(base.names)}"
        )
    p, least = base.rank, _exact_scale(problem)
    R = problem.factors.stacked(np.maximum(problem.scale, least)) if np.any(problem.scale < least) else problem.R
    return problem_of_factor(R[:p, :p], R[:p, p], model, base, pull, reference)


def _exact_scale(problem: GroupWeights) -> Array:
    """Least divisor of each group's rows, whose weights are then within the solver's range, shape (groups,)."""
    return _EXACT * problem.factors.sizes() * np.sqrt(problem.factors.count)


def problem_of_factor(
    R: Array, r: Array, model: RegressorModel, base: Base, pull: Pull | None = None, reference: Described | None = None
) -> StandardProblem:
    """Set up the problem for a triangular factor of a model's base columns, ``min ||R A theta - r||``."""
    # R (k, b); r (k,)
    definition, names = model.definition()
    A = np.asarray(base.D @ definition)
    known = standard_values(model.robot) if reference is None else reference
    bodies, prior, scale = _bodies(model, known)
    if (torque := float(np.linalg.norm(R @ A @ prior))) > 0 and np.any(r):
        bodies, prior, scale = _bodies(model, known, float(np.linalg.norm(r)) / torque)
    deviation = scale / np.sqrt(WEAK)
    for name, known_within in (pull or {}).items():
        if name not in names:
            raise UnknownName("standard parameter", name, names)
        k = names.index(name)
        prior[k], deviation[k] = known_within
    positive = np.array([k for k, c in enumerate(model.standard_columns) if c.kind in _POSITIVE], dtype=np.intp)
    _, S, _ = free_parameters(model.robot.structure, names)
    return StandardProblem(names, A, R @ A, r, S, bodies, positive, scale, prior, deviation)


def _bodies(model: RegressorModel, known: Described, size: float = 1.0) -> tuple[tuple[Body, ...], Array, Array]:
    """Bodies, reference values and sizes of all parameters; unknown ones for torques of about a size."""
    columns = model.standard_columns
    reference = np.array([known.get(c.name, size * _ROTOR if c.kind == ROTOR else 0.0) for c in columns])
    scale = np.where(reference != 0.0, np.abs(reference), size)
    labels = {
        number: f"link {body.name}" for number, body in zip(model.robot.body_numbers, model.robot.bodies, strict=True)
    }
    bodies = []
    for owner, ten in _whole_bodies(model):
        index = np.array(ten, dtype=np.intp)
        J = pseudo_inertia([known.get(columns[k].name, np.nan) for k in ten])
        J = J if is_possible(J) else size * np.diag([_LENGTH**2] * 3 + [1.0])  # a small ball
        bodies.append(Body("load" if owner is None else labels[owner], index, J))
        reference[index] = from_pseudo_inertia(J)
        scale[index] = _sizes(J)
    return tuple(bodies), reference, scale


def near_described(model: RegressorModel, described: Described, within: float) -> Pull:
    """Pull of every body that is described towards its description."""
    pull: dict[str, tuple[float, float]] = {}
    for _, ten in _whole_bodies(model):
        names = [model.standard_columns[k].name for k in ten]
        if is_possible(J := pseudo_inertia([described.get(n, np.nan) for n in names])):
            sizes = zip(names, (within * _sizes(J)).tolist(), strict=True)
            pull.update((name, (described[name], deviation)) for name, deviation in sizes)
    return pull


def _whole_bodies(model: RegressorModel) -> Iterator[tuple[int | None, list[int]]]:
    """Owner of each body with all ten parameters, and their places among the standard ones; a link may have no body."""
    columns, none = model.standard_columns, model.robot.structure.zero
    for owner in dict.fromkeys(c.owner for c in columns if c.kind in BODY_KINDS):
        ten = [k for k, c in enumerate(columns) if c.kind in BODY_KINDS and c.owner == owner]
        if len(ten) == PARAMETERS_PER_LINK and not all(columns[k].name in none for k in ten):
            yield owner, ten


def _sizes(J: Array) -> Array:
    """Typical size of each of a body's ten parameters, shape (10,)."""
    mass, length = J[3, 3], np.sqrt(np.trace(J[:3, :3]) / J[3, 3])
    return np.asarray(mass * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2]))


def is_possible(J: Array) -> bool:
    """True if a pseudo-inertia is known and positive definite."""
    return bool(np.all(np.isfinite(J)) and np.linalg.eigvalsh(J)[0] > 0)


_FIXED = 1e-12  # slope of a parameter, over its size, that does not count
_ROWS, _COLUMNS = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T  # upper triangle, column by column
_WEIGHT = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2.0))
_UNITS = np.array([pseudo_inertia(e) for e in np.eye(10)])
_TOLERANCE, _ALMOST = 1e-10, 1e-7  # asked of the solver, and accepted without a word
_OUTSIDE = 1e-6  # of a body's size: what a solution that the solver ended early may lack
_RETRIES: tuple[dict[str, float], ...] = (  # refinement and regularisation of its linear systems, and its steps
    {"iterative_refinement_enable": False},
    {},
    {"static_regularization_constant": 1e-7, "max_step_fraction": 0.9},
    {"static_regularization_constant": 1e-10, "dynamic_regularization_delta": 1e-9, "max_step_fraction": 0.95},
)
_SOLVED = ("Solved", "AlmostSolved")
_INFEASIBLE = ("PrimalInfeasible", "AlmostPrimalInfeasible")
Block = tuple[Array, Array, object]  # A, b and the cone of b - A x


@dataclass(frozen=True, eq=False)
class PossibleSet:
    """``M_i + sum_k B_ik z_k > 0`` of every body, ``c_j + b_j z > 0`` of every positive parameter."""

    M: Array  # (bodies, 4, 4)
    B: Array  # (bodies, 4, 4, d)
    c: Array  # (k,)
    b: Array  # (k, d)

    @property
    def size(self) -> int:
        """Number d of coordinates."""
        return int(self.b.shape[1])

    def bodies(self, z: Array) -> Array:
        """Change of each body's matrix by the coordinates, shape (n, bodies, 4, 4)."""
        return np.asarray((z @ self.B.reshape(self.M.size, self.size).T).reshape(len(z), *self.M.shape))

    def margins(self, z: Array) -> Array:
        """Least eigenvalue or value of each constraint, in the parameters' own sizes, shape (n, bodies + k)."""
        least = np.linalg.eigvalsh(self.M + self.bodies(z))[..., 0]
        return np.concatenate([least, self.c + z @ self.b.T], axis=1)

    def contains(self, z: Array) -> NDArray[np.bool_]:
        """Whether each of n points is inside, shape (n,)."""
        return np.asarray(np.all(self.margins(z) > 0.0, axis=1))

    def towards(self, z: Array, inside: Array) -> Array:
        """The point between z and one inside, shape (d,), that is as near z as concave margins let it be."""
        there, here = self.margins(np.stack([inside, z]))
        short = np.maximum(-here, 0.0)
        t = float(np.max(short / np.where(short > 0, there + short, 1.0), initial=0.0))
        return np.asarray(z + t * (inside - z))

    def blocks(self, slack: bool = False) -> list[Block]:
        """Rows of a conic programme in z, with a last variable that all constraints are to exceed if asked for."""
        added = [] if not slack else [_WEIGHT * np.eye(4)[_ROWS, _COLUMNS]]
        rows: list[Block] = [
            (
                np.column_stack([-_WEIGHT[:, None] * B[_ROWS, _COLUMNS], *added]),
                _WEIGHT * M[_ROWS, _COLUMNS],
                clarabel.PSDTriangleConeT(4),
            )
            for M, B in zip(self.M, self.B, strict=True)
        ]
        if self.c.size:
            ones = [np.ones(self.c.size)] if slack else []
            rows.append((np.column_stack([-self.b, *ones]), self.c, clarabel.NonnegativeConeT(self.c.size)))
        return rows


def possible_set(
    standard: StandardProblem, origin: Array, slope: Array, lowest: Sequence[Array], scaling: Sequence[Array]
) -> PossibleSet:
    """Possible robots among ``theta = origin + slope @ z``."""
    # origin (t,); slope (t, d); lowest (4, 4); scaling (4, 4)
    d = slope.shape[1]
    M, B = np.zeros((len(standard.bodies), 4, 4)), np.zeros((len(standard.bodies), 4, 4, d))
    for k, (body, least, T) in enumerate(zip(standard.bodies, lowest, scaling, strict=True)):
        M[k], B[k] = body_in_coordinates(origin[body.index], slope[body.index], least, T)
    scale = standard.scale[standard.positive]
    c, b = origin[standard.positive] / scale, slope[standard.positive] / scale[:, None]
    free = np.abs(b).max(axis=1, initial=0.0) > _FIXED
    return PossibleSet(M, B, c[free], b[free])


def body_in_coordinates(origin: Array, slope: Array, lowest: Array, T: Array) -> tuple[Array, Array]:
    """M and B of a body of ten parameters, shapes (4, 4) and (4, 4, d); see `possible_set`."""
    units = T @ _UNITS @ T.T  # (10, 4, 4)
    M = np.tensordot(origin, units, axes=1) - T @ lowest @ T.T
    return np.asarray(M), np.asarray(np.tensordot(units, slope, axes=([0], [0])))


def own_scale(reference: Array) -> Array:
    """Scaling T of a body that brings the entries of its pseudo-inertia, ``T J T'``, near one, shape (4, 4)."""
    length = np.sqrt(np.trace(reference[:3, :3]) / reference[3, 3])
    return np.asarray(np.diag([1 / length] * 3 + [1.0]) / np.sqrt(reference[3, 3]))


def nearest(possible: PossibleSet, inside: Array | None = None) -> tuple[Array, tuple[str, ...]]:
    """The possible point nearest the origin of the coordinates, to the solver's tolerance, and what to say of it."""
    # inside (d,); result (d,)
    d = possible.size
    if possible.margins(np.zeros((1, d))).min(initial=0.0) >= 0:
        return np.zeros(d), ()
    identity = scipy.sparse.identity(d, format="csc")
    try:
        return conic_solution(possible, identity, np.zeros(d), possible.blocks())
    except ConicSolverError:
        if inside is None or possible.margins(inside[None]).min(initial=0.0) < 0:
            raise
    return possible.towards(np.zeros(d), inside), (
        "the conic solver found no possible bodies: the estimate of least squares is moved towards the description "
        "until it is possible",
    )


def conic_solution(
    possible: PossibleSet, P: scipy.sparse.csc_matrix, q: Array, blocks: Sequence[Block]
) -> tuple[Array, tuple[str, ...]]:
    """Minimise ``x' P x / 2 + q' x`` subject to the blocks; x begins with the coordinates of a possible set."""
    # P (n, n); q (n,); result (n,)
    A, b, cones = zip(*blocks, strict=True)
    rows, right = scipy.sparse.csc_matrix(np.concatenate(A)), np.concatenate(b)
    upper = scipy.sparse.triu(P, format="csc")
    ended: list[tuple[float, Array, str]] = []
    for further in _RETRIES:
        x, status = _ended(clarabel.DefaultSolver(upper, q, rows, right, list(cones), _settings(further)))
        sound = bool(np.all(np.isfinite(x)) and possible.margins(x[None, : possible.size]).min(initial=0.0) > -_OUTSIDE)
        if sound and status in _SOLVED:
            return x, ()
        if status in _INFEASIBLE and further is _RETRIES[0]:
            raise ConicSolverError(f"physically possible parameters: the conic solver ended with {status}")
        if sound:
            ended.append((float(x @ (P @ x) / 2 + q @ x), x, status))
    if not ended:
        raise ConicSolverError(f"physically possible parameters: the conic solver ended with {status}")
    _, x, status = min(ended, key=lambda one: one[0])
    return x, (f"the conic solver ended with {status}: the result is possible, but may not be the best",)


def _ended(solver: clarabel.DefaultSolver) -> tuple[Array, str]:
    """What a conic solver found, and its status; nothing where it panics, as over an iterate that is not finite."""
    try:
        solution = solver.solve()
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # PyO3's, which cannot be imported and is no Exception
            raise
        return np.full(1, np.nan), "a panic"
    return np.array(solution.x), str(solution.status)


def _settings(further: dict[str, float]) -> clarabel.DefaultSettings:
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    settings.reduced_tol_gap_abs = settings.reduced_tol_gap_rel = settings.reduced_tol_feas = _ALMOST
    for name, value in further.items():
        setattr(settings, name, value)
    return settings


def possible_estimate(
    problem: GroupWeights, standard: StandardProblem, theta: Array, notes: tuple[str, ...]
) -> Estimate:
    """Estimate from possible standard parameters, with the covariance of weighted least squares."""
    free = problem.estimate("physical")
    fit = np.asarray(standard.A @ theta)
    values = np.where(np.isnan(free.values), np.nan, fit)
    named = dict(zip(standard.names, theta.tolist(), strict=True))
    exact = (_EXACT_NOTE,) if np.any(problem.scale < _exact_scale(problem)) else ()
    notes = (*free.notes, *notes, *exact)
    return replace(free, values=values, standard=named, notes=notes, fit=fit, unconstrained=free.coefficients)
