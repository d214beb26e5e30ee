"""What a robot's description says of its standard parameters, with a relative uncertainty.

Of a body with the pseudo-inertia ``J0 = T T'`` the difference ``E = T^-1 (J - J0) T'^-1`` has independent normal
entries, those of its diagonal with the standard deviation r, the others with ``r / sqrt 2``: then ``-log p`` is
``tr((J0^-1 (J - J0))^2) / (2 r)^2``, which depends neither on units nor on the frame [Lee, Wensing, Park 2020, whose
entropic divergence it is to second order, times ``1 / (2 r^2)``]. The mass has the relative deviation r, the second
moments too, and the centre of mass moves by 0.7 r of the body's root mean square extent in each direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.estimators.standard import StandardProblem
from regressors.robot.inertia import from_pseudo_inertia
from regressors.samples import Array

UNDESCRIBED = 1.0  # relative deviation of what the description does not state


@dataclass(frozen=True, eq=False)
class DescribedPrior:
    """Normal distribution of the free standard parameters phi, ``theta = S phi``."""

    mean: Array  # (f,)
    half: Array  # (f, f) A factor of the covariance, ``half @ half.T``


def described_prior(standard: StandardProblem, relative: float, stated: frozenset[str]) -> DescribedPrior:
    """Prior of the free parameters."""
    inverse = np.diag(1 / (standard.scale * _relative(standard, relative, stated)))
    for body in standard.bodies:
        r = relative if all(standard.names[k] in stated for k in body.index) else UNDESCRIBED
        inverse[np.ix_(body.index, body.index)] = np.linalg.inv(_half_of_body(body.reference, r))
    R = np.linalg.qr(inverse @ standard.S, mode="r")  # the structure's zeros and equalities hold exactly
    mean = np.linalg.lstsq(inverse @ standard.S, inverse @ standard.prior, rcond=None)[0]
    return DescribedPrior(np.asarray(mean), np.asarray(np.linalg.inv(R)))


def _relative(standard: StandardProblem, relative: float, stated: frozenset[str]) -> Array:
    return np.array([relative if name in stated else max(relative, UNDESCRIBED) for name in standard.names])


def _half_of_body(J: Array, relative: float) -> Array:
    """Change of the ten parameters per unit of each entry of E, shape (10, 10)."""
    T, columns = np.linalg.cholesky(J), []
    for i, j in zip(*np.triu_indices(4), strict=True):
        E = np.zeros((4, 4))
        E[i, j] = E[j, i] = relative if i == j else relative / np.sqrt(2)
        columns.append(from_pseudo_inertia(T @ E @ T.T))
    return np.column_stack(columns)
