"""Quadratic programmes ``min g'd + d'Hd/2`` within the limits, for several descents at once.

A programme contains only the rows near their bounds, and is solved again with the rows that its solution violates.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from excite.design.grid_limits import GridConstraint
from excite.design.problem import Problem
from excite.design.solvers.descent import Descent, DescentStep
from excite.design.solvers.limit_rows import FREE, LeastDistance, LinearRows, NearRows, Rows, largest_part
from regressors.samples import Array, Index

_INSIDE = 0.9995  # fraction of each bound that a programme may use: violations between rows fit in the rest
_NEAR = 0.7  # rows used beyond this fraction of their bound enter the programme at once
_ROUNDS = 8


class Programmes:
    """The programmes of the descents of one problem."""

    def __init__(self, problem: Problem) -> None:
        linear = problem.limits.linear_in_x
        self._linear = LinearRows(linear, problem.shape) if linear else None
        self._nonlinear = problem.limits.nonlinear_in_x

    def steps(self, descents: Sequence[Descent]) -> list[DescentStep | None]:
        """Solution of each descent's programme; None where its solver fails."""
        programmes = [_Programme(descent, self._linear, self._nonlinear) for descent in descents]
        if self._linear is not None and programmes:
            self._add(programmes, np.array([programme.x for programme in programmes]), _NEAR)
        left = programmes
        for _ in range(_ROUNDS):
            left = self._broken([programme for programme in left if programme.solve()])
            if not left:
                break
        return [programme.step() for programme in programmes]

    def _broken(self, programmes: list[_Programme]) -> list[_Programme]:
        """Those whose solutions violate limits; the rows that they violate are added."""
        broken = {programme for programme in programmes if programme.breaks_nonlinear()}
        if self._linear is not None and programmes:
            ends = np.array([programme.x + programme.d for programme in programmes])
            broken.update(self._add(programmes, ends, _INSIDE))
        return [programme for programme in programmes if programme in broken]

    def _add(self, programmes: Sequence[_Programme], xs: Array, threshold: float) -> list[_Programme]:
        """Add the rows that peak beyond a threshold at an x of each; return those with one beyond its bound."""
        assert self._linear is not None
        which, flat, outside = self._linear.peaks(xs, threshold)
        ends = np.searchsorted(which, np.arange(1, len(programmes) + 1)).tolist()
        parts = list(zip(programmes, [0, *ends], ends, strict=False))
        for programme, begin, end in parts:
            programme.is_whole = not outside[begin:end].any()
        is_new = np.concatenate([~programme.is_chosen[flat[begin:end]] for programme, begin, end in parts])
        which, flat = which[is_new], flat[is_new]
        starts = np.array([programme.x for programme in programmes])[which]
        rows, lower, upper = self._linear.bounded(starts, flat, _INSIDE)
        ends = np.searchsorted(which, np.arange(1, len(programmes) + 1)).tolist()
        for programme, begin, end in zip(programmes, [0, *ends], ends, strict=False):
            if end > begin:
                programme.add(flat[begin:end], rows[begin:end], lower[begin:end], upper[begin:end])
        return [programme for programme in programmes if not programme.is_whole]


class _Programme:
    """The programme of one descent, on a growing set of rows."""

    def __init__(self, descent: Descent, linear: LinearRows | None, nonlinear: Sequence[GridConstraint]) -> None:
        assert descent.H is not None
        self._descent, self._J, self._linear = descent, descent.H.J, linear
        self._programme = LeastDistance(descent.g @ self._J)
        self._near = NearRows(nonlinear, descent.x) if nonlinear else None
        self._w: Array | None = None
        self.x, self.d = descent.x.ravel(), np.zeros_like(descent.g)
        self.is_whole = True  # whether the step is inside the limits that are linear in x
        if linear is not None:
            self._chosen: Index = np.zeros(0, dtype=np.intp)
            self.is_chosen = np.zeros(linear.count, dtype=bool)
            if not descent.sides.size:
                descent.sides = np.full(linear.count, FREE, dtype=np.int32)

    def add(self, flat: Index, rows: Array, lower: Array, upper: Array) -> None:
        """Add rows of the limits that are linear in x."""
        assert self._linear is not None
        self.is_chosen[flat] = True
        self._chosen = np.concatenate([self._chosen, flat])
        bounded = self._linear.products(flat, rows, self._J), lower, upper
        self._programme.add(bounded, self._descent.sides[flat])

    def solve(self) -> bool:
        """Solve it on the rows so far; False if its solver fails."""
        self._w = self._programme.solve([] if self._near is None else [_whitened(self._near.rows(), self._J)])
        if self._w is None:
            return False
        self.d = self._J @ self._w
        return True

    def breaks_nonlinear(self) -> bool:
        """Whether the solution violates limits that are not linear in x; if so, rows are added."""
        return self._near is not None and self._near.broken(self.d)

    def step(self) -> DescentStep | None:
        """The solution; rows that are active in it are expected to be active again."""
        if self._w is None:
            return None
        if self._linear is None:
            return DescentStep(self.d, self._w)
        self._descent.sides[:] = FREE
        self._descent.sides[self._chosen] = self._programme.sides
        if self.is_whole:
            return DescentStep(self.d, self._w)
        return DescentStep(self.d, self._w, largest_part(self._linear.values(self.x), self._linear.changes(self.d)))


def _whitened(rows: Rows, J: Array) -> Rows:
    A, lower, upper = rows
    return A @ J, lower, upper
