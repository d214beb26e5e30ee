"""A reason to doubt a result, with its cause and its cure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Doubt:
    """A reason to doubt a result."""

    what: str  # what cannot be right, with its numbers
    cause: str  # why, as far as the data show it
    cure: str  # what to do, with options in backticks

    @property
    def text(self) -> str:
        """One sentence."""
        return f"{self.what}: {self.cause}; {self.cure}"
