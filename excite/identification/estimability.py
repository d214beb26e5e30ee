"""Which parameters are identifiable from the data on their own, and in which combinations the others are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from excite.identification.estimate import CONFIDENCE, Estimate
from excite.identification.estimator import LinearSolution
from excite.identification.observations import Observations
from regressors.models.independence import independent_columns
from regressors.samples import Array

_NOTHING = 1e-6  # smallest singular value of a part of a parameter along unidentifiable directions
_VISIBLE = 1e-3  # smaller coefficients, of columns scaled to length one, are left out of a combination


@dataclass(frozen=True, eq=False)
class Estimability:
    """Identifiability of each parameter from the data.

    A parameter is identifiable if its column is independent of the others, and if half of its 99 % confidence interval,
    as a contribution to y, is smaller than y itself: ``t sqrt(C_jj) ||W_j|| <= ||y||``. Neither side depends on units.
    """

    names: tuple[str, ...]
    seen: NDArray[np.bool_]  # (p,)
    # (p,) ``t sqrt(C_jj) ||W_j|| / ||y||``; infinite where the columns depend on each other, NaN where the noise is
    # not known
    resolution: Array
    singular_values: Array  # (p,) of the columns scaled to length one
    combinations: tuple[str, ...]  # identifiable combinations of the parameters that are not identifiable on their own

    @property
    def unseen(self) -> tuple[str, ...]:
        """Names of the parameters that are not identifiable on their own."""
        return tuple(name for name, seen in zip(self.names, self.seen, strict=True) if not seen)


def estimability(solution: LinearSolution, names: tuple[str, ...], variance: float, freedom: int) -> Estimability:
    """Identifiability of the parameters of a least-squares problem."""
    hidden = solution.directions[solution.rank :].T  # (p, p - rank), of the scaled columns
    dependent = np.linalg.norm(hidden, axis=1) > _NOTHING
    quantile = float(scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, max(freedom, 1)))
    deviation = np.sqrt(variance) * np.linalg.norm(solution.half, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        resolution = quantile * deviation * solution.sizes / solution.size
        weak = quantile * np.sqrt(variance) > solution.size * solution.singular_values
    if solution.size == 0.0 or not np.isfinite(variance):  # nothing to compare with
        resolution, weak = np.full(len(names), np.nan), np.zeros(len(names), dtype=bool)
    weak[solution.rank :] = True
    resolution = np.where(dependent, np.inf, resolution)
    seen = ~dependent & ~(resolution > 1.0)
    combinations = _combinations(solution, names, seen, solution.directions[weak].T)
    return Estimability(names, seen, resolution, solution.singular_values, combinations)


def _combinations(
    solution: LinearSolution, names: tuple[str, ...], seen: NDArray[np.bool_], hidden: Array
) -> tuple[str, ...]:
    """Identifiable combinations of unidentifiable parameters, orthogonal to the hidden directions, from the left."""
    texts = [f"{names[j]} does not influence the measurements" for j in np.flatnonzero(~seen & (solution.sizes == 0.0))]
    mixed = np.flatnonzero(~seen & (solution.sizes > 0.0))
    if mixed.size == 0:
        return tuple(texts)
    U, s, _ = np.linalg.svd(hidden[mixed], full_matrices=True)
    lost = int(np.sum(s > _NOTHING))
    shown = U[:, lost:].T  # rows that the data determines, of the columns scaled to length one
    index = independent_columns(shown, 1e-6)
    rows = np.asarray(np.linalg.solve(shown[:, index], shown)) if index.size else np.zeros((0, mixed.size))
    rows = np.where(np.abs(rows) > _VISIBLE, rows, 0.0)
    covered = np.flatnonzero(~np.any(rows != 0.0, axis=0))
    texts += [_lost(names[j]) for j in mixed[covered]]
    for row, k in zip(rows, index, strict=True):
        sizes = solution.sizes[mixed]
        text = _sum(row * sizes / sizes[k], [names[j] for j in mixed])
        texts.append(f"{names[mixed[k]]} is identifiable only in {text}" if np.count_nonzero(row) > 1 else _lost(text))
    return tuple(texts)


def _lost(name: str) -> str:
    return f"{name} is not identifiable above the noise"


def _sum(row: Array, names: list[str]) -> str:
    """Text of a combination, its leading coefficient one."""
    text = ""
    for k in np.flatnonzero(row):
        size = abs(float(row[k]))
        term = names[k] if abs(size - 1.0) < 1e-6 else f"{size:.6g} {names[k]}"
        join = (" - " if row[k] < 0 else " + ") if text else ("-" if row[k] < 0 else "")
        text += join + term
    return text


def shown_estimate(
    method: str,
    observations: Observations,
    shown: Estimability,
    values: Array,
    covariance: Array,
    noise: Array,
    freedom: int,
    notes: tuple[str, ...] = (),
) -> Estimate:
    """Estimate of the identifiable parameters: NaN and infinite variance for the others, which the notes name."""
    # values (p,); covariance (p, p); noise (groups,)
    seen = shown.seen
    kept = np.where(np.outer(seen, seen), covariance, 0.0)
    kept[np.diag_indices_from(kept)] = np.where(seen, np.diag(covariance), np.inf)
    shape = (len(observations.logs), len(observations.equations))
    return Estimate(
        method,
        observations.names,
        observations.units,
        np.where(seen, values, np.nan),
        kept,
        np.asarray(noise, dtype=float).reshape(shape),
        freedom,
        shown.unseen,
        (*notes, *shown.combinations),
        fit=np.asarray(values, dtype=float),
    )
