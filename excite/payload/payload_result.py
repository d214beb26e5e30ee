"""What a robot holds, as identified: mass, centre and inertia with 99 % intervals, in a stated frame."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.logs.log import LogReference
from excite.payload.controllers import CONTROLLERS, EXPECTED, FILES, controller_text
from excite.payload.held_body import UPPER, Frame, HeldBody, is_possible, nearest_possible, spread_of
from excite.payload.known_gains import KnownGains
from excite.payload.load_estimate import LoadEstimate
from excite.storage.atomic import replacing
from excite.storage.records import NUMBERS, every, read_record, write_record
from excite.storage.result_folder import check_not_taken, result_folder
from regressors.robot.robot import Robot
from regressors.samples import Array

KIND, PAYLOAD = "payload", "payload.json"
NAMES = ("mass", "x", "y", "z", "xx", "xy", "xz", "yy", "yz", "zz")
_NOT_NEGATIVE = (0, 4, 7, 9)
_FAR = 2.0  # half intervals


@dataclass(frozen=True, eq=False, repr=False)
class PayloadResult:
    """An identified payload; the same when it is loaded.

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
    without, loaded : tuple of LogReference
        Logs without and with the load.
    rated : float, optional
        Largest load of the robot [kg].
    notes, doubts : tuple of str
        What was assumed and found; why the result cannot be right.
    provenance : mapping
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"payload": lambda result: result.stated}

    robot: Robot
    frame: Frame
    estimate: LoadEstimate
    source: str
    gains: KnownGains | None
    without: tuple[LogReference, ...] = ()
    loaded: tuple[LogReference, ...] = ()
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

    @property
    def stated(self) -> dict[str, Any]:
        """Mass, centre and inertia with their intervals, as plain values."""
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
            "gains": self._gain_factors,
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
            "by_gains": float(self.estimate.quantile * np.sqrt(self.mass_variance_by_gains)),
        }

    @property
    def mass_variance_by_gains(self) -> float:
        """Part of the variance of the mass that is due to the gains [kg^2]."""
        return max(float(self.estimate.by_gains[0, 0]), 0.0)

    @property
    def _gain_factors(self) -> dict[str, dict[str, float]]:
        """Factor of each drive's torques, as it was known and as it is estimated with the payload."""
        if self.gains is None:
            return {}
        numbers = (self.gains.factor.tolist(), self.gains.deviation.tolist(), self.estimate.gains.tolist())
        return {
            drive: {"factor": factor, "deviation": deviation, "found": factor / (1.0 + error)}
            for drive, factor, deviation, error in zip(self.gains.drives, *numbers, strict=True)
        }

    def stored(self) -> PayloadResult:
        """What a file keeps: of many residuals every k-th."""
        residuals = self.estimate.residuals
        return replace(self, estimate=replace(self.estimate, residuals=residuals[:: every(residuals.size, NUMBERS)]))

    def text_for(self, controller: str) -> str:
        """The payload in a controller's own words, see `excite.payload.controllers`."""
        return controller_text(controller, self.body, self.frame.name)

    def texts(self, controllers: Collection[str]) -> dict[str, dict[str, str]]:
        """What each controller wants to know, and in which frame it expects it; nothing without a mass."""
        chosen = controllers if self.mass > 0 else ()
        return {name: {"text": self.text_for(name), "expected_frame": EXPECTED[name]} for name in chosen}

    def save(
        self, folder: str | Path, *, controllers: Collection[str] = CONTROLLERS, replace: bool = False
    ) -> list[Path]:
        """Write ``payload.json``, and what controllers want, into a folder, made if it does not exist.

        Parameters
        ----------
        folder : path
        controllers : collection of str
            That get a file.
        replace : bool
            Replace a payload that is already there.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            The folder holds a payload, is being written by another process, or cannot be written to.
        """
        place, chosen = Path(folder), controllers if self.mass > 0 else ()
        with result_folder(place):
            check_no_payload(place, chosen, replace=replace)
            further = {FILES[name]: partial(self._write_text, name) for name in chosen}
            return write_record(self, KIND, place, KIND, further=further)

    def _write_text(self, controller: str, path: Path) -> None:
        with replacing(path) as stream:
            stream.write(self.text_for(controller))

    def __repr__(self) -> str:
        """One line."""
        low, high = self.intervals[0]
        return f"<PayloadResult of {self.robot.name}: {self.mass:.4g} kg, 99 % from {low:.4g} to {high:.4g} kg>"


def check_no_payload(folder: Path, controllers: Collection[str] = (), *, replace: bool) -> None:
    """Raise `TakenError` where a folder holds a payload, or files for controllers, that may not be replaced."""
    check_not_taken(folder, PAYLOAD, "a payload", [FILES[name] for name in controllers], replace=replace)


def load_payload(path: str | Path) -> PayloadResult:
    """Load a ``payload.json``."""
    return read_record(Path(path), PayloadResult, KIND)


_PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
