"""A trajectory family of one's own: Fourier series of odd harmonics only, ``q(t) = c + sum_k odd a_k cos + b_k sin``.

Without even harmonics the second half of the motion mirrors the first, ``q(t + T/2) - c = -(q(t) - c)``: every speed
and acceleration is used in both directions. Only the coefficients are fewer; limits, extrema and files are those of
`excite.Fourier`.

From the command line: ``excite design irp6 --trajectory own_trajectory:OddFourier --out designs/odd`` in this folder.
"""

import numpy as np
import scipy.linalg

import excite


class OddFourier(excite.Fourier):
    """The harmonics 1, 3, 5 ... of as many as a Fourier series has.

    Parameters
    ----------
    period : float
        [s]
    harmonics : int
        Highest harmonic, at least 3.
    """

    name = "odd-fourier"

    def __init__(self, period, harmonics):
        super().__init__(period, harmonics)
        order = np.arange(1, harmonics + 1)
        even = np.concatenate([[False], order % 2 == 0, order % 2 == 0])  # of c, a_1 ... a_K, b_1 ... b_K
        self._Z = self._Z @ scipy.linalg.null_space(self._Z[even])  # of the motions at rest at both ends
        self.size = self._Z.shape[1]


if __name__ == "__main__":
    for trajectory in (OddFourier(10, 7), excite.Fourier(10, 4)):
        design = excite.design_trajectory("irp6", trajectory, search=excite.Search(starts=1))
        print(design, f"{trajectory.size} coefficients per joint", "feasible" if design.feasible else "not feasible")
