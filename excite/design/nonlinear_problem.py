"""Design problems over families that are not linear in x: limits are curved; a motion beyond them is drawn inside.

Every family is linear in its coefficients for a given shape, so that a motion can be drawn towards rest in the middle
of the limits until it keeps them: a step of the optimiser ends inside whatever its curvature does.
"""

from __future__ import annotations

import numpy as np

from excite.design.grid_limits import CurvedLimit
from excite.design.nonlinear_family_limits import BentLimit
from excite.design.problem import GridLimit, Problem
from excite.trajectories.nonlinear import CurvedFamily
from regressors.samples import Array

_WITHIN = 1.0 - 1e-9  # of what the limits allow: rounding


class CurvedProblem(Problem):
    """Minimise a criterion over a family that is linear in some of its parameters only; see `Problem`."""

    family: CurvedFamily
    bent: tuple[BentLimit, ...]

    def _imposed(self, grid: int) -> tuple[tuple[GridLimit, ...], tuple[CurvedLimit, ...]]:
        self.bent = tuple(BentLimit.of(limit, self.family, grid) for limit in self.limits)
        self._at_rest = [limit.values(self.rest) for limit in self.bent]
        return (), (*self.bent, *self.nonlinear)

    def resting(self, rng: np.random.Generator) -> Array:
        """Rest in the centre, of a random shape."""
        return self.family.resting(self.centre, rng)

    def direction(self, joint: int, coefficients: Array) -> Array:
        """The direction in which one coordinate's coefficients grow by given ones, the shape the same."""
        found = np.zeros_like(self.rest)
        self.family.split(found)[0][joint] = coefficients
        return found

    def longest_step(self, x: Array, direction: Array) -> float:
        """Largest s >= 0 for which x + s direction keeps the limits; the direction must leave the shape as it is."""
        return self._largest(
            [limit.values(x) for limit in self.bent], [limit.values(x + direction) for limit in self.bent]
        )

    def _largest(self, values: list[Array], others: list[Array]) -> float:
        """Largest s >= 0 for which values + s (others - values) keep the limits."""
        step = np.inf
        for limit, value, other in zip(self.bent, values, others, strict=True):
            slope = other - value
            room = np.where(slope > 0, limit.upper[:, None] - value, limit.lower[:, None] - value)
            ratio = np.divide(room, slope, out=np.full_like(room, np.inf), where=slope != 0)
            step = min(step, float(ratio.min(initial=np.inf)))
        return max(step, 0.0)

    def drawn(self, x: Array, part: float) -> Array:
        """The motion drawn towards the centre, to a part of its distance from it at every instant."""
        return self.family.drawn(x, self.centre, part)

    def reach(self, x: Array) -> float:
        """Largest part to which a motion can be `drawn` within the limits that are linear in it."""
        return self._largest(self._at_rest, [limit.values(x) for limit in self.bent])

    def first_length(self, x: Array, direction: Array) -> float:
        """The whole step: it is drawn inside."""
        return 1.0

    def inside(self, x: Array) -> Array:
        """The motion, drawn towards the centre as far as the limits ask for."""
        reach = self.reach(x)
        return x if reach >= 1.0 else self.drawn(x, _WITHIN * reach)

    def enlarged(self, wanted: Array, part: float, unbounded: float) -> Array:
        """A motion about zero put about the centre, as large as a part of what the limits allow."""
        x = self.family.drawn(wanted, np.zeros_like(self.centre), 1.0)
        linear, _ = self.family.split(x)
        linear += np.outer(self.centre, self.family.constant)
        reach = self.reach(x)
        return self.drawn(x, part * (reach if np.isfinite(reach) else unbounded))

    def violation(self, x: Array) -> float:
        """Largest excess over a limit, as part of half its range; <= 0 inside."""
        return max((float(limit.uses(limit.values(x)).max()) - 1.0 for limit in self.bent), default=-np.inf)
