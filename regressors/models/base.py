"""Base parameters: the combinations of parameters that are identifiable from motion.

A regressor W of random states has rank b < p. A choice of b independent columns W_b and the map D with ``W = W_b D``
give the base parameters ``beta = D p`` and ``W p = W_b beta`` for every motion [Gautier 1991].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Literal

import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.models.model import RegressorModel
from regressors.numerical import ROUNDING, TOLERANCE, explained_columns, independent_columns, pivoted_columns
from regressors.robot.columns import BODY_KINDS, Column
from regressors.robot.robot import Robot, finite_ranges
from regressors.robot.symbolic.loops import loops_of
from regressors.samples import Array, Index, Samples

Choice = Literal["gautier", "pivoted"]
CHOICES: tuple[Choice, ...] = ("gautier", "pivoted")
MOST_STATES, _ROWS_PER_COLUMN = 2000, 20
_FEW_COLUMNS = 150  # a chain of twelve axes
_MODERATE = {"dq": 3.0, "ddq": 10.0}  # rad, m and s; they accelerate about as much as gravity
_UNLIMITED = {"velocity": 2.0, "acceleration": 10.0}
_FASTEST = 100.0  # faster limits of descriptions are placeholders, whose gyroscopic torques would drown all others


def random_states(robot: Robot, count: int, seed: int = 0) -> Samples:
    """Independent states, uniform within the joint limits; within a few SI units where one is missing.

    Velocities stay below 100 rad/s or m/s, whatever a description states.
    """
    if robot.closures:
        return _closed_states(robot, count, seed)
    return _free_states(robot, count, seed)


def _free_states(robot: Robot, count: int, seed: int) -> Samples:
    rng = np.random.default_rng(seed)
    bounds = ((getattr(robot.limits, name), size) for name, size in _UNLIMITED.items())
    velocity, acceleration = (np.where(np.isfinite(bound), bound, size) for bound, size in bounds)
    velocity = np.minimum(velocity, _FASTEST)
    shape = (count, robot.n)
    q = rng.uniform(*finite_ranges(robot), shape)
    dq = rng.uniform(-velocity, velocity, shape)
    ddq = rng.uniform(-acceleration, acceleration, shape)
    return Samples(np.arange(count, dtype=float), q, dq, ddq, np.zeros(shape))


_DRAWS = 20  # times as many states are tried at most


def _closed_states(robot: Robot, count: int, seed: int) -> Samples:
    """States in which all loops are closed, away from singular configurations."""
    loops, states = loops_of(robot), list[Samples]()
    for draw in range(_DRAWS):
        states.append(loops.states(_free_states(robot, count, seed + 1000 * draw)))
        if sum(one.time.size for one in states) >= count:
            return replace(Samples.joined(states).rows(slice(count)), time=np.arange(count, dtype=float))
    raise InputError(
        f"robot {robot.name!r}: its loops close in fewer than one of {_DRAWS} configurations within the limits of "
        f"{', '.join(loops.names)}; state narrower limits of these joints, within which the loops close"
    )


def triangular_factor(W: Array) -> Array:
    """Triangular factor R of W = QR, which has the dependences of W's columns in p rows."""
    return np.asarray(np.linalg.qr(W, mode="r"))


@dataclass(frozen=True, eq=False)
class Base:
    """A choice of base columns, and the base parameters that belong to them."""

    columns: tuple[Column, ...]  # of the model, p of them
    index: Index  # (b,) indices of the chosen columns
    D: Array  # (b, p) ``beta = D p`` and ``W = W[:, index] D``; the identity on the chosen columns
    # (p,) of the column-normalised regressor at the random states; what falls behind number b is the gap. Where
    # parameters that are hardly seen were left out, of columns in units of their parameters' sizes
    singular_values: Array
    expressions: tuple[str, ...]  # readable expression of each base parameter in standard parameters
    by_rounding: tuple[str, ...] = ()  # names of columns left out because only rounding shows their parameters

    @property
    def rank(self) -> int:
        """Number of base parameters."""
        return len(self.index)

    @property
    def gap(self) -> float:
        """Ratio of the smallest singular value within the rank to the largest beyond it; infinite if none is left."""
        left = self.singular_values[self.rank :]
        if left.size == 0 or left[0] == 0.0:
            return np.inf
        return float(self.singular_values[self.rank - 1] / left[0])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the chosen columns."""
        return tuple(self.columns[k].name for k in self.index)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the base parameters."""
        return tuple(self.columns[k].unit for k in self.index)

    @property
    def full_rank_factor(self) -> Array:
        """Lower triangular L with ``L L' = D D'``: W has the singular values of ``W_b L`` (orthonormal convention)."""
        return np.asarray(np.linalg.cholesky(self.D @ self.D.T))


