"""The best motions of a search so far, each in a basin of its own."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from excite.design.start_results import StartResult

_SAME = 3e-3  # two motions whose criteria differ by less are taken to be in one basin: mirrored and reversed ones are
_MOST = 12


class Population:
    """Local minima, the best first; of those in one basin the best is kept."""

    def __init__(self) -> None:
        self.members: tuple[StartResult, ...] = ()

    def add(self, results: Iterable[StartResult]) -> None:
        """Add the ends of starts, by number; those without a finite criterion are left out."""
        for result in sorted(results, key=lambda result: result.index):
            if np.isfinite(result.value):
                self._add(result)

    @property
    def best(self) -> float:
        """The least criterion; infinite where there is no member."""
        return self.members[0].value if self.members else np.inf

    def _add(self, result: StartResult) -> None:
        near = [member for member in self.members if abs(member.value - result.value) <= _SAME * abs(result.value)]
        if any(member.value <= result.value for member in near):
            return
        others = [member for member in self.members if member not in near]
        self.members = tuple(sorted([*others, result], key=lambda member: (member.value, member.index))[:_MOST])
