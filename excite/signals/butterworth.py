"""Positions through a zero-phase Butterworth low-pass, then differences."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from excite.signals.cut import check_positive, cut_motion
from excite.signals.differences import smooth_differences
from excite.signals.low_pass import ORDER, edge, low_passed
from excite.signals.method import FilteredMotion, Method, spacing
from excite.signals.periods import chosen_cutoff
from regressors.samples import Array


@dataclass(frozen=True)
class Butterworth(Method):
    """Filter forwards and backwards, see `excite.signals.low_pass.low_passed`, then seven-point differences."""

    # frequency at which the amplitude is halved [Hz]; chosen from the positions if not given, see
    # `excite.signals.periods.chosen_cutoff`
    cutoff: float | None = None
    order: int = ORDER  # of one pass

    name: ClassVar[str] = "butterworth"

    def __post_init__(self) -> None:
        check_positive(self.name, cutoff=self.cutoff, order=self.order)

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Filtered positions and their differences; see `Method.motion`."""
        h = spacing(time, self.name, 16)
        cutoff, origin = chosen_cutoff(q, 1 / h) if self.cutoff is None else (self.cutoff, f"{self.cutoff:g} Hz")
        smooth = low_passed(q, 1 / h, cutoff, self.order)
        velocity, acceleration = smooth_differences(smooth, h)
        ends = max(edge(1 / h, cutoff), 3)
        assumed = (
            f"no motion above the cutoff; zero-phase Butterworth of order {self.order} twice, cutoff {origin}; "
            f"seven-point differences; {ends * h:.3g} s cut at each end"
        )
        return cut_motion(time, (smooth, velocity, acceleration), ends, assumed)

    def settled(self, time: Array, q: Array) -> Butterworth:
        """The method with the cutoff that it chooses."""
        if self.cutoff is not None:
            return self
        return replace(self, cutoff=chosen_cutoff(q, 1 / spacing(time, self.name, 16))[0])
