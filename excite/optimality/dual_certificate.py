"""What a dual point says of states: how far the inequality that bounds the criterion is from holding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.optimality.bounded_criteria import Multipliers
from excite.optimality.moment_conditions import MomentConditions
from excite.optimality.state_rows import StateRows
from regressors.samples import Array

_LEAST = 1e-12  # of the largest denominator


@dataclass(frozen=True, eq=False)
class DualCertificate:
    """``(<F(s), lower> + c' h(s)) / (<F(s), upper> + constant)``; its largest value over all states proves a bound."""

    rows: StateRows
    conditions: MomentConditions
    multipliers: Multipliers

    def ratios(self, S: Array) -> Array:
        """The ratio at every state, shape (N,)."""
        Y, m = self.rows(S), self.multipliers
        above = _inner(Y, m.lower) + float(np.sum(self.rows.prior * m.lower))
        above += self.conditions.values(S) @ m.moments
        if m.constant:
            return np.asarray(above / m.constant)
        below = _inner(Y, m.upper) + float(np.sum(self.rows.prior * m.upper))
        return np.asarray(above / np.maximum(below, _LEAST * below.max()))


def _inner(Y: Array, Z: Array) -> Array:
    """``<Y'Y, Z>`` of every state."""
    return np.asarray(np.einsum("nri,nri->n", Y @ Z, Y))
