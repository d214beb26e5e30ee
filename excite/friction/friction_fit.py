"""Friction curves of a robot's drives, with the data that they were fitted to."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.friction.breakaway_tests import repeated_break_aways
from excite.friction.breakaway_torque import BreakAway, MeanBreakAway, mean_break_aways, rest_points
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.curve_fit import (
    WARMER,
    CurveFit,
    alike_remarks,
    chosen_fit,
    curve_uncertainty,
    load_remarks,
    stiction_remarks,
    table_of,
    temperature_remarks,
    why_no_curve,
)
from excite.friction.data_set import data_set_of, sources_of
from excite.friction.friction_equations import Form, forms
from excite.friction.plan_match import PlannedRuns, Source
from excite.friction.points import DriveLog, Point, RigidModel, drive_log
from excite.logs.log import Log, LogReference
from excite.storage.records import Saved, write_record
from excite.storage.result_folder import check_not_taken
from excite.tasks.friction_file import write_friction
from regressors.errors import InputError, UnknownName
from regressors.robot.friction.curve import FrictionCurve
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot, transmission_of

KIND, FIT, FRICTION, FIGURE = "friction-fit", "fit.json", "friction.yaml", "friction"


@dataclass(frozen=True, eq=False, repr=False)
class FrictionFit(Saved):
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
        uncertain = {c.drive: curve_uncertainty(c.fit) for c in self.characteristics if c.fit is not None}
        return FrictionCurves({c.drive: c.curve for c in self.characteristics}, uncertain)

    def __repr__(self) -> str:
        """One line."""
        drives = ", ".join(characteristic.drive for characteristic in self.characteristics)
        return f"<FrictionFit of {self.robot}: curves of {drives} from {len(self.logs)} log(s)>"

    def _written(self, place: Path, *, replace: bool) -> list[Path]:
        check_no_fit(place, replace=replace)
        further = {FRICTION: lambda path: write_friction(self.curves, path)}
        return write_record(self, KIND, place, "fit", [FIGURE], further, KIND)


def check_no_fit(folder: Path, names: Collection[str] = (FRICTION,), *, replace: bool = False) -> None:
    """Raise `TakenError` where a folder holds a fit, or other files of the names, that may not be replaced."""
    check_not_taken(folder, FIT, "a fit", names, replace=replace)


_SMALL_PATH = 0.05  # of the path of the drive that moves most: a drive that moves less was not measured
_HEAVIER = 1.0  # of the median friction: least range of the torque that the drive carries


def characteristics(
    robot: Robot,
    logs: Sequence[Log],
    settings: FitSettings,
    rigid: Callable[[Robot], RigidModel] | None,
    drives: Sequence[str] | None = None,
    plan: Mapping[str, PlannedRuns] | None = None,
) -> tuple[Characteristic, ...]:
    """Fit friction curves of the drives that move in the logs."""
    measured = [drive_log(log, robot, number) for number, log in enumerate(logs)]
    shown = sources_of(measured, settings, rigid, plan)
    for name in drives or ():
        _check_shown(name, robot, shown, plan)
    still = [] if drives or plan is not None else _hardly_moving(measured)
    fitted, reasons = [], []
    for drive in drives or [name for name in shown if name not in still]:
        try:
            fitted.append(_characteristic(drive, robot, shown[drive], settings, None if plan is None else plan[drive]))
        except InputError as error:
            if drives:
                raise
            reasons.append(str(error))
    if not fitted:
        raise InputError("; ".join(_together(reasons)))
    if still:
        reasons.append(f"{', '.join(still)} move{'s' if len(still) == 1 else ''} much less than the other drives")
    left_out = tuple(f"left out: {reason}" for reason in _together(reasons))
    return (replace(fitted[0], notes=(*fitted[0].notes, *left_out)), *fitted[1:])


def _check_shown(name: str, robot: Robot, shown: Mapping[str, object], plan: Mapping[str, PlannedRuns] | None) -> None:
    if name in shown:
        return
    if plan is not None and name in plan:
        raise InputError(
            f"no log contains the runs of {name} in {plan[name].plan}; they contain those of {', '.join(shown)}"
        )
    raise UnknownName("drive" if robot.transmission else "joint", name, tuple(shown))


def _together(reasons: Sequence[str]) -> list[str]:
    """Remarks on drives, identical ones merged with all names."""
    names: dict[str, list[str]] = {}
    for name, _, sentence in (
        reason.rpartition(": ") if ": " not in reason else reason.partition(": ") for reason in reasons
    ):
        names.setdefault(sentence, []).append(name)
    return [f"{', '.join(dict.fromkeys(of))}: {sentence}" if all(of) else sentence for sentence, of in names.items()]


def _hardly_moving(measured: Sequence[DriveLog]) -> list[str]:
    """Drives whose path in every log is a small part of the path of the drive that moves most."""
    paths: dict[str, float] = {}
    for part in measured:
        for name, way in zip(part.names, np.ptp(part.z, axis=0), strict=True):
            paths[name] = max(paths.get(name, 0.0), float(way))
    return [name for name, way in paths.items() if way < _SMALL_PATH * max(paths.values())]


def _characteristic(
    drive: str, robot: Robot, sources: Sequence[Source], settings: FitSettings, runs: PlannedRuns | None
) -> Characteristic:
    unit = _unit(robot, drive)
    points, gravity, breaks, notes = data_set_of(drive, sources, settings, runs, unit)
    settings = replace(settings, gravity=gravity)
    _check_directions(drive, points, settings)
    reference, of_temperature = _reference(drive, points, settings)
    loads = _loads(drive, points, settings, unit)
    offset = settings.gravity != "symmetric"
    best: CurveFit | None = None
    others: tuple[CurveFit, ...] = ()
    failed: dict[str, str] = {}
    rests: tuple[Point, ...] = ()
    if settings.model != "table":
        candidates = _candidates(settings, reference, loads, offset=offset)
        if settings.stiction == "fit" and any(form.stribeck for form in candidates):
            trusted = repeated_break_aways(breaks) if runs is None else breaks
            rests = rest_points(trusted, paired=not offset)
        best, others, failed = chosen_fit((*points, *rests), candidates, settings.criterion)
        if rests and others and not any(candidate.form.stribeck for candidate in others):
            without = "; ".join(dict.fromkeys(failed.values()))
            notes.append(f"break-away torques are not in the curve: no curve with stiction can be fitted: {without}")
            rests = ()
            best, others, _ = chosen_fit(points, candidates, settings.criterion)
        if best is None:
            raise InputError(f"{drive}: {why_no_curve(points, failed, unit, _speed_unit(unit))}")
    notes += temperature_remarks(of_temperature, reference, best, settings, breaks)
    notes += load_remarks(loads, best, settings, unit)
    alone = runs is None and len(repeated_break_aways(breaks)) < len(breaks)
    slowest = f"{min(abs(p.speed) for p in points):.3g} {_speed_unit(unit)}"
    notes += stiction_remarks(len(rests), breaks, best, settings, slowest, alone=alone)
    notes += alike_remarks(others, settings)
    if not offset:
        notes.append(
            "gravity is cancelled between both directions, and with it any offset and any difference between directions"
        )
    return Characteristic(drive, unit, gravity, points, rests, best, others, failed, breaks, tuple(notes))


def _check_directions(drive: str, points: Sequence[Point], settings: FitSettings) -> None:
    ways = {p.speed > 0 for p in points}
    if settings.gravity != "symmetric" and len(ways) == 1:
        own, missing = ("positive", "negative") if True in ways else ("negative", "positive")
        raise InputError(
            f"{drive}: all {len(points)} windows have {own} speed, so friction cannot be separated from an offset or "
            f"an error of gravity; add runs of {missing} speed"
        )


def _known(drive: str, values: Sequence[float | None], asked: str, unknown: str) -> list[float]:
    """What friction may be linear in, at every point; none where that is not asked for, or not known of every one."""
    known = [value for value in values if value is not None]
    if asked == "linear" and (len(known) < len(values) or not known):
        raise InputError(f"{drive}: {unknown}")
    return known if asked != "none" and len(known) == len(values) else []


def _reference(drive: str, points: Sequence[Point], settings: FitSettings) -> tuple[float | None, str]:
    """Reference temperature, where friction may depend on temperature, and a description of the temperature."""
    unknown = (
        "the logs have no temperature of every window (NAME.temperature); record it, or leave out "
        "`temperature='linear'`"
    )
    if not (known := _known(drive, [p.temperature for p in points], settings.temperature, unknown)):
        return None, ""
    low, high = min(known), max(known)
    if high - low >= WARMER:
        return float(np.mean(known)), f"{low:.3g} to {high:.3g} deg C"
    of_temperature = f"temperature is constant, {low:.3g} to {high:.3g} deg C"
    if settings.temperature == "linear":
        raise InputError(
            f"{drive}: {of_temperature}, so friction cannot be fitted as a function of it; repeat the runs cold "
            f"and warm, {WARMER:g} K apart or more, or leave out `temperature='linear'`"
        )
    return None, of_temperature


def _loads(drive: str, points: Sequence[Point], settings: FitSettings, unit: str) -> tuple[float, float] | None:
    """Least and largest torque that the drive carries, where friction may grow with it."""
    unknown = (
        "the torque that the drive carries is not known without a model (`gravity='model'`), so "
        "friction cannot be fitted as a function of it; leave out `load='linear'`"
    )
    if not (known := _known(drive, [p.load for p in points], settings.load, unknown)):
        return None
    low, high = min(known), max(known)
    if high - low >= _HEAVIER * float(np.median([abs(p.torque) for p in points])):
        return low, high
    if settings.load == "linear":
        raise InputError(
            f"{drive}: it carries {low:.3g} to {high:.3g} {unit}, too small a range to fit friction over load; "
            "repeat the runs in poses in which gravity weighs more and less, or leave out `load='linear'`"
        )
    return None


def _candidates(
    settings: FitSettings, reference: float | None, loads: tuple[float, float] | None, *, offset: bool
) -> tuple[Form, ...]:
    """Candidate forms: with and without each effect that may matter, or only with it if it is asked for."""
    of = partial(forms, settings.model, settings.exponent, offset=offset)
    temperatures = [reference] if reference is None or settings.temperature == "linear" else [None, reference]
    shares = [False] if loads is None else [True] if settings.load == "linear" else [False, True]
    return tuple(form for load in shares for warm in temperatures for form in of(temperature=warm, load=load))


def _speed_unit(unit: str) -> str:
    return "rad/s" if unit == "Nm" else "m/s"


def _unit(robot: Robot, drive: str) -> str:
    transmission = transmission_of(robot)
    row = transmission.coupling[[d.name for d in transmission.drives].index(drive)]
    return "Nm" if robot.joints[int(np.flatnonzero(row)[-1])].kind == "revolute" else "N"


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
