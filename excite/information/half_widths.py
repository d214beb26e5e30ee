"""Half-widths of confidence intervals as predicted before the measurement.

The interval of an estimate is ``t(level, f) s_j`` to both sides, with ``s_j = sqrt(C_jj) sigma / sigma_0``: C is the
covariance for the stated noise sigma_0, and sigma is estimated from the residuals, ``f sigma^2 / sigma_0^2 ~ chi2(f)``.
The half-width is therefore random itself; with a probability p that of every parameter at once is at most

    h_j = t((1 + level) / 2, f) sqrt(chi2(p, f) / f) sqrt(C_jj)

since one sigma is common to all. This is for noise that is independent from instant to instant.
"""

from __future__ import annotations

import numpy as np
import scipy.special

from regressors.samples import Array

LEVEL, PROBABILITY = 0.99, 0.95
ROWS_PER_DEGREE = 4  # effective rows of an equation, whose spectrum is estimated at the motion's frequencies alone
FEWEST_DEGREES = 3


def residual_degrees_of_freedom(rows: float, parameters: int, equations: int) -> int:
    """Degrees of freedom f of the noise that identification estimates from residuals.

    A quarter of the rows of each equation, less the parameters, at least 3: what `excite.identify` counts for its
    robust covariance, where the spectrum of the noise is estimated too.
    """
    return max(FEWEST_DEGREES, int((rows - parameters) / (ROWS_PER_DEGREE * equations)))


def half_width_factor(degrees_of_freedom: int, *, level: float = LEVEL, probability: float = PROBABILITY) -> float:
    """Half-width over standard deviation that is not exceeded with a probability, ``t sqrt(chi2 / f)``."""
    f = degrees_of_freedom
    t, chi2 = scipy.special.stdtrit(f, 0.5 + 0.5 * level), scipy.special.chdtri(f, 1.0 - probability)
    return float(t * np.sqrt(chi2 / f))


def half_widths(
    factor: Array, degrees_of_freedom: int, *, level: float = LEVEL, probability: float = PROBABILITY
) -> Array:
    """Predicted half-width of each parameter's confidence interval, h of the module, shape (b,)."""  # factor (b, k)
    scale = half_width_factor(degrees_of_freedom, level=level, probability=probability)
    return np.asarray(scale * np.linalg.norm(factor, axis=1))
