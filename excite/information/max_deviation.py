"""MV-optimality: minimise the variance of the least accurate single parameter [Elfving 1959].

With equal noise of variance s^2 in the N rows, the covariance of the parameters is ``s^2/N M^-1``; the criterion is the
root of its largest diagonal entry without ``s^2/N``. It is between the mean of the variances (A-optimality) and the
largest variance of any combination (E-optimality), and like these it depends on the units of the parameters. The smooth
approximations are the p-means of variances, of Kiefer's family [Pukelsheim 2006, chapter 6].

[Elfving 1959] G. Elfving, "Design of linear experiments", in: Probability and Statistics, The Harald Cramer Volume.
[Pukelsheim 2006] F. Pukelsheim, "Optimal Design of Experiments", SIAM.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.special

from excite.information.criteria import Criterion
from regressors.samples import Array

_FLOOR = 1e-300


class MaxDeviation(Criterion):
    """Largest standard deviation of any single parameter, ``sqrt(max_k (M^-1)_kk)``.

    The approximation ``(1/2p) log sum_k ((M^-1)_kk)^p`` is never below its logarithm, and tends to it as p grows; p = 1
    is A-optimality.
    """

    name = "max-deviation"
    stages = (1.0, 4.0, 16.0, 64.0)

    def value(self, M: Array) -> float:
        """``sqrt(max_k (M^-1)_kk)``; infinite if singular."""
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False)
        return float(np.sqrt((V**2 @ (1 / eigenvalues)).max())) if eigenvalues[0] > 0 else np.inf

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """The smooth approximation of the class, with ``G = -(1/2) sum_k (w_k / v_k) c_k c_k'``.

        v_k is entry k of the diagonal of ``M^-1``, c_k its column k, and ``w_k = v_k^p / sum v^p``.
        """
        eigenvalues, V = scipy.linalg.eigh(M, check_finite=False, driver="evd")
        half = V / np.sqrt(np.maximum(eigenvalues, _FLOOR))  # M^-1 = half half'
        deviation = np.linalg.norm(half, axis=1)
        powers = 2 * sharpness * np.log(deviation)
        C = half @ (half / deviation[:, None]).T  # c_k over the deviation of parameter k, in column k
        value = float(scipy.special.logsumexp(powers)) / (2 * sharpness)
        return value, np.asarray(-0.5 * (C * scipy.special.softmax(powers)) @ C.T)
