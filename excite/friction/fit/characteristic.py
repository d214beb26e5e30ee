"""Friction of one drive, as identified from logs: points, the curve that fits best, and break-away torques."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from excite.friction.fit.breakaway_torque import BreakAway
from excite.friction.fit.curve_fit import CurveFit, table_of
from excite.friction.fit.points import Point
from excite.friction.fit.stiction_points import MeanBreakAway, mean_break_aways
from regressors.friction.curves import FrictionCurve


@dataclass(frozen=True, eq=False)
class Characteristic:
    """Friction of one drive."""

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"break_away": lambda characteristic: characteristic.means}

    drive: str
    unit: str  # of its torque
    gravity: str  # how gravity was accounted for
    points: tuple[Point, ...]  # of windows
    rests: tuple[Point, ...]  # break-away torques that are points of the curve, at speed zero
    fit: CurveFit | None  # None for a table
    others: tuple[CurveFit, ...]  # all that were fitted, best first
    failed: dict[str, str]  # forms that could not be fitted, and why
    stiction: tuple[BreakAway, ...]
    notes: tuple[str, ...]

    @property
    def curve(self) -> FrictionCurve:
        """The fitted curve, or the table of the points."""
        return table_of(self.points) if self.fit is None else self.fit.curve

    @property
    def means(self) -> tuple[MeanBreakAway, ...]:
        """Mean break-away torque of each direction."""
        return mean_break_aways(self.break_aways)

    @property
    def break_aways(self) -> tuple[BreakAway, ...]:
        """Torques of ``stiction``, converted to the reference temperature if the curve is linear in temperature."""
        form = None if self.fit is None else self.fit.form
        if self.fit is None or form is None or form.temperature is None:
            return self.stiction
        values = dict(zip(form.parameters, self.fit.values.tolist(), strict=True))
        rows = []
        for mean in self.stiction:
            side = "" if not form.asymmetric else "forward." if mean.direction > 0 else "backward."
            temperature_rise = 0.0 if mean.temperature is None else mean.temperature - form.temperature
            more = mean.direction * values[f"{side}coulomb_temperature"] * temperature_rise
            rows.append(replace(mean, torque=mean.torque - more))
        return tuple(rows)
