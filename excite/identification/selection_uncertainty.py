"""Intervals that allow for terms of drives which were chosen by the same data.

Of m terms that could be added, those are that explain most, noise included: what they explain is exaggerated, and what
is correlated with them is shifted. Intervals hold whatever was chosen if the added terms' own are as wide as for m
statements at once [Berk, Brown, Buja, Zhang, Zhao 2013, Annals of Statistics 41, 802], by Bonferroni's bound. With C
the covariance and J the added terms, ``C[:, J] C[J, J]^-1 C[J, :]`` is what they contribute to all parameters; it is
multiplied by the square of the ratio of the quantiles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.stats

from excite.identification.estimate import CONFIDENCE, Estimate
from regressors.samples import Index


def allowing_for_selection(estimate: Estimate, added: Sequence[int] | Index, candidates: int) -> Estimate:
    """Extend the covariance of an estimate by what choosing some of its terms does."""
    C, freedom = estimate.covariance, max(estimate.degrees_of_freedom, 1)
    J: Index = np.array([k for k in added if np.isfinite(C[k, k]) and C[k, k] > 0], dtype=np.intp)
    if not J.size or candidates < 2:
        return estimate
    tail = (1 - CONFIDENCE) / 2
    one, several = scipy.stats.t.isf([tail, tail / candidates], freedom)
    seen = np.flatnonzero(np.isfinite(np.diag(C)))
    share = C[np.ix_(seen, J)]
    wider = C.copy()
    wider[np.ix_(seen, seen)] += (
        ((several / one) ** 2 - 1) * share @ np.linalg.pinv(C[np.ix_(J, J)], hermitian=True) @ share.T
    )
    note = f"the intervals allow for {J.size} of {candidates} possible terms having been chosen by the same data"
    return replace(estimate, covariance=wider, notes=(*estimate.notes, note))
