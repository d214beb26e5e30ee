"""A reason to doubt a result, such as rows that are left out."""

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


MOST = 0.05  # of the exciting rows


def left_out_rows(source: str, share: float) -> Doubt | None:
    """Doubt where more than 5 % of the exciting rows are left out."""
    if not share > MOST:
        return None
    return Doubt(
        f"{100 * share:.2g} % of the exciting rows of {source} are left out, more than {100 * MOST:g} %",
        "the motion that remains is no longer the one that was played",
        "see the notes on this log for which rows and why; record it again without these events, or give the stretch "
        "that is sound (`rows`)",
    )
