"""Objective of a design: criterion, noise of the measurements, and prior knowledge of the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from excite.registry import CONVENTIONS, NEARLY, SCALES
from excite.tasks.option import essential, option, strict
from excite.tasks.precision_target import PrecisionTarget
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.quantities import check

if TYPE_CHECKING:
    from excite.tasks.criteria import Criterion


@checked
@dataclass(frozen=True)
class Belief:
    """Prior knowledge of one parameter.

    Parameters
    ----------
    name : str
        Name of a standard parameter, such as ``m3`` or ``F1c``, or of a column of the model, such as ``X7``.
    value, deviation : float
        Value and its standard deviation, above zero, in SI.
    """

    name: str
    value: float
    deviation: float

    def __post_init__(self) -> None:
        for name in ("value", "deviation"):
            check(f"prior_{name}", getattr(self, name), f"`prior`: the {name} of {self.name}")


@dataclass(frozen=True)
class Objective:
    """Criterion, its base columns, and the accuracy of measurements and prior knowledge.

    Parameters
    ----------
    base : {"gautier", "pivoted", "orthonormal"}
        Base columns of the criterion.
    criterion : str or Criterion
        A registered name, or a criterion object.
    noise : tuple of float, optional
        Standard deviation of the noise of each equation, one for all or one each [Nm, or its unit]. If not given, 1; of
        joint torques of arms whose largest torque limit is at most 10 Nm, 0.1, at most 1 Nm, 0.01, and so on.
    weighted : bool
        Rows of W are divided by the noise of their equations before M is formed.
    prior : float or tuple of Belief, optional
        Prior knowledge of the parameters: the relative uncertainty of the values in the robot's description, or values
        with deviations. It is added to M; the rows of W are then divided by their noise, see
        `excite.information.weighting`.
    after : tuple of path, Identification, Design or EarlierInformation
        Earlier results, or designs that are going to be played once, or their folders: the information in hand, which
        is added to M as prior knowledge is. A design that is played twice is given twice. Where no `noise` is given, it
        is the one that the results have measured.
    scale : {"unit", "prior", "value", "precision"}
        Scale of each column's parameter: its SI unit, its prior deviation, its value, or the half-width that
        `precision` allows it; rows are then divided by their noise.
    require : tuple of str
        Parameters that the motion must identify individually.
    interest : tuple of str
        Base parameters, or groups of them, that the criterion is for; the others are nuisance parameters, estimated
        too. All count alike if none is given. See `excite.information.goal`.
    task_motion : str, TaskMotion or Design, optional
        Motion whose torques the criteria of predicted torques are for: a design, its folder, or a file like
        trajectory.csv; if not given, states within the limits, see `excite.information.goal`.
    plausible_robots : int, optional
        Number of robots, drawn from the prior, of which the worst counts beside the described one; for ``scale`` value,
        see `excite.information.goal`.
    nearly_unidentifiable : {"drop-rounding", "keep", "drop"}
        What becomes of base parameters that motions show in theory only, in design and identification: those that exist
        by the rounding of an angle are left out of the base, see `regressors.models.base.base_parameters`; all are
        kept; or all are left out whose predicted deviation is beyond 100 times their size. The design says so.
    precision : float or PrecisionTarget, optional
        How precisely the parameters are to be known: a share of their described values, such as 0.05, or a target. The
        design states how many runs that takes, and `excite.design_for_precision` searches for the shortest experiment.
    servos : str, ServoResult or TaskServos, optional
        Identified servos, or their folder: the criterion is that of the motion which they make of the commands, by
        gain and phase, see `excite.information.tracking`; and a `precision` of servos is predicted for these.
    max_time : float
        Robot time beyond which a precision counts as out of reach [s].

    Raises
    ------
    UnknownName
        No such criterion, base, scale, or choice for what is nearly unidentifiable.
    InputError
        Invalid numbers, or required options that are missing.
    """

    base: str = essential("gautier", "name", "Base columns of the criterion.", choices=CONVENTIONS)
    criterion: str | Criterion = essential(
        "condition", "name", "Criterion to minimise; logdet for the model servo.", part="criterion"
    )
    noise: tuple[float, ...] | None = essential(
        None,
        "numbers",
        "Standard deviation of the noise; one for all equations or each, in their units.",
        unset="1, less for small arms",
        metavar="S,...",
    )
    weighted: bool = option(False, "flag", "Divide rows by their noise in the criterion.", flag="weighted/no-weighted")
    prior: float | tuple[Belief, ...] | None = option(
        None, "prior", "Prior knowledge that the criterion includes; see below.", metavar="R|FILE"
    )
    after: tuple[Any, ...] = option(
        (),
        "folders",
        "Earlier results, or designs still to be played, whose information the criterion includes; repeatable.",
        metavar="DIR,...",
        late=True,
    )
    scale: str = option("unit", "name", "Scale of the parameters in the criterion; see below.", choices=SCALES)
    require: tuple[str, ...] = option(
        (), "names", "Parameters that the motion must identify individually.", metavar="X5,F3c"
    )
    interest: tuple[str, ...] = option(
        (),
        "names",
        "Base parameters or groups that the criterion is for, the others as nuisance; see below.",
        metavar="X5,F3c,friction",
        late=True,
    )
    task_motion: Any = option(
        None,
        "file",
        "Motion whose torques the criteria torque-deviation and max-torque-deviation are for; see below.",
        metavar="DIR|FILE.csv",
        late=True,
    )
    plausible_robots: int | None = option(
        None, "integer", "The worst of this many robots drawn from the prior counts; see below.", late=True
    )
    nearly_unidentifiable: str = option(
        "drop-rounding",
        "name",
        "Parameters that only rounding shows (drop-rounding), or whose predicted deviation is 100 times their size.",
        choices=NEARLY,
    )
    precision: float | PrecisionTarget | None = essential(
        None,
        "precision",
        "Half-width of the intervals, as a share; of each parameter, for which the shortest experiment is sought.",
        metavar="P%|FILE",
        late=True,
    )
    servos: Any = option(
        None,
        "file",
        "Identified servos: the criterion is that of the motion that they make of the commands; see below.",
        metavar="DIR",
        late=True,
    )
    max_time: float = option(600.0, "number", "Robot time beyond which a precision is out of reach.", late=True)

    def __post_init__(self) -> None:
        strict(self)
        if self.weighted and self.noise is None:
            raise InputError(
                "`weighted` divides rows by the noise of their equations, which is not given; give `noise`"
            )
        if self.scale == "prior" and self.prior is None:
            raise InputError("`scale='prior'` needs prior knowledge, but none is given; give `prior`")
        if self.plausible_robots is not None and (self.scale != "value" or self.prior is None):
            raise InputError(
                "`plausible_robots` are drawn from prior knowledge, and differ in the values that columns are scaled "
                "by; give `prior` and `scale='value'`"
            )
        if self.interest and self.base == "orthonormal":
            raise InputError(
                "`interest` names base parameters, but columns of the orthonormal base are not single parameters; "
                "choose another `base`"
            )
        if self.scale == "precision" and self.precision is None:
            raise InputError("`scale='precision'` needs a precision, but none is given; give `precision`")
        if self.precision is not None and self.prior is not None:
            raise InputError(
                "`precision` counts what the runs measure alone, without prior knowledge; leave out `prior`"
            )
        if self.scale != "unit" and self.base == "orthonormal":
            raise InputError(
                f"scale {self.scale}: columns of the orthonormal base are not single parameters; choose another base"
            )
