"""Friction curves of a robot's drives, with the data that they were fitted to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from excite.friction.fit.characteristic import Characteristic
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.fit_uncertainty import curve_uncertainty
from excite.logs.log import Log
from excite.registry import built_in
from regressors.friction.curves import FrictionCurves
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class FrictionFit:
    """Result of fitting friction curves.

    Parameters
    ----------
    robot : Robot
    logs : tuple of Log
    settings : FitSettings
    characteristics : tuple of Characteristic
        One per drive.
    gravity_source : str or None
        Source of the parameters with which gravity was subtracted.
    provenance : mapping
    """

    robot: Robot
    logs: tuple[Log, ...]
    settings: FitSettings
    characteristics: tuple[Characteristic, ...]
    gravity_source: str | None
    provenance: Mapping[str, Any]

    @property
    def curves(self) -> FrictionCurves:
        """The curves with the covariance of their parameters."""
        fits = {
            characteristic.drive: characteristic.fit
            for characteristic in self.characteristics
            if characteristic.fit is not None
        }
        return FrictionCurves(
            {characteristic.drive: characteristic.curve for characteristic in self.characteristics},
            {drive: curve_uncertainty(fit) for drive, fit in fits.items()},
        )

    def __repr__(self) -> str:
        """One line."""
        drives = ", ".join(characteristic.drive for characteristic in self.characteristics)
        return f"<FrictionFit of {self.robot.name}: curves of {drives} from {len(self.logs)} log(s)>"

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the curves and the fitted data into a folder, made if it does not exist.

        Parameters
        ----------
        folder : path
        replace : bool
            Replace a fit that is already there.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            The folder holds a fit, or cannot be written to.
        """
        files: list[Path] = built_in("writer", "friction fit")(self, folder, replace=replace)
        return files
