"""Settings of `fit_friction`: how friction curves are obtained from logs."""

from __future__ import annotations

from dataclasses import dataclass

from excite.tasks.option import essential, option
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

    window: float | None = option(
        None, "number", "Length of a window.", metavar="S", unset="the plan's whole windows; 0.3 without"
    )
    tolerance: float = option(0.03, "number", "Change of speed allowed over a window.", metavar="X")
    speed: str = option(
        "auto",
        "name",
        "averaged: also use windows of changing speed, with a model that subtracts the torque of acceleration; auto: "
        "only if constant speeds are too few and the drive moves alone.",
        choices=("auto", "constant", "averaged"),
    )
    gravity: str = essential(
        "auto", "name", "How gravity is removed; see below.", choices=("auto", "model", "symmetric", "none")
    )
    model: str = essential(
        "auto",
        "name",
        "Equation of the curve; auto: the one with the smallest criterion.",
        choices=("auto", "coulomb-viscous", "stribeck", "table"),
    )
    exponent: float | None = option(
        None, "number", "Exponent of the Stribeck term.", metavar="D", unset="1 or 2, whichever fits better"
    )
    criterion: str = option("bic", "name", "Information criterion that chooses the equation.", choices=("bic", "aicc"))
    temperature: str = essential(
        "auto", "name", "Whether friction is linear in the log's temperature.", choices=("auto", "linear", "none")
    )
    load: str = essential(
        "auto",
        "name",
        "Whether friction grows with the torque that the drive carries.",
        choices=("auto", "linear", "none"),
    )
    stiction: str = option(
        "fit",
        "name",
        "fit: torques at which a drive broke away are points of its curve at speed zero.",
        choices=("fit", "report"),
    )

    def __post_init__(self) -> None:
        check_options(self, ("window", "tolerance", "exponent"))

    @property
    def length(self) -> float:
        """Length of the windows that are searched for [s]."""
        return WINDOW if self.window is None else self.window
