"""Friction curves of a robot's drives, with the data that they were fitted to."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from excite.friction.fit.characteristics import Characteristic
from excite.friction.fit.curve_fit import curve_uncertainty
from excite.friction.fit.fit_settings import FitSettings
from excite.logs.log import LogReference
from excite.registry import built_in
from excite.storage.records import read_record, write_record
from excite.storage.result_folder import check_not_taken, result_folder
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves

KIND, FIT, FRICTION, FIGURE = "friction-fit", "fit.json", "friction.yaml", "friction"


@dataclass(frozen=True, eq=False, repr=False)
class FrictionFit:
    """Result of fitting friction curves; the same when it is loaded.

    Parameters
    ----------
    robot, sha256 : str
        Name of the robot, and hash of its description.
    logs : tuple of LogReference
    settings : FitSettings
    characteristics : tuple of Characteristic
        One per drive.
    gravity_source : str or None
        Source of the parameters with which gravity was subtracted.
    provenance : mapping
    """

    robot: str
    sha256: str
    logs: tuple[LogReference, ...]
    settings: FitSettings
    characteristics: tuple[Characteristic, ...]
    gravity_source: str | None
    provenance: Mapping[str, Any]

    def __post_init__(self) -> None:
        """Check that there is a drive."""
        if not self.characteristics:
            raise InputError("a fit is of one drive or more, given none")

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
        return f"<FrictionFit of {self.robot}: curves of {drives} from {len(self.logs)} log(s)>"

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
        place, write = Path(folder), built_in("writer", "friction curves")
        with result_folder(place):
            check_no_fit(place, replace=replace)
            further = {FRICTION: lambda path: write(self.curves, path)}
            return write_record(self, KIND, place, "fit", [FIGURE], further, KIND)


def check_no_fit(folder: Path, names: Collection[str] = (FRICTION,), *, replace: bool = False) -> None:
    """Raise `TakenError` where a folder holds a fit, or other files of the names, that may not be replaced."""
    check_not_taken(folder, FIT, "a fit", names, replace=replace)


def load_friction_fit(path: str | Path) -> FrictionFit:
    """Load a ``fit.json`` of friction curves."""
    return read_record(Path(path), FrictionFit, KIND)
