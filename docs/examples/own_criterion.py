"""A criterion of one's own: the variance of some parameters only, whatever becomes of the others.

With M = [[A, B], [B', C]], A that of the wanted parameters, their covariance is the inverse of the Schur complement
``S = A - B C^-1 B'``; minimised is the trace of its inverse, the block of M^-1.

From the command line: ``excite design irp6 --criterion own_criterion:FirstThree --out designs/first`` in this folder.
"""

import numpy as np

import excite


class VarianceOfSome(excite.Criterion):
    """``sqrt(tr (M^-1)_ww)`` of the wanted columns w."""

    name = "variance-of-some"
    stages = (1.0,)

    def __init__(self, wanted):
        self.wanted = list(wanted)

    def value(self, M):
        """The square root of the sum of their variances."""
        return float(np.sqrt(np.trace(np.linalg.inv(M)[np.ix_(self.wanted, self.wanted)])))

    def smooth(self, M, sharpness):
        """Half its logarithm, and the gradient ``-(1/2t) M^-1 E E' M^-1`` with the unit columns E of the wanted."""
        inverse = np.linalg.inv(M)
        E = np.eye(len(M))[:, self.wanted]
        trace = float(np.trace(E.T @ inverse @ E))
        return 0.5 * np.log(trace), -0.5 / trace * inverse @ E @ E.T @ inverse


class FirstThree(VarianceOfSome):
    """Of the first three base parameters."""

    def __init__(self):
        super().__init__(range(3))


if __name__ == "__main__":
    for criterion in ("trace", VarianceOfSome([0, 1, 2])):
        design = excite.design_trajectory("irp6", criterion=criterion, search=excite.Search(starts=1))
        deviations = [prediction.standard_deviation for prediction in design.predicted]
        print(criterion if isinstance(criterion, str) else criterion.name, np.round(deviations[:3], 4))
