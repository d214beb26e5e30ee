"""Where samples begin: a possible robot near the middle of the posterior, by two conic programs."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse

from excite.errors import ConicSolverError
from excite.posterior.possible_set import PossibleSet
from regressors.samples import Array

_ROWS, _COLUMNS = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T  # upper triangle, column by column
_WEIGHT = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2.0))
_SOLVED = ("Solved", "AlmostSolved")


@dataclass(frozen=True, eq=False)
class InnerPoint:
    """A point of a possible set.

    Parameters
    ----------
    z : ndarray, shape (d,)
        Inside, as far from all bounds as possible within the posterior's usual distance.
    nearest : ndarray, shape (d,)
        The possible point nearest the posterior's mean without bounds, to the solver's tolerance.
    """

    z: Array
    nearest: Array


def inner_point(possible: PossibleSet) -> InnerPoint:
    """Find a point to begin with.

    ``min |z|`` subject to the bounds; then ``max s`` subject to slack s of all bounds and
    ``|z|^2 <= |z_nearest|^2 + d``.

    Parameters
    ----------
    possible : PossibleSet

    Raises
    ------
    ConicSolverError
        The conic solver found no point.
    """
    d = possible.size
    square = np.diag(np.append(np.ones(d), 1.0))
    nearest = _solution(possible, square, np.zeros(d + 1), 0.0, [])
    radius = np.sqrt(float(nearest[:d] @ nearest[:d]) + d)
    ball = np.vstack([np.zeros(d + 1), np.hstack([-np.eye(d), np.zeros((d, 1))])])
    most = np.append(np.zeros(d), 1.0)[None]
    further = [
        (ball, np.append(radius, np.zeros(d)), clarabel.SecondOrderConeT(d + 1)),
        (most, np.ones(1), clarabel.NonnegativeConeT(1)),
    ]
    inside = _solution(possible, np.zeros((d + 1, d + 1)), np.append(np.zeros(d), -1.0), 1.0, further)
    z = inside[:d]
    if not possible.contains(z[None])[0]:
        raise ConicSolverError("samples of the posterior: no possible robot is near the identified one")
    return InnerPoint(z, nearest[:d])


def _solution(
    possible: PossibleSet, P: Array, q: Array, slack: float, further: list[tuple[Array, Array, object]]
) -> Array:
    """Coordinates and slack, shape (d + 1,)."""
    rows, rights, cones = [], [], []
    for M, B in zip(possible.M, possible.B, strict=True):
        unit = slack * _WEIGHT * np.eye(4)[_ROWS, _COLUMNS]
        rows.append(np.column_stack([-_WEIGHT[:, None] * B[_ROWS, _COLUMNS], unit]))
        rights.append(_WEIGHT * M[_ROWS, _COLUMNS])
        cones.append(clarabel.PSDTriangleConeT(4))
    if possible.c.size:
        rows.append(np.column_stack([-possible.b, np.full(possible.c.size, slack)]))
        rights.append(possible.c)
        cones.append(clarabel.NonnegativeConeT(possible.c.size))
    for A, right, cone in further:
        rows.append(A)
        rights.append(right)
        cones.append(cone)
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    matrix = scipy.sparse.csc_matrix(np.concatenate(rows))
    upper = scipy.sparse.triu(scipy.sparse.csc_matrix(P), format="csc")
    solution = clarabel.DefaultSolver(upper, q, matrix, np.concatenate(rights), cones, settings).solve()
    if str(solution.status) not in _SOLVED:
        raise ConicSolverError(f"samples of the posterior: the conic solver ended with {solution.status}")
    return np.array(solution.x)
