"""Files that an export has written, and what has to be known of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


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
    """

    format: str
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line."""
        more = f" and {len(self.files) - 1} more" if len(self.files) > 1 else ""
        return f"<Exported {self.format}: {self.files[0]}{more}, {len(self.notes)} notes>"
