"""An estimate with its uncertainty, the interface of estimators, and which parameters the data identify."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.storage.codec import named
from excite.trajectories import Trajectory
from regressors.errors import listed_names
from regressors.numerical import independent_columns
from regressors.samples import Array

CONFIDENCE = 0.99


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimate of p parameters.

    Parameters
    ----------
    method : str
        Registered name of the estimator.
    names, units : tuple of str, length p
    values : ndarray, shape (p,)
        NaN where the parameter is not identifiable.
    covariance : ndarray, shape (p, p)
        Of the values; infinite variances where the parameter is not identifiable.
    noise : ndarray, shape (logs, equations)
        Standard deviation of the residuals of each log's equations, or the known one [units of the equations].
    degrees_of_freedom : int
        Rows less estimated parameters; of Student's t for the intervals.
    unseen : tuple of str
        Parameters that are not identifiable on their own.
    notes : tuple of str
        Assumptions of the method, and remarks on the result.
    standard : mapping of str to float
        Standard parameters of bodies and drives, where the method estimates them.
    history : tuple of (ndarray, ndarray), optional
        Of the recursive method: times, shape (k,) [s], and estimates after them, shape (k, p).
    fit : ndarray, shape (p,), optional
        Values for predictions, also of parameters that are not identifiable on their own; `values` if not given.
    unconstrained : ndarray, shape (p,), optional
        Values for predictions by the same equations without bounds and pull, where the method has them.
    mismatch : ndarray, shape (p, p), optional
        Second moments of the error by friction of other forms than the model's, where the log shows it; not part of the
        covariance, see `excite.identification.biases`.
    """

    listed: ClassVar[bool] = True

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    noise: Array = field(metadata=named("noise_deviations"))
    degrees_of_freedom: int
    unseen: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    standard: Mapping[str, float] = field(default_factory=dict)
    history: tuple[Array, Array] | None = None
    fit: Array | None = None
    unconstrained: Array | None = None
    mismatch: Array | None = None

    def __repr__(self) -> str:
        """One line."""
        return f"<Estimate of {len(self.names)} parameters by {self.method}: {listed_names(self.names)}>"

    @property
    def coefficients(self) -> Array:
        """Values for predictions, shape (p,): `fit`, or `values` with zeros for those not identifiable."""
        return np.nan_to_num(self.values, nan=0.0) if self.fit is None else self.fit

    @property
    def deviation(self) -> Array:
        """Standard deviation of each value, shape (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def half_width(self) -> Array:
        """Half of the 99 % confidence interval of each value, shape (p,)."""
        return self.quantile * self.deviation

    @property
    def quantile(self) -> float:
        """Half of a 99 % confidence interval over the standard deviation, by Student's t."""
        return float(scipy.special.stdtrit(max(self.degrees_of_freedom, 1), 0.5 + CONFIDENCE / 2))

    @property
    def interval(self) -> Array:
        """99 % confidence interval of each value, shape (p, 2)."""
        return np.column_stack([self.values - self.half_width, self.values + self.half_width])

    @property
    def relative_deviation(self) -> Array:
        """Standard deviation over magnitude of each value, shape (p,); infinite where the value is zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(self.values == 0.0, np.inf, self.deviation / np.abs(self.values)))

    def predicted(self, observations: Observations) -> Array:
        """``W beta``, shape (m,), with `coefficients`."""
        return np.asarray(observations.W @ self.coefficients)

    def residual(self, observations: Observations) -> Array:
        """``y - W beta``, shape (m,)."""
        return np.asarray(observations.y - self.predicted(observations))


def noted(estimate: Estimate, *notes: str) -> Estimate:
    """An estimate with further notes."""
    return replace(estimate, notes=(*estimate.notes, *notes))


def allowing_for(estimate: Estimate, errors: Array, *notes: str, covariance: Array | None = None) -> Estimate:
    """Extend the covariance of an estimate by errors beside its noise, ``Cov + G C G'``, and note why.

    G are the changes of the estimate, shape (p,) or (p, k), by errors of covariance C, or else of one and independent.
    """
    G = errors.reshape(len(estimate.names), -1)
    seen = np.isfinite(np.diag(estimate.covariance))
    added = (G if covariance is None else G @ covariance) @ G.T
    return noted(replace(estimate, covariance=estimate.covariance + np.where(np.outer(seen, seen), added, 0.0)), *notes)


def largest_share(estimate: Estimate, changes: Array) -> tuple[int, float]:
    """The parameter that changes most in its deviations, and by how many."""  # changes (p,)
    deviation = estimate.deviation
    known = np.isfinite(deviation) & (deviation > 0)
    share = np.divide(np.abs(changes), deviation, out=np.zeros_like(deviation), where=known)
    worst = int(np.argmax(share))
    return worst, float(share[worst])


def of_seen(covariance: Array, seen: NDArray[np.bool_]) -> Array:
    """Covariance of the parameters that are identifiable: infinite variances of the others, shape (p, p)."""
    kept = np.where(np.outer(seen, seen), covariance, 0.0)
    kept[np.diag_indices_from(kept)] = np.where(seen, np.diag(covariance), np.inf)
    return kept


def hide_parameters(estimate: Estimate, hidden: NDArray[np.bool_]) -> Estimate:
    """The estimate without a value of some parameters, shape (p,): NaN, as where they are not identifiable."""
    seen = np.isfinite(estimate.values) & ~hidden
    names = [name for name, one in zip(estimate.names, hidden, strict=True) if one]
    return replace(
        noted(estimate, *([f"not shown by these logs: {', '.join(names)}"] if names else [])),
        values=np.where(seen, estimate.values, np.nan),
        covariance=of_seen(estimate.covariance, seen),
        unseen=(*estimate.unseen, *names),
        fit=estimate.coefficients,
    )


@dataclass(frozen=True, eq=False)
class Context:
    """Data that some estimators need besides the observations."""

    target: IdentificationTarget
    prepared: tuple[PreparedLog, ...]  # one per log
    recipe: Recipe
    described: Mapping[str, float] = field(default_factory=dict)  # standard parameters as the description states
    commanded: Trajectory | None = None  # the motion that was played


class Estimator(ABC):
    """Method that estimates beta from ``y = W beta + e``.

    An estimator of your own is a subclass with `estimate`, given as ``estimator=Mine()``.

    Attributes
    ----------
    name : str
        As on the command line.
    holds_rows : bool
        True if `estimate` needs W of the observations as an array; False if it reads them in slices, so that W may be
        larger than the memory.
    """

    name: str = "own"
    holds_rows: bool = True

    @abstractmethod
    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """Estimate the parameters from observations.

        Parameters
        ----------
        observations : Observations
        context : Context, optional
            Data that they were computed from; not every estimator needs it.

        Raises
        ------
        InputError
            A required input is missing, or no estimate can be computed from the observations.
        """

    def check(self, commanded: Trajectory | None) -> None:
        """Raise `InputError`, before any log is read, if a required input is missing.

        Parameters
        ----------
        commanded : Trajectory or None
            The motion that was played, where it is known.
        """
        del commanded


TOLERANCE = 1e-10  # of the largest singular value of the columns scaled to length one, and of the longest column


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """Minimiser of ``||A beta - r||``, with its covariance factor and singular values."""

    values: Array  # (p,) minimum-norm solution with respect to the columns scaled to length one
    # (p, rank) factor of the covariance: ``half @ half.T`` is ``(A'A)^-1`` within the identifiable directions
    half: Array
    sizes: Array  # (p,) lengths of the columns of A; zero where a column counts as zero
    singular_values: Array  # (p,) of the columns scaled to length one
    directions: Array  # (p, p) right singular vectors in its rows, of the scaled columns
    rank: int
    square: float  # sum of the squared residuals
    size: float  # length of r


def solve_triangular_system(R: Array, tolerance: float = TOLERANCE) -> LinearSolution:
    """Solution from the triangular factor of ``[A r]``.

    Columns are scaled to length one and decomposed, ``A S^-1 = U diag(s) V'``; normal equations are never formed.
    """  # R (k, p + 1)
    A, r = R[:, :-1], R[:, -1]
    p = A.shape[1]
    sizes = np.linalg.norm(A, axis=0)
    sizes = np.where(sizes > tolerance * sizes.max(initial=0.0), sizes, 0.0)
    scaled = A * _inverse(sizes)
    U, s, V = np.linalg.svd(np.concatenate([scaled, np.zeros((max(p - A.shape[0], 0), p))]), full_matrices=False)
    rank = int(np.sum(s > tolerance * s[0])) if s[0] > 0 else 0
    half = _inverse(sizes)[:, None] * (V[:rank].T / s[:rank])
    values = half @ (U[: r.size, :rank].T @ r)
    square = float(np.sum((A @ values - r) ** 2))
    return LinearSolution(values, half, sizes, s, V, rank, square, float(np.linalg.norm(r)))


def _inverse(sizes: Array) -> Array:
    return np.asarray(np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0))


_NOTHING = 1e-6  # smallest singular value of a part of a parameter along unidentifiable directions
_MOST_OTHERS = 6  # in a combination that is written out
_VISIBLE = 1e-3  # smaller coefficients, of columns scaled to length one, are left out of a combination


def estimability(
    solution: LinearSolution, names: tuple[str, ...], variance: float, freedom: int
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Which parameters are identifiable, shape (p,), and the identifiable combinations of the others.

    A parameter is identifiable if its column is independent of the others, and if half of its 99 % confidence interval,
    as a contribution to y, is smaller than y itself: ``t sqrt(C_jj) ||W_j|| <= ||y||``. Neither side depends on units.
    """
    hidden = solution.directions[solution.rank :].T  # (p, p - rank), of the scaled columns
    seen = np.linalg.norm(hidden, axis=1) <= _NOTHING
    weak = np.zeros(len(names), dtype=bool)
    if solution.size > 0.0 and np.isfinite(variance):  # else there is nothing to compare with
        reach = float(scipy.special.stdtrit(max(freedom, 1), 0.5 + CONFIDENCE / 2)) * np.sqrt(variance)
        seen &= reach * np.linalg.norm(solution.half, axis=1) * solution.sizes <= solution.size
        weak = reach > solution.size * solution.singular_values
    weak[solution.rank :] = True
    return seen, _combinations(solution, names, seen, solution.directions[weak].T)


