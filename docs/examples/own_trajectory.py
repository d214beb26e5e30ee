"""A trajectory family of one's own: one polynomial of high degree per joint, ``q(t) = sum_k c_k T_k(2 t / T - 1)``.

T_k are Chebyshev's polynomials; the motion is at rest at both ends, at the same pose. Limits hold over continuous time:
on the grid they are tightened by `grid_factor`, a proven factor for polynomials, and `extrema` are exact.

From the command line: ``excite design irp6 --trajectory own_trajectory:Polynomial --out designs/polynomial`` in this
folder; the degree is four times --harmonics, and five more.
"""

import numpy as np
import numpy.polynomial.chebyshev as chebyshev
import scipy.linalg

import excite
from constraints.bounds.piecewise import chebyshev_extrema, chebyshev_nodes, chebyshev_points, node_factor


class Polynomial(excite.LinearFamily):
    """Polynomials of degree ``4 harmonics + 5``, about as rich as a Fourier series of so many harmonics.

    Parameters
    ----------
    period : float
        [s]
    harmonics : int
    """

    name = "polynomial"

    def __init__(self, period, harmonics):
        self.duration, self.harmonics, self.degree = float(period), harmonics, 4 * harmonics + 5
        ends = np.array([0.0, self.duration])
        rest = [np.diff(self.terms(ends, 0), axis=0), self.terms(ends, 1), self.terms(ends, 2)]
        weight = 1.0 / np.maximum(np.arange(self.degree + 1), 1)  # equal coefficients mean about equal velocities
        self._Z = weight[:, None] * scipy.linalg.null_space(np.vstack(rest) * weight)
        self.size = self._Z.shape[1]

    def terms(self, time, derivative):
        """Chebyshev's polynomials or their derivatives, shape (N, degree + 1)."""
        series = chebyshev.chebder(np.eye(self.degree + 1), m=derivative) if derivative else np.eye(self.degree + 1)
        rate = 2.0 / self.duration
        return chebyshev.chebval(rate * np.asarray(time) - 1.0, series).T * rate**derivative

    def basis(self, time, derivative):
        """Values of the free basis functions, shape (N, size)."""
        return self.terms(time, derivative) @ self._Z

    @property
    def constant(self):
        """Coefficients of the motion that rests at position 1."""
        return self.from_coefficients(np.eye(1, self.degree + 1)[0])

    @property
    def richness(self):
        """About as many harmonics."""
        return self.harmonics

    @property
    def described(self):
        """In words."""
        return f"polynomials of degree {self.degree}"

    def grid(self, count):
        """Instants at which limits are imposed [s]."""
        return chebyshev_nodes(count, 0.0, self.duration)

    def grid_factor(self, count, derivative):
        """What stays within this part of a bound on the grid stays within the bound everywhere."""
        return node_factor(self.degree, count)

    def extrema(self, x, derivative):
        """Exact, from the roots of the derivative."""
        points = chebyshev_points(self.degree + 1, self.duration)
        return chebyshev_extrema(self.basis(points, derivative) @ x.T, self.duration)


if __name__ == "__main__":
    for trajectory in (Polynomial(10, 5), excite.Fourier(10, 5)):
        design = excite.design_trajectory("irp6", trajectory, search=excite.Search(starts=1))
        print(design, "feasible" if design.feasible else "not feasible")
