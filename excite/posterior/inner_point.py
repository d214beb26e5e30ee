"""Where samples begin: a possible robot near the middle of the posterior, by two conic programs."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse

from excite.errors import ConicSolverError
from excite.identification.estimators.possible_set import PossibleSet, conic_solution, nearest, possible_set
from excite.identification.estimators.standard import StandardProblem
from excite.posterior.posterior_coordinates import PosteriorCoordinates
from regressors.samples import Array

SHARE = 1e-3  # of its described pseudo-inertia that every body keeps


@dataclass(frozen=True, eq=False)
class InnerPoint:
    """A point of a possible set."""

    z: Array  # (d,) inside, as far from all bounds as possible within the posterior's usual distance
    nearest: Array  # (d,) the possible point nearest the posterior's mean without bounds, to the solver's tolerance


def inner_point(possible: PossibleSet) -> InnerPoint:
    """Find a point to begin with.

    ``min |z|`` subject to the bounds; then ``max s`` subject to slack s of all bounds and
    ``|z|^2 <= |z_nearest|^2 + d``.
    """
    d = possible.size
    closest, _ = nearest(possible)
    radius = np.sqrt(float(closest @ closest) + d)
    ball = np.vstack([np.zeros(d + 1), np.hstack([-np.eye(d), np.zeros((d, 1))])])
    most = np.append(np.zeros(d), 1.0)[None]
    further = [
        (ball, np.append(radius, np.zeros(d)), clarabel.SecondOrderConeT(d + 1)),
        (most, np.ones(1), clarabel.NonnegativeConeT(1)),
    ]
    linear = scipy.sparse.csc_matrix((d + 1, d + 1))
    inside, _ = conic_solution(possible, linear, np.append(np.zeros(d), -1.0), [*possible.blocks(slack=True), *further])
    z = inside[:d]
    if not possible.contains(z[None])[0]:
        raise ConicSolverError("samples of the posterior: no possible robot is near the identified one")
    return InnerPoint(z, closest)


def coordinates_inside(
    standard: StandardProblem, coordinates: PosteriorCoordinates, share: float = SHARE
) -> PossibleSet:
    """Possible robots in the coordinates of a posterior.

    Every body keeps a share of its described pseudo-inertia, ``J_i(z) - share J0_i > 0``, so that no sample is flat to
    rounding; in the body's own scale, ``T^-1 (J_i - share J0_i) T'^-1 > 0`` with ``J0 = T T'``.
    """
    lowest = [share * body.reference for body in standard.bodies]
    scaling = [np.linalg.inv(np.linalg.cholesky(body.reference)) for body in standard.bodies]
    return possible_set(standard, coordinates.origin, coordinates.slope, lowest, scaling)
