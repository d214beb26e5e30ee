"""A reason to doubt a result, with its cause and its cure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Doubt:
    """A reason to doubt a result.

    Parameters
    ----------
    what : str
        What cannot be right, with its numbers.
    cause : str
        Why, as far as the data show it.
    cure : str
        What to do, with options in backticks.
    """

    what: str
    cause: str
    cure: str

    @property
    def text(self) -> str:
        """One sentence."""
        return f"{self.what}: {self.cause}; {self.cure}"
