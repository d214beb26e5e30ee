"""A choice made for the user: its candidates, their scores, and what was taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Candidate:
    """One candidate of a choice."""

    value: Any  # as in the settings
    error: float  # relative error of the torques that were left out, over all equations
    # mean over the equations of the logarithm of that error's root mean square, see
    # `excite.identification.choices.left_out.LeftOut.score`; the least is best
    score: float


@dataclass(frozen=True)
class Choice:
    """A choice with its candidates.

    Parameters
    ----------
    name : str
        Setting that was chosen.
    value : bool, float, str, tuple or None
    candidates : tuple of Candidate
        Those that were scored, on the same rows.
    reason : str
        One sentence for the summary.
    unit : str, optional
        Of the value.
    interval : tuple of float, optional
        99 % interval of a value that was estimated.
    """

    name: str
    value: Any
    candidates: tuple[Candidate, ...]
    reason: str
    unit: str | None = None
    interval: tuple[float, float] | None = None

    def to_dict(self) -> dict[str, Any]:
        """The choice as plain values."""
        return {
            "name": self.name,
            "value": list(self.value) if isinstance(self.value, tuple) else self.value,
            "unit": self.unit,
            "interval": None if self.interval is None else list(self.interval),
            "reason": self.reason,
            "candidates": [dict(vars(candidate)) for candidate in self.candidates],
        }
