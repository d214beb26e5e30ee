"""An estimator of one's own: ridge regression, ``beta = (W'W + lambda D)^-1 W'y``.

From the command line: ``excite identify irp6 run.csv --estimator own_estimator:Ridge --out results/ridge`` in this
folder.
"""

import numpy as np

import excite


class Ridge(excite.Estimator):
    """Least squares with a small pull of every parameter towards zero, in units of its column.

    Parameters
    ----------
    weight : float
        lambda, relative to the squared length of a column.
    """

    name = "ridge"

    def __init__(self, weight=1e-6):
        self.weight = weight

    def estimate(self, observations, context=None):
        """Estimate with the covariance of white residuals."""
        W, y = observations.W, observations.y
        normal = W.T @ W
        inverse = np.linalg.inv(normal + self.weight * np.diag(np.diag(normal)))
        beta = inverse @ W.T @ y
        freedom = len(y) - len(beta)
        variance = float(np.sum((y - W @ beta) ** 2)) / freedom
        noise = np.full((len(observations.logs), len(observations.equations)), np.sqrt(variance))
        return excite.Estimate(
            method=self.name,
            names=observations.names,
            units=observations.units,
            values=beta,
            covariance=variance * inverse @ normal @ inverse,
            noise=noise,
            degrees_of_freedom=freedom,
        )


if __name__ == "__main__":
    design = excite.design_trajectory("irp6", search=excite.Search(starts=1))
    log = excite.simulate(design, noise=1.0, seed=1)
    for estimator in ("least-squares", Ridge(1e-3)):
        result = excite.identify("irp6", log, design=design, estimator=estimator)
        print(result.estimate.method, np.round(result.coefficients[:4], 4))
