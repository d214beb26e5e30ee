"""Total least squares: errors in the regressor too [Golub, Van Loan 1980], [Van Huffel, Vandewalle 1991]."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.estimators.least_squares import GroupWeights, weighting
from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.numerical import independent_columns
from regressors.samples import Array


def total(observations: Observations, ratio: float = 1.0, column_noise: Array | None = None) -> Estimate:
    """Smallest change of both sides, ``min ||[dW N^-1, dy]||`` with ``(W + dW) beta = y + dy``.

    Rows are divided by their noise, column j by its own ``nu_j``: the standard deviation of its errors where that of y
    is one. Columns with ``nu_j = 0`` are exact (mixed least squares and total least squares). The solution is the
    singular vector of the smallest singular value of ``[W N^-1, y]``; the covariance is the large-sample one,
    ``s^2 (1 + |x|^2) (D^-1 + sigma^2 D^-1 (E + x x')^-1 D^-1)`` with ``x = N beta``, ``D = N^-1 W'W N^-1 - sigma^2 E``,
    sigma the smallest singular value, ``s^2 = sigma^2 / (m - p)`` [Gleser 1981].
    """  # column_noise (p,)
    problem = weighting(observations)
    nu, note = _column_noise(observations, problem, ratio, column_noise)
    R, p = problem.R, observations.W.shape[1]
    index = independent_columns(R[:, :-1])
    x, C, variance = _minimiser(R[:, [*index, p]], nu[index], problem.freedom)
    values, covariance = np.zeros(p), np.zeros((p, p))
    values[index] = x
    covariance[np.ix_(index, index)] = C
    return problem.stated("total", observations, variance, values, covariance, (note, *problem.notes))


def _column_noise(
    observations: Observations, problem: GroupWeights, ratio: float, given: Array | None
) -> tuple[Array, str]:
    p = observations.W.shape[1]
    if given is not None:
        nu = np.asarray(given, dtype=float)
        if nu.shape != (p,) or not np.all(np.isfinite(nu) & (nu >= 0)):
            raise InputError(f"column_noise must be {p} numbers of zero or more, given {nu.tolist()}")
        return nu, "errors of the columns over those of y as given"
    if not (np.isfinite(ratio) and ratio >= 0):
        raise InputError(f"ratio must be zero or more, given {ratio}")
    size = problem.solution.size
    nu = ratio * np.linalg.norm(problem.R[:, :-1], axis=0) / size if size > 0 else np.zeros(p)
    return nu, f"relative error of every column {ratio:g} times that of y"


def _minimiser(R: Array, nu: Array, freedom: int) -> tuple[Array, Array, float]:
    """Parameters, covariance, variance of y's errors, from the factor of ``[W y]`` with independent columns."""
    p = nu.size
    order = np.argsort(nu > 0, kind="stable")  # exact columns first: projected out by the triangular form
    exact = int(np.sum(nu == 0))
    unit = np.where(nu > 0, nu, 1.0)[order]
    T = np.asarray(np.linalg.qr(np.column_stack([R[:, order] / unit, R[:, -1]]), mode="r"))
    inner = T[exact:, exact:]
    _, s, V = np.linalg.svd(np.concatenate([inner, np.zeros((max(p + 1 - exact - len(inner), 0), p + 1 - exact))]))
    sigma, v = s[-1], V[-1]
    gap = s[-2] if s.size > 1 else np.inf
    if abs(v[-1]) < 1e-12 or (sigma > 0 and gap <= sigma * (1 + 1e-9)):
        raise InputError("total least squares has no unique solution: the columns' errors are as large as the columns")
    x = np.zeros(p)
    x[exact:] = -v[:-1] / v[-1]
    x[:exact] = scipy.linalg.solve_triangular(T[:exact, :exact], T[:exact, p] - T[:exact, exact:p] @ x[exact:])
    variance = sigma**2 / freedom if freedom > 0 else np.nan
    back = np.zeros(p, dtype=np.intp)
    back[order] = np.arange(p)
    covariance = _covariance(T[:, :p], x, exact, sigma**2, variance)
    covariance = (covariance / np.outer(unit, unit))[np.ix_(back, back)]
    return (x / unit)[back], covariance, variance


def _covariance(T: Array, x: Array, exact: int, square: float, variance: float) -> Array:
    if np.isnan(variance):
        return np.diag(np.full(x.size, np.inf))
    noisy = np.arange(x.size) >= exact
    D = np.linalg.inv(T.T @ T - square * np.diag(noisy.astype(float)))
    z = x[exact:]
    inner = np.eye(z.size) - np.outer(z, z) / (1 + z @ z)  # (E + x x')^-1
    columns = D[:, exact:]
    return np.asarray(variance * (1 + z @ z) * (D + square * columns @ inner @ columns.T))


class Total(Estimator):
    """Weighted total least squares, with errors in the regressor as well."""

    name = "total"
    holds_rows = False

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `total`."""
        return total(observations)
