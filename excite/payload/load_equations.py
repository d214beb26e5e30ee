"""Equations of logs with and without a load: ``y = (1 + e) (W beta + K phi + F d)``, noise aside.

beta are the parameters of what is there without the load, phi the ten of the load, d how far friction in the loaded
log is from that in the other, and e the relative error of the gain of each drive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from excite.identification.observations import Observations
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class LoadEquations:
    """Rows of all logs, and what is known beforehand."""

    observations: Observations  # W and y, in corrected gains
    load: Array  # (m, 10) K; zero in rows without the load
    friction: Array  # (m, f) F; zero in rows without the load
    changes: Array  # (f,) standard deviations of d
    gains: Array  # (k, k) covariance of e, one for each equation; of no rows where gains do not matter
    known: Array | None = None  # (p,) beta of an earlier identification; unknown if not given
    covariance: Array | None = None  # (p, p) of `known`
    scales_all: bool = True  # False where e changes K phi only, since beta is from torques with the same gains

    @property
    def p(self) -> int:
        """Number of parameters beta."""
        return int(self.observations.W.shape[1])

    @property
    def place(self) -> slice:
        """Of phi among all unknowns."""
        return slice(self.p, self.p + PARAMETERS_PER_LINK)

    @cached_property
    def rows(self) -> Array:
        """``[W, K, F]``, shape (m, p + 10 + f)."""
        return np.hstack([self.observations.matrix, self.load, self.friction])

    @cached_property
    def groups(self) -> tuple[Index, ...]:
        """Rows of each log and equation that has any."""
        group = self.observations.group
        return tuple(rows for g in range(int(group.max()) + 1) if (rows := np.flatnonzero(group == g)).size)

    @cached_property
    def factors(self) -> tuple[tuple[Array, Array], ...]:
        """Q and R of each group's rows."""
        return tuple(np.linalg.qr(self.rows[rows]) for rows in self.groups)

    @property
    def equation(self) -> Index:
        """Equation of each group."""
        return self.observations.equation[[rows[0] for rows in self.groups]]

    def with_measured(self, y: Array, gains: Array | None = None) -> LoadEquations:
        """The same equations with another measurement, whose factors need not be computed again."""
        # y (m,); gains (k, k)
        other = replace(
            self, observations=replace(self.observations, y=y), gains=self.gains if gains is None else gains
        )
        for name in ("rows", "groups", "factors"):
            other.__dict__[name] = getattr(self, name)
        return other
