"""Files that an export has written, and what has to be known of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Exported:
    """What an export has written.

    Parameters
    ----------
    format : str
        Name of the format.
    files : tuple of Path
        The file that was asked for first, then those beside it.
    notes : tuple of str
        What the format cannot express, what was assumed, and what was not checked, one sentence each.
    facts : mapping
        Numbers and names of what was written, for JSON, such as ``rate`` and ``duration`` of a motion.
    holds : bool
        False for a motion whose controller is not documented, and may lay a curve through the samples that passes a
        limit.
    """

    format: str
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    holds: bool = True

    def __repr__(self) -> str:
        """One line."""
        more = f" and {len(self.files) - 1} more" if len(self.files) > 1 else ""
        return f"<Exported {self.format}: {self.files[0]}{more}, {len(self.notes)} notes>"
