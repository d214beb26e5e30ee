"""Ridge regression of noise-weighted rows [Hoerl, Kennard 1970], its weight by generalised cross-validation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.estimators.least_squares import GroupWeights, scaled_covariance, weighting
from excite.identification.observations import Observations
from regressors.errors import InputError, UnknownName
from regressors.models.nominal import parameter_values, standard_values
from regressors.samples import Array

TOWARDS = ("description", "zero")
_LEAST, _MOST = 1e-14, 1e4  # weights that are tried
_GRID = 200


def ridge(observations: Observations, weight: float | None = None, reference: Array | None = None) -> Estimate:
    """Minimiser of ``||Sigma^-1/2 (y - W beta)||^2 + weight ||S (beta - beta_0)||^2``.

    Rows are divided by their noise, as by `excite.identification.estimators.least_squares.weighted`; S has the lengths
    of the resulting columns, so that the weight has no unit and units of parameters do not matter. With
    ``Sigma^-1/2 W S^-1 = U diag(s) V'`` the shrinkage factors are ``f = s^2 / (s^2 + weight)``, and the covariance, of
    the noise alone, is ``S^-1 V diag(f^2 / s^2) V' S^-1``: the bias ``S^-1 V diag(1 - f) V' S (beta_0 - beta)`` is not
    in it. If no weight is given, it minimises ``||e||^2 / (m - sum f)^2`` with the residuals e of the m rows [Golub,
    Heath, Wahba 1979].
    """  # reference (p,)
    if weight is not None and not (np.isfinite(weight) and weight >= 0):
        raise InputError(f"ridge: the weight must be zero or a positive number, given {weight}")
    p = observations.W.shape[1]
    reference = np.zeros(p) if reference is None else np.asarray(reference, dtype=float)
    if reference.shape != (p,) or not np.all(np.isfinite(reference)):
        raise InputError(f"ridge: the reference must be {p} finite numbers, given {reference.tolist()}")
    problem = weighting(observations)
    spectrum = _Spectrum.of(problem, reference)
    how = "as given" if weight is not None else "by generalised cross-validation"
    weight = spectrum.best_weight() if weight is None else weight
    factors = spectrum.factors(weight)
    values = reference + spectrum.back @ (factors * spectrum.coordinates)
    covariance = scaled_covariance(spectrum.back * factors, problem.variance)
    notes = (
        f"weight {weight:.3g}, {how}: {factors.sum():.4g} effective parameters of {p}",
        "intervals are those of the noise alone: they ignore the bias that the pull causes",
        *problem.notes,
    )
    return problem.stated("ridge", observations, problem.variance, values, covariance, notes)


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """The problem in the singular vectors of its columns, scaled to length one, about the reference."""

    s: Array  # singular values that count, shape (rank,)
    coordinates: Array  # of the least-squares solution along the singular directions, in standard deviations
    back: Array  # from these to the parameters, shape (p, rank)
    left: float  # squared residual of least squares
    rows: int

    @classmethod
    def of(cls, problem: GroupWeights, reference: Array) -> _Spectrum:
        solution = problem.solution
        s = solution.singular_values[: solution.rank]
        A, r = problem.R[:, :-1], problem.R[:, -1]
        coordinates = (A @ solution.half).T @ (r - A @ reference)
        return cls(s, coordinates, solution.half, solution.square, problem.factors.rows)

    def factors(self, weight: float) -> Array:
        """Shrinkage factors, shape (rank,)."""
        return np.asarray(self.s**2 / (self.s**2 + weight))

    def best_weight(self) -> float:
        """Minimum of the cross-validation function, on a logarithmic grid and then between its neighbours."""
        grid = np.linspace(np.log(_LEAST), np.log(_MOST), _GRID)
        score: Callable[[float], float] = lambda logarithm: self._score(float(np.exp(logarithm)))  # noqa: E731
        k = int(np.argmin([score(logarithm) for logarithm in grid]))
        ends = grid[max(k - 1, 0)], grid[min(k + 1, _GRID - 1)]
        return float(np.exp(scipy.optimize.minimize_scalar(score, bounds=ends, method="bounded").x))

    def _score(self, weight: float) -> float:
        factors = self.factors(weight)
        square = self.left + float(np.sum(((1 - factors) * self.coordinates) ** 2))
        return square / (self.rows - float(factors.sum())) ** 2


class Ridge(Estimator):
    """Weighted least squares with a pull towards the described values, or towards zero.

    Parameters
    ----------
    weight : float, optional
        Of the pull, relative to the squared length of a column over the noise; by generalised cross-validation if not
        given.
    towards : {"description", "zero"}
        What the parameters are pulled to: the values of the robot's description, where it states them, or zero.

    Raises
    ------
    UnknownName
        `towards` is neither of the two.
    """

    name = "ridge"
    holds_rows = False

    def __init__(self, weight: float | None = None, towards: str = "description") -> None:
        if towards not in TOWARDS:
            raise UnknownName("value to pull towards", towards, TOWARDS)
        self.weight, self.towards = weight, towards

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `ridge`; the pull is towards zero without a context."""
        if context is None or self.towards == "zero":
            return ridge(observations, self.weight)
        target = context.target  # its robot, whose locked links are merged into others
        described = parameter_values(target.model, target.base, standard_values(target.robot))
        return ridge(observations, self.weight, np.nan_to_num(described, nan=0.0))