@checked
def base_parameters(
    model: RegressorModel,
    choice: Choice = "gautier",
    *,
    states: Samples | None = None,
    tolerance: float = TOLERANCE,
    rounding: float = ROUNDING,
) -> Base:
    """Base columns of a model, found on random states.

    An angle that was rounded to 1.5708 shows parameters that are none, with torques a hundred thousandth of those of
    others. They are left out: those of which less than `rounding` is left after projection on the columns before, in
    lengths of the longest column of the same kind (masses, first moments, inertias; of drives, of its own), with all
    joints at up to 3 rad/s and 10 rad/s^2. In this measure the least parameter of the built-in robots is 1.2e-2, that
    of 43 chains of the public robots of example-robot-data 1.9e-2, and the largest that rounding shows in them 3.4e-6.

    Parameters
    ----------
    model : RegressorModel
    choice : {"gautier", "pivoted"}
        Left-to-right QR, or column-pivoted QR of the inertial and rotor columns followed by the friction columns.
    states : Samples, optional
        Random states to find them on; `enough_states`, uniform within the joint limits, if not given.
    tolerance : float
        Largest fraction of a column's norm, or of the first pivot, that counts as zero.
    rounding : float
        Largest part of a column that counts as born of rounding; zero keeps all parameters.

    Returns
    -------
    Base

    Raises
    ------
    UnknownName
        No such choice.
    """
    check_names("choice of base columns", [choice], CHOICES)
    states = states if states is not None else random_states(model.robot, enough_states(model))
    R, hidden = _without_rounding(model, states, rounding)
    return replace(base_of(model, R, choice, tolerance), by_rounding=hidden)


def bases(model: RegressorModel, states: Samples, rounding: float = ROUNDING) -> tuple[Base, ...]:
    """Base columns of a model by each of `CHOICES`, see `base_parameters`."""
    R, hidden = _without_rounding(model, states, rounding)
    return tuple(replace(base_of(model, R, choice), by_rounding=hidden) for choice in CHOICES)


def _without_rounding(model: RegressorModel, states: Samples, rounding: float) -> tuple[Array, tuple[str, ...]]:
    """Triangular factor at random states, without what only rounding shows, and the columns whose parameters that was.

    At high speeds gyroscopic torques swell some inertias a million times over the others, so that what looks small is
    looked at again with all joints at the same moderate speed.
    """
    R = triangular_factor(model.instants(states))
    exact = independent_columns(R)
    if rounding <= 0.0 or len(independent_columns(R, rounding, _sizes(model, R))) == len(exact):
        return R, ()
    moderate = {name: _up_to(getattr(states, name), most) for name, most in _MODERATE.items()}
    slower = replace(states, **moderate)
    slower = loops_of(model.robot).rates(slower) if model.robot.closures else slower
    S = triangular_factor(model.instants(slower))
    sizes = _sizes(model, S)
    kept = np.intersect1d(independent_columns(S, rounding, sizes), exact)
    hidden = np.setdiff1d(exact, kept)
    if hidden.size == 0:
        return R, ()
    return R[:, kept] @ explained_columns(S, kept, sizes), tuple(model.columns[j].name for j in hidden)


def _up_to(values: Array, most: float) -> Array:
    """Every column that is not zero, scaled to a largest value."""
    largest = np.abs(values).max(axis=0, initial=0.0)
    return values * (most / np.where(largest > 0.0, largest, np.inf))


def _sizes(model: RegressorModel, R: Array) -> Array:
    """Length of the longest column of the same kind for columns of bodies, of its own for others, shape (p,)."""
    lengths = np.linalg.norm(R, axis=0)
    kinds = np.array([column.kind for column in model.columns])
    longest = {kind: lengths[kinds == kind].max(initial=0.0) for kind in BODY_KINDS}
    return np.array([longest.get(kind, length) for kind, length in zip(kinds.tolist(), lengths, strict=True)])


