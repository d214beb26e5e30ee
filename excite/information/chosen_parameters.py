"""Criteria on chosen parameters, with the others as nuisance: functions of a Schur complement of M.

With the columns of W in two groups, S of the chosen parameters and N of the others, the part of W_S that the other
columns cannot explain has the information matrix

    M_S = M_SS - M_SN M_NN^-1 M_NS,

the inverse of the chosen parameters' block of ``M^-1``: what is known of them when the others are estimated too
[Atkinson, Donev, Tobias 2007, chapter 10]. It does not depend on how the other parameters are chosen or scaled. With
``det`` this is D_s-optimality, with the trace A_s-optimality.

The best motion for some parameters may not show the others at all, with W singular. So what is minimised has a small
part of the D-optimality of all parameters too, which grows without bound there; the value that is reported has not.

[Atkinson, Donev, Tobias 2007] "Optimum Experimental Designs, with SAS", Oxford University Press.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from excite.information.criteria import Criterion
from regressors.samples import Array

OTHERS = 0.05  # part of log det^(-1/2b) of all parameters: the chosen deviations were at most 5 % larger with it
_RIDGE = 1e-13  # of the normalised matrix: keeps the factor of a singular one finite


@dataclass(frozen=True, eq=False)
class ChosenParameters(Criterion):
    """A criterion of the Schur complement ``M_S`` of the chosen columns."""

    criterion: Criterion  # applied to ``M_S``
    chosen: tuple[int, ...]  # numbers of the chosen columns

    @property
    def name(self) -> str:  # type: ignore[override]
        """That of the criterion."""
        return self.criterion.name

    @property
    def stages(self) -> tuple[float, ...]:  # type: ignore[override]
        """Those of the criterion."""
        return self.criterion.stages

    def value(self, M: Array) -> float:
        """The criterion of ``M_S``; infinite where M is singular."""
        L = _factor(self._ordered(M), ridge=0.0)
        return np.inf if L is None else self.criterion.value(self._complement(L))

    def smooth(self, M: Array, sharpness: float) -> tuple[float, Array]:
        """Its smooth approximation and `OTHERS` of ``-(1/2b) log det M``, with the gradient of the sum.

        That of the former is ``K G_S K'``, ``K = [E; -M_NN^-1 M_NS]``; of the latter ``-(1/2b) M^-1``.
        """
        value, G, _ = self._smooth(M, sharpness)
        return value, G

    def smooth_and_value(self, M: Array, sharpness: float) -> tuple[float, Array, float]:
        """Both by one factor."""
        value, G, complement = self._smooth(M, sharpness)
        return value, G, self.value(M) if complement is None else self.criterion.value(complement)

    def _smooth(self, M: Array, sharpness: float) -> tuple[float, Array, Array | None]:
        """Smooth approximation, its gradient, and ``M_S``, None where M is singular."""
        ordered, others = self._ordered(M), len(M) - len(self.chosen)
        L = _factor(ordered, ridge=0.0)
        singular = L is None
        if L is None:
            L = _factor(ordered, ridge=_RIDGE)
            assert L is not None
        complement = self._complement(L)
        value, of_complement = self.criterion.smooth(complement, sharpness)
        # M_NN = L_NN L_NN', M_SN = L_SN L_NN': M_NN^-1 M_NS = L_NN^-T L_SN'
        rest = scipy.linalg.solve_triangular(L[:others, :others], L[others:, :others].T, trans="T", lower=True)
        K = np.vstack([-rest, np.eye(len(self.chosen))])
        part = OTHERS / len(M) if others else 0.0
        half = scipy.linalg.solve_triangular(L, np.eye(len(M)), lower=True)  # M^-1 = half' half
        G, order = np.empty_like(M), self._order(len(M))
        G[np.ix_(order, order)] = K @ of_complement @ K.T - 0.5 * part * half.T @ half
        return value - part * float(np.log(np.diag(L)).sum()), G, None if singular else complement

    def _order(self, size: int) -> list[int]:
        """The other columns, then the chosen ones."""
        return [*(k for k in range(size) if k not in self.chosen), *self.chosen]

    def _ordered(self, M: Array) -> Array:
        order = self._order(len(M))
        return np.asarray(M[np.ix_(order, order)])

    def _complement(self, L: Array) -> Array:
        """``M_S = L_SS L_SS'``, from the factor of M with the chosen columns last."""
        own = L[-len(self.chosen) :, -len(self.chosen) :]
        return np.asarray(own @ own.T)


def _factor(M: Array, ridge: float) -> Array | None:
    """Lower triangular L with ``L L' = M``, of the matrix normalised by its diagonal; None if that is singular."""
    diagonal = np.diag(M)
    size = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    normalised = M / np.outer(size, size) + ridge * len(M) * np.eye(len(M))
    try:
        return np.asarray(size[:, None] * np.linalg.cholesky(normalised))
    except np.linalg.LinAlgError:
        return None
