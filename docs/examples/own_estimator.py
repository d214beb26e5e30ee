"""An estimator of one's own: least absolute deviations, ``min sum_i |y_i - w_i beta|``, which outliers move little.

Solved by iteratively reweighted least squares with the weights ``1 / |e_i|``.

From the command line: ``excite identify irp6 run.csv --estimator own_estimator:LeastAbsolute --out results/lad`` in
this folder.
"""

import numpy as np

import excite


class LeastAbsolute(excite.Estimator):
    """The maximum of likelihood where the noise has Laplace's distribution.

    Parameters
    ----------
    iterations : int
    """

    name = "least-absolute"

    def __init__(self, iterations=50):
        self.iterations = iterations

    def estimate(self, observations, context=None):
        """Estimate with the covariance ``b^2 (W'W)^-1``, b the mean absolute residual."""
        W, y = observations.W, observations.y
        root = np.ones(len(y))
        for _ in range(self.iterations):
            beta = np.linalg.lstsq(W * root[:, None], y * root)[0]
            size = np.abs(y - W @ beta)
            root = 1.0 / np.sqrt(np.maximum(size, 1e-6 * size.max()))
        scale = float(np.mean(size))
        return excite.Estimate(
            method=self.name,
            names=observations.names,
            units=observations.units,
            values=beta,
            covariance=scale**2 * np.linalg.inv(W.T @ W),
            noise=np.full((len(observations.logs), len(observations.equations)), np.sqrt(2.0) * scale),
            degrees_of_freedom=len(y) - len(beta),
        )


if __name__ == "__main__":
    design = excite.design_trajectory("irp6", search=excite.Search(starts=1))
    log = excite.simulate(design, noise=1.0, seed=1)
    for estimator in ("least-squares", LeastAbsolute()):
        result = excite.identify("irp6", log, design=design, estimator=estimator)
        print(result.estimate.method, np.round(result.coefficients[:4], 4))