def _combinations(
    solution: LinearSolution, names: tuple[str, ...], seen: NDArray[np.bool_], hidden: Array
) -> tuple[str, ...]:
    """Identifiable combinations of unidentifiable parameters, orthogonal to the hidden directions, from the left."""
    texts = [f"{names[j]} does not influence the measurements" for j in np.flatnonzero(~seen & (solution.sizes == 0.0))]
    mixed = np.flatnonzero(~seen & (solution.sizes > 0.0))
    if mixed.size == 0:
        return tuple(texts)
    U, s, _ = np.linalg.svd(hidden[mixed], full_matrices=True)
    lost = int(np.sum(s > _NOTHING))
    shown = U[:, lost:].T  # rows that the data determines, of the columns scaled to length one
    index = independent_columns(shown, 1e-6)
    rows = np.asarray(np.linalg.solve(shown[:, index], shown)) if index.size else np.zeros((0, mixed.size))
    rows = np.where(np.abs(rows) > _VISIBLE, rows, 0.0)
    covered = np.flatnonzero(~np.any(rows != 0.0, axis=0))
    texts += [_lost(names[j]) for j in mixed[covered]]
    for row, k in zip(rows, index, strict=True):
        sizes, others = solution.sizes[mixed], np.count_nonzero(row) - 1
        text = _sum(row * sizes / sizes[k], [names[j] for j in mixed])
        if others > _MOST_OTHERS:
            text = f"a combination with {others} others"
        texts.append(f"{names[mixed[k]]} is identifiable only in {text}" if others else _lost(text))
    return tuple(texts)


