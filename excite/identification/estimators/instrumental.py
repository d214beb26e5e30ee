"""Instrumental variables: unbiased where the measured regressor itself is noisy [Janot, Vandanjon, Gautier 2014]."""

from __future__ import annotations

import numpy as np

from excite.identification.commanded import instruments
from excite.identification.estimability import estimability, shown_estimate
from excite.identification.estimate import Estimate
from excite.identification.estimator import TOLERANCE, Context, Estimator, LinearSolution, solve_triangular_system
from excite.identification.estimators.least_squares import residual_noise, scaled_covariance
from excite.identification.observations import GroupFactors, Observations
from excite.identification.weights import weighting
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.samples import Array

_ITERATIONS = 200
_SETTLED = 1e-9  # relative change of the noise
_FLOOR = 1e-11


def instrumental(observations: Observations, instruments: Array) -> Estimate:
    """Instrumental-variable estimate ``beta = (Z' Sigma^-1 W)^-1 Z' Sigma^-1 y``.

    The triangular factor of ``[Z W y]`` holds ``Q'W`` and ``Q'y`` of ``Z = Q T`` in its first rows; with them
    ``beta = (Q'W)^-1 Q'y`` has the covariance ``(Q'W)^-1 (Q'W)^-T``, rows divided by their noise. The noise of
    each group is that of its residuals at this estimate, iterated until it converges.
    """  # instruments (m, p)
    Z = np.asarray(instruments, dtype=float)
    if Z.shape != observations.W.shape:
        raise InputError(f"instruments have shape {Z.shape}, the observations' W has {observations.W.shape}")
    if not np.all(np.isfinite(Z)):
        raise InputError("instruments must hold finite numbers")
    factors = GroupFactors.of(observations, front=Z)
    start = weighting(observations, factors)
    spare = np.maximum(factors.count * (1 - start.solution.rank / factors.rows), 1e-6 * factors.count + 1e-300)
    scale, solution = start.scale, _projected(factors.stacked(start.scale))
    floor = _FLOOR * np.where(factors.sizes() > 0, factors.sizes(), 1.0)
    for _ in range(_ITERATIONS if observations.noise is None else 0):
        noise = np.maximum(np.sqrt(factors.squares(solution.values) / spare), floor)
        change = float(np.abs(np.log(noise / scale)).max())
        scale, solution = noise, _projected(factors.stacked(noise))
        if change < _SETTLED:
            break
    freedom = factors.rows - solution.rank
    variance = 1.0 if freedom > 0 or observations.noise is not None else np.nan
    return shown_estimate(
        "instrumental",
        observations,
        estimability(solution, observations.names, variance, freedom),
        solution.values,
        scaled_covariance(solution.half, variance),
        residual_noise(observations, factors, solution.values, factors.count - spare),
        freedom,
        ("instruments taken as free of the noise of the rows", start.notes[0]),
    )


def _projected(R: Array) -> LinearSolution:
    """Solution of ``Q'W beta = Q'y``, Q an orthonormal basis of the instruments, from the factor of ``[Z W y]``."""
    p = R.shape[1] // 2
    T = R[:p, :p]
    sizes = np.linalg.norm(T, axis=0)
    U, s, _ = np.linalg.svd(T / np.where(sizes > 0, sizes, 1.0))
    basis = U[:, s > TOLERANCE * s[0]]
    return solve_triangular_system(basis.T @ R[:p, p:])


class Instrumental(Estimator):
    """Instrumental variables: the regressor along the commanded motion, for noisy measured ones."""

    name = "instrumental"

    def check(self, commanded: Trajectory | None) -> None:
        """Check that the commanded motion is known."""
        if commanded is None:
            raise InputError("the estimator instrumental needs the commanded motion: name the `design` that was played")

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `instrumental`."""
        commanded = None if context is None else context.commanded
        self.check(commanded)
        assert context is not None
        assert commanded is not None
        Z = instruments(commanded, context.target, context.prepared, context.recipe)
        return instrumental(observations, Z)
