"""Interface of the estimators, and least squares from a triangular factor."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from excite.identification.estimate import Estimate
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.trajectories import Trajectory
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Context:
    """Data that some estimators need besides the observations.

    Parameters
    ----------
    target : IdentificationTarget
    prepared : tuple of PreparedLog
        One per log.
    recipe : Recipe
    described : mapping of str to float
        Standard parameters as the robot's description states them.
    commanded : Trajectory, optional
        The motion that was played.
    """

    target: IdentificationTarget
    prepared: tuple[PreparedLog, ...]
    recipe: Recipe
    described: Mapping[str, float] = field(default_factory=dict)
    commanded: Trajectory | None = None


class Estimator(ABC):
    """Method that estimates beta from ``y = W beta + e``.

    An estimator of your own is a subclass with `estimate`, given as ``estimator=Mine()``.

    Attributes
    ----------
    name : str
        As on the command line.
    holds_rows : bool
        True if `estimate` needs W of the observations as an array; False if it reads them in slices, so that W may be
        larger than the memory.
    """

    name: str = "own"
    holds_rows: bool = True

    @abstractmethod
    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """Estimate the parameters from observations.

        Parameters
        ----------
        observations : Observations
        context : Context, optional
            Data that they were computed from; not every estimator needs it.

        Raises
        ------
        InputError
            A required input is missing, or no estimate can be computed from the observations.
        """

    def check(self, commanded: Trajectory | None) -> None:
        """Raise `InputError`, before any log is read, if a required input is missing.

        Parameters
        ----------
        commanded : Trajectory or None
            The motion that was played, where it is known.
        """
        del commanded


TOLERANCE = 1e-10  # of the largest singular value of the columns scaled to length one, and of the longest column


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """Minimiser of ``||A beta - r||``, with its covariance factor and singular values."""

    values: Array  # (p,) minimum-norm solution with respect to the columns scaled to length one
    # (p, rank) factor of the covariance: ``half @ half.T`` is ``(A'A)^-1`` within the identifiable directions
    half: Array
    sizes: Array  # (p,) lengths of the columns of A; zero where a column counts as zero
    singular_values: Array  # (p,) of the columns scaled to length one
    directions: Array  # (p, p) right singular vectors in its rows, of the scaled columns
    rank: int
    square: float  # sum of the squared residuals
    size: float  # length of r


def solve_triangular_system(R: Array, tolerance: float = TOLERANCE) -> LinearSolution:
    """Solution from the triangular factor of ``[A r]``.

    Columns are scaled to length one and decomposed, ``A S^-1 = U diag(s) V'``; normal equations are never formed.
    """  # R (k, p + 1)
    A, r = R[:, :-1], R[:, -1]
    p = A.shape[1]
    sizes = np.linalg.norm(A, axis=0)
    sizes = np.where(sizes > tolerance * sizes.max(initial=0.0), sizes, 0.0)
    scaled = A * _inverse(sizes)
    U, s, V = np.linalg.svd(np.concatenate([scaled, np.zeros((max(p - A.shape[0], 0), p))]), full_matrices=False)
    rank = int(np.sum(s > tolerance * s[0])) if s[0] > 0 else 0
    half = _inverse(sizes)[:, None] * (V[:rank].T / s[:rank])
    values = half @ (U[: r.size, :rank].T @ r)
    square = float(np.sum((A @ values - r) ** 2))
    return LinearSolution(values, half, sizes, s, V, rank, square, float(np.linalg.norm(r)))


def _inverse(sizes: Array) -> Array:
    return np.asarray(np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0))