def enough_states(model: RegressorModel) -> int:
    """Number of random states: as many as pivots have been chosen on, fewer where there are many columns."""
    return MOST_STATES if len(model.columns) <= _FEW_COLUMNS else few_states(model)


def few_states(model: RegressorModel) -> int:
    """Number of random states with many more rows than the model has columns, enough for left-to-right columns."""
    return min(MOST_STATES, -(-_ROWS_PER_COLUMN * len(model.columns) // len(model.row_labels)))


def base_of(model: RegressorModel, R: Array, choice: Choice = "gautier", tolerance: float = TOLERANCE) -> Base:
    """Base columns of a model, from a regressor of it."""  # R (k, p)
    p = R.shape[1]
    order = np.arange(p)
    if choice == "pivoted":
        mass = np.array([c.group != "friction" for c in model.columns])
        pivoted = np.sort(np.flatnonzero(mass)[pivoted_columns(R[:, mass], tolerance)])
        order = np.concatenate([pivoted, np.setdiff1d(order, pivoted)])
    index = np.sort(order[independent_columns(R[:, order], tolerance)])
    D = _dependence(R, index)
    sizes = np.linalg.norm(R, axis=0)
    normalised = R / np.where(sizes > 1e-12 * sizes.max(initial=0.0), sizes, np.inf)
    sigma = np.asarray(np.linalg.svd(normalised, compute_uv=False), dtype=float)
    return Base(model.columns, index, D, sigma, expressions(model, D))


def _dependence(R: Array, index: Index) -> Array:
    D = np.linalg.lstsq(R[:, index], R, rcond=None)[0]
    sizes = np.linalg.norm(R, axis=0)
    part = np.abs(D) * sizes[index][:, None] / np.where(sizes > 0, sizes, np.inf)
    D = np.where(part < 1e-9, 0.0, D)
    nearest = np.round(D)
    D = np.where(np.abs(D - nearest) < 1e-9, nearest, D) + 0.0
    D[:, index] = np.eye(len(index))
    return np.asarray(D)


def expressions(model: RegressorModel, D: Array) -> tuple[str, ...]:
    """Rows of D written in the model's standard parameters, such as ``I3yy - I3xx`` or ``m2c2x + l2 m3``."""
    # D (b, p)
    standard, monomials = model.standard_columns, _monomials(dict(model.robot.constants))
    return tuple(_sum(row, standard, monomials) for row in D @ model.composition.definition)


Monomial = tuple[str, float, set[str]]  # text and value of a constant or a product, the numbers in its constants' names


def _monomials(constants: dict[str, float]) -> list[Monomial]:
    """Constants and products of two constants, then the same doubled."""
    single = [(name, x, {"".join(filter(str.isdigit, name))}) for name, x in constants.items() if x != 0.0]
    pairs = combinations_with_replacement(single, 2)
    products = [(f"{a}^2" if a == b else f"{a} {b}", x * y, of_a | of_b) for (a, x, of_a), (b, y, of_b) in pairs]
    once = [*single, *products]
    return [*once, *((f"2 {text}", 2 * value, numbers) for text, value, numbers in once)]


def _sum(row: Array, standard: tuple[Column, ...], monomials: list[Monomial]) -> str:
    text = ""
    scale = float(np.abs(row).max(initial=0.0))
    for k in np.flatnonzero(np.abs(row) > 1e-9 * scale):
        size, name = abs(float(row[k])), standard[k].name
        product = name if abs(size - 1.0) <= 1e-9 else f"{_factor(size, standard[k], monomials)} {name}"
        join = (" - " if row[k] < 0 else " + ") if text else ("-" if row[k] < 0 else "")
        text += join + product
    return text


def _factor(size: float, column: Column, monomials: list[Monomial]) -> str:
    """Text of a coefficient; of equal constants one whose names bear the column's owner's number, or none, is taken."""
    equal = [(text, numbers) for text, value, numbers in monomials if abs(value - size) <= 1e-9 * size]
    own = (text for text, numbers in equal if numbers <= {"", str(column.owner)})
    return [*own, *(text for text, _ in equal), f"{size:.6g}"][0]
