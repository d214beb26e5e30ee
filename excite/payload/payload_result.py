"""What a robot holds, as identified: mass, centre and inertia with 99 % intervals, in a stated frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from excite.payload.held_body import UPPER, Frame, HeldBody, spread_of
from excite.payload.known_gains import KnownGains
from excite.payload.load_estimate import LoadEstimate
from excite.payload.possible_body import is_possible, nearest_possible
from excite.registry import built_in
from regressors.robot.robot import Robot
from regressors.samples import Array

if TYPE_CHECKING:
    from excite.logs.log import Log

NAMES = ("mass", "x", "y", "z", "xx", "xy", "xz", "yy", "yz", "zz")
_NOT_NEGATIVE = (0, 4, 7, 9)
_FAR = 2.0  # half intervals


@dataclass(frozen=True, eq=False, repr=False)
class PayloadResult:
    """An identified payload.

    Parameters
    ----------
    robot : Robot
    frame : Frame
        In which it is stated.
    estimate : LoadEstimate
        About the last link's frame.
    source : str
        What was measured: ``joint torques`` or ``wrench``.
    gains : KnownGains, optional
    logs : tuple of (str, Log)
        Each ``with`` or ``without`` the load.
    rated : float, optional
        Largest load of the robot [kg].
    notes, doubts : tuple of str
        What was assumed and found; why the result cannot be right.
    provenance : mapping
    """

    robot: Robot
    frame: Frame
    estimate: LoadEstimate
    source: str
    gains: KnownGains | None
    logs: tuple[tuple[str, Log], ...]
    rated: float | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def _free(self) -> tuple[Array, Array]:
        T = self.frame.from_link
        return T @ self.estimate.phi, T @ self.estimate.covariance @ T.T

    @cached_property
    def body(self) -> HeldBody:
        """The body: the estimate, or the nearest that real masses can make."""
        return HeldBody.of(nearest_possible(*self._free)) if self._free[0][0] > 0 else HeldBody.of(self._free[0])

    @property
    def constrained(self) -> bool:
        """Whether no body has the estimated parameters, so that the nearest possible body is stated."""
        return not is_possible(self._free[0])

    @cached_property
    def deviation(self) -> Array:
        """Standard deviations of mass, centre, and xx, xy, xz, yy, yz, zz of the inertia, shape (10,)."""
        phi, covariance = self._free
        return spread_of(lambda x: HeldBody.of(x).listed, phi, covariance)

    @cached_property
    def intervals(self) -> Array:
        """99 % intervals of the same, about the estimate before it is made possible, shape (10, 2)."""
        free, half = HeldBody.of(self._free[0]).listed, self.estimate.quantile * self.deviation
        value = self.body.listed
        low, high = np.minimum(free - half, value), np.maximum(free + half, value)
        if self.body.mass > 0:
            low[list(_NOT_NEGATIVE)] = np.maximum(low[list(_NOT_NEGATIVE)], 0.0)
        return np.column_stack([low, high])

    @property
    def far_from_estimate(self) -> bool:
        """Whether mass or centre of the possible body are far outside of the intervals about the estimate."""
        free, half = HeldBody.of(self._free[0]).listed, self.estimate.quantile * self.deviation
        return bool(np.any(np.abs(self.body.listed - free)[:4] > _FAR * half[:4]))

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.body.mass

    def content(self) -> dict[str, Any]:
        """Plain values for ``payload.json``."""
        body, intervals = self.body, self.intervals
        inertia = np.zeros((3, 3, 2))
        inertia[UPPER] = intervals[4:]
        inertia.transpose(1, 0, 2)[UPPER] = intervals[4:]
        return {
            "frame": {
                "name": self.frame.name,
                "xyz": self.frame.translation.tolist(),
                "rotation": self.frame.rotation.tolist(),
                "of": self.robot.links[-1].name,
            },
            "mass": {"value": body.mass, "interval": intervals[0].tolist(), "unit": "kg"},
            "centre": {"value": body.centre.tolist(), "interval": intervals[1:4].tolist(), "unit": "m"},
            "inertia": {
                "value": body.inertia.tolist(),
                "interval": inertia.tolist(),
                "unit": "kg m^2",
                "about": "the centre of mass, in the axes of the frame",
            },
            "parameters": dict(zip(_PARAMETERS, body.parameters.tolist(), strict=True)),
            "confidence": 0.99,
            "possible": not self.constrained,
            "by_gains": float(self.estimate.quantile * np.sqrt(max(self._by_gains, 0.0))),
        }

    @property
    def _by_gains(self) -> float:
        return float(self.estimate.by_gains[0, 0])

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write ``payload.json``, and what controllers want, into a folder; see the writer ``payload``."""
        files: list[Path] = built_in("writer", "payload")(self, folder, replace=replace)
        return files

    def __repr__(self) -> str:
        """One line."""
        low, high = self.intervals[0]
        return f"<PayloadResult of {self.robot.name}: {self.mass:.4g} kg, 99 % from {low:.4g} to {high:.4g} kg>"


_PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
