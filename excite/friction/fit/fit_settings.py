"""Settings of `fit_friction`: how friction curves are obtained from logs."""

from __future__ import annotations

from dataclasses import dataclass

from regressors.arguments import checked
from regressors.quantities import check_options

WINDOW = 0.3  # [s], where there is no plan; that of [KD96] for arm and forearm


@checked
@dataclass(frozen=True)
class FitSettings:
    """Settings of a friction fit.

    Parameters
    ----------
    window : float, optional
        Length of the windows [s]; the plan's whole windows, or 0.3 s without a plan, if not given.
    tolerance : float
        Allowed change of speed over a window, relative to the speed.
    speed : {"auto", "constant", "averaged"}
        Whether windows of changing speed count with their mean speed [KD96] section 4; needs a model, which subtracts
        what acceleration takes. auto takes them where constant ones do not determine the change with speed, and
        the drive moves alone.
    gravity : {"auto", "model", "symmetric", "none"}
        auto subtracts it by the model; where masses are not known it trusts a plan that cancels it, or a structure in
        which it never loads the drive.
    model : {"auto", "coulomb-viscous", "stribeck", "table"}
    exponent : float, optional
        Of the Stribeck term; chosen between 1 and 2 if not given.
    criterion : {"bic", "aicc"}
    temperature : {"auto", "linear", "none"}
        Whether friction is linear in temperature; auto where the log's temperature changes by 2 K or more.
    load : {"auto", "linear", "none"}
        Whether friction grows with the torque that the drive carries; auto where that differs between the windows.
    stiction : {"fit", "report"}
        Whether break-away torques are points of the curve at speed zero, or only reported.
    """

    window: float | None = None
    tolerance: float = 0.03
    speed: str = "auto"
    gravity: str = "auto"
    model: str = "auto"
    exponent: float | None = None
    criterion: str = "bic"
    temperature: str = "auto"
    load: str = "auto"
    stiction: str = "fit"

    def __post_init__(self) -> None:
        check_options(self, ("window", "tolerance", "exponent"))

    @property
    def length(self) -> float:
        """Length of the windows that are searched for [s]."""
        return WINDOW if self.window is None else self.window
