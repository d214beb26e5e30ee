"""Doubt where too many of the exciting rows of a log are left out of the equations."""

from __future__ import annotations

from excite.identification.plausibility.doubt import Doubt

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
