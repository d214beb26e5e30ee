"""What a reader noticed in a description: what it assumed and corrected, what is missing, what is implausible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

FindingKind = Literal["found", "assumed", "snapped", "missing", "suspicious"]


@dataclass(frozen=True)
class Finding:
    """One line of a health report."""

    # read as it stands; taken for granted, since the file does not say; changed to the exact value; not in the file;
    # in the file, but hardly right
    kind: FindingKind
    where: str  # link, joint or file
    what: str  # what was noticed, in words
    advice: str = ""  # what to do about it; empty where nothing is to be done

    def __str__(self) -> str:
        """Whole sentence for notes and messages."""
        return f"{self.where}: {self.what}" + (f"; {self.advice}" if self.advice else "")


@dataclass(frozen=True)
class MissingRange(Finding):
    """A joint that is not continuous, but whose range is not stated."""

    joint: str = ""  # its name