def _lost(name: str) -> str:
    return f"{name} is not identifiable above the noise"


def _sum(row: Array, names: list[str]) -> str:
    """Text of a combination, its leading coefficient one."""
    text = ""
    for k in np.flatnonzero(row):
        size = abs(float(row[k]))
        term = names[k] if abs(size - 1.0) < 1e-6 else f"{size:.6g} {names[k]}"
        join = (" - " if row[k] < 0 else " + ") if text else ("-" if row[k] < 0 else "")
        text += join + term
    return text


def stated_estimate(
    method: str,
    observations: Observations,
    solution: LinearSolution,
    variance: float,
    values: Array,
    covariance: Array,
    noise: Array,
    notes: tuple[str, ...] = (),
) -> Estimate:
    """Estimate of the identifiable parameters: NaN and infinite variance for the others, which the notes name."""
    # values (p,); covariance (p, p); noise (groups,)
    freedom = observations.y.size - solution.rank
    seen, combinations = estimability(solution, observations.names, variance, freedom)
    names, units, fit = observations.names, observations.units, np.asarray(values, dtype=float)
    unseen = tuple(name for name, one in zip(names, seen, strict=True) if not one)
    noise = np.asarray(noise, dtype=float).reshape(len(observations.logs), len(observations.equations))
    values, covariance, notes = np.where(seen, values, np.nan), of_seen(covariance, seen), (*notes, *combinations)
    return Estimate(method, names, units, values, covariance, noise, freedom, unseen, notes, fit=fit)
