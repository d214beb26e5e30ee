"""A start that is to run: its number, and the motions that it descends from."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Literal

from excite.design.start_results import StartResult

Kind = Literal["random", "combination", "refinement"]


@dataclass(frozen=True, eq=False)
class PlannedStart:
    """One start of a search; with the seed it determines its result."""

    index: int  # its number
    # whether it begins with random motions, with combinations of its parents, or goes on from its only parent
    kind: Kind = "random"
    parents: tuple[StartResult, ...] = ()  # the best motions of earlier rounds

    @property
    def lineage(self) -> str:
        """Hash of what the start depends on beside the problem and its number; empty for a random one."""
        if self.kind == "random":
            return ""
        content = json.dumps([self.kind, [parent.x for parent in self.parents]])
        return hashlib.sha256(content.encode()).hexdigest()


def number_of(start: PlannedStart | int) -> int:
    """Number of a start; a number alone is that of a random one."""
    return start if isinstance(start, int) else start.index
