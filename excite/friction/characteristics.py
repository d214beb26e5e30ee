"""Friction characteristics of a robot from logs: windows, points, the curve that fits best, and break-away torques."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from excite.friction.fits import Fit, Form, chosen_fit, forms, table_of
from excite.friction.points import DriveLog, Point, drive_log, gravity_share, paired_points, points_of, windows_of
from excite.friction.rigid import RigidModel
from excite.friction.stiction import BreakAway, break_aways
from excite.friction.windows import ConstantWindow, Search
from excite.logs.log import Log
from regressors.errors import InputError, UnknownName
from regressors.friction import FrictionCurve
from regressors.robot import Robot

_LEAST_SHARE = 0.01  # of the largest speed in the log: below, a drive rests
_SMALL_WAY = 0.05  # of the way of the drive that moves most: a drive that goes no further is not what was measured
_AVERAGED_TOLERANCE = 0.5
_DIFFERENT = 1.3  # speeds of one direction differ if the largest is so many times the smallest
_CANCELLED = 0.05
_WARMER = 2.0  # [K]
_FEWEST = 3

Spans = tuple[tuple[float, float], ...] | None


@dataclass(frozen=True)
class FitSettings:
    """How logs are made into curves.

    Parameters
    ----------
    window : float
        Length of the windows [s].
    tolerance : float
        Change of speed over a window that is allowed, relative to the speed.
    speed : {"auto", "constant", "averaged"}
        Whether windows of changing speed count with their mean speed [KD96] section 4; needs a model, which subtracts
        what acceleration takes. auto takes them where constant ones do not show how friction changes with speed.
    gravity : {"model", "symmetric", "none"}
    model : {"auto", "coulomb-viscous", "stribeck", "table"}
    exponent : float, optional
        Of the Stribeck term; chosen between 1 and 2 if not given.
    criterion : {"bic", "aicc"}
    temperature : {"auto", "linear", "none"}
        Whether friction is linear in temperature; auto where the log's temperature changes by 2 K or more.
    """

    window: float = 0.3
    tolerance: float = 0.03
    speed: str = "auto"
    gravity: str = "model"
    model: str = "auto"
    exponent: float | None = None
    criterion: str = "bic"
    temperature: str = "auto"

    def __post_init__(self) -> None:
        for name in ("window", "tolerance"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a number greater than zero, given {value:g}")
        if self.exponent is not None and not (np.isfinite(self.exponent) and self.exponent > 0):
            raise InputError(f"exponent must be a number greater than zero, given {self.exponent:g}")


@dataclass(frozen=True, eq=False)
class Characteristic:
    """Friction of one drive.

    Parameters
    ----------
    drive : str
    unit : str
        Of its torque.
    points : tuple of Point
    curve : FrictionCurve
    fit : Fit, optional
        None for a table.
    others : tuple of Fit
        All that were fitted, best first.
    failed : dict of str to str
        Forms that could not be fitted, and why.
    stiction : tuple of BreakAway
    notes : tuple of str
    """

    drive: str
    unit: str
    points: tuple[Point, ...]
    curve: FrictionCurve
    fit: Fit | None
    others: tuple[Fit, ...]
    failed: dict[str, str]
    stiction: tuple[BreakAway, ...]
    notes: tuple[str, ...]


def characteristics(
    robot: Robot,
    logs: Sequence[Log],
    settings: FitSettings,
    rigid: Callable[[Robot], RigidModel] | None,
    drives: Sequence[str] | None = None,
    spans: Mapping[str, tuple[tuple[float, float], ...]] | None = None,
) -> tuple[Characteristic, ...]:
    """Friction curves of the drives that logs show.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    logs : sequence of Log
        With torques.
    settings : FitSettings
    rigid : callable, optional
        Model without friction for the robot of a log's joints; None if there is none.
    drives : sequence of str, optional
        Each must be shown; all drives that show a curve if not given, the others named in the notes of the first.
    spans : mapping of str to tuple of (float, float), optional
        Per drive, where its windows lie, in seconds since the first sample of each log; found if not given.

    Raises
    ------
    InputError
        No stretch of constant speed, one direction only, gravity in the way, a temperature that does not change.
    UnknownName
        A drive that the logs do not show.
    """
    measured = [drive_log(log, robot) for log in logs]
    known = tuple(dict.fromkeys(name for part in measured for name in part.names))
    for name in drives or ():
        if name not in known:
            raise UnknownName("drive" if robot.transmission else "joint", name, known)
    models = [None if rigid is None else rigid(part.robot) for part in measured]
    found, reasons = [], []
    still = set() if drives else _hardly_moving(measured)
    for drive in drives or known:
        if drive in still:
            reasons.append(f"{drive} hardly moves beside the others")
            continue
        try:
            found.append(_characteristic(drive, robot, measured, models, settings, (spans or {}).get(drive)))
        except InputError as error:
            if drives:
                raise
            reasons.append(str(error))
    if not found:
        raise InputError("; ".join(dict.fromkeys(reasons)))
    left_out = tuple(f"left out: {reason}" for reason in dict.fromkeys(reasons))
    return (replace(found[0], notes=(*found[0].notes, *left_out)), *found[1:])


def _hardly_moving(measured: Sequence[DriveLog]) -> set[str]:
    """Drives whose way in every log is a small part of the way of the drive that moves most."""
    ways: dict[str, float] = {}
    for part in measured:
        for name, way in zip(part.names, np.ptp(part.z, axis=0), strict=True):
            ways[name] = max(ways.get(name, 0.0), float(way))
    return {name for name, way in ways.items() if way < _SMALL_WAY * max(ways.values())}


class NoWindows(InputError):
    """A drive has no window to fit to."""


def _characteristic(
    drive: str,
    robot: Robot,
    measured: Sequence[DriveLog],
    models: Sequence[RigidModel | None],
    settings: FitSettings,
    spans: Spans,
) -> Characteristic:
    points, notes = _points(drive, measured, models, settings, spans)
    _check_directions(drive, points, settings)
    reference, said = _reference(drive, points, settings)
    offset = settings.gravity != "symmetric"
    best: Fit | None
    others: tuple[Fit, ...] = ()
    failed: dict[str, str] = {}
    if settings.model == "table":
        best = None
        curve: FrictionCurve = table_of(points)
    else:
        candidates = _candidates(settings, reference, offset=offset)
        try:
            best, others, failed = chosen_fit(points, candidates, settings.criterion)
        except InputError as error:
            raise InputError(f"{drive}: {len(points)} windows, {error}; runs at more speeds would cure it") from error
        curve = best.curve
    notes += _temperature_said(said, reference, best, settings)
    if not offset:
        notes.append("gravity cancelled between both directions: an offset and what differs between directions with it")
    stiction = tuple(
        one
        for number, (part, model) in enumerate(zip(measured, models, strict=True))
        if drive in part.names
        for one in break_aways(
            part, drive, _search(part, drive, settings).least_speed, _subtracted(model, settings), number
        )
    )
    return Characteristic(drive, _unit(robot, drive), points, curve, best, others, failed, stiction, tuple(notes))


def _points(
    drive: str, measured: Sequence[DriveLog], models: Sequence[RigidModel | None], settings: FitSettings, spans: Spans
) -> tuple[tuple[Point, ...], list[str]]:
    """Points of all logs, and what was found; of windows of changing speed where these are wanted, or needed."""
    found: list[Point] = []
    constant = replace(settings, speed="constant")
    if settings.speed != "averaged":
        found, said = _points_at(drive, measured, models, constant, spans)
        if settings.speed == "constant" or settings.gravity != "model" or _shows_speed(found):
            if not found:
                raise NoWindows(
                    f"{drive}: {said}; make runs that keep one speed for {settings.window:g} s or longer "
                    "('excite friction plan' designs them), or take a shorter --window or a larger --tolerance"
                )
            return tuple(found), [said]
    averaged = replace(settings, speed="averaged", tolerance=max(settings.tolerance, _AVERAGED_TOLERANCE))
    more, said = _points_at(drive, measured, models, averaged, spans)
    if not _shows_speed(more):
        if found:
            return tuple(found), [said]
        raise NoWindows(
            f"{drive}: {said}; it hardly moves: make runs at constant speed ('excite friction plan' designs them)"
        )
    return tuple(more), [
        f"{len(found)} windows of constant speed do not show how friction changes with speed: others count "
        "too, with their mean speed, what acceleration takes is subtracted by the model",
        said,
    ]


def _points_at(
    drive: str, measured: Sequence[DriveLog], models: Sequence[RigidModel | None], settings: FitSettings, spans: Spans
) -> tuple[list[Point], str]:
    found: list[Point] = []
    changing = resting = 0
    for number, (part, model) in enumerate(zip(measured, models, strict=True)):
        if drive not in part.names:
            continue
        subtracted = _subtracted(model, settings)
        alone = subtracted is None or settings.speed == "constant"
        windows = windows_of(part, drive, _search(part, drive, settings, spans), alone=alone)
        changing, resting = changing + windows.changing, resting + windows.resting
        if settings.gravity == "none":
            _check_cancelled(part, drive, windows.windows, model)
        if settings.gravity == "symmetric":
            found += paired_points(part, drive, windows.windows, number)
        else:
            found += points_of(part, drive, windows.windows, subtracted, number)
    what = "pairs of windows over the same path" if settings.gravity == "symmetric" else "windows"
    kind = (
        "constant speed" if settings.speed == "constant" else f"speed that changes by {settings.tolerance:.0%} at most"
    )
    return found, (
        f"{len(found)} {what} of {settings.window:g} s at {kind}; left out: {changing} where speed changes, "
        f"{resting} at rest"
    )


def _search(part: DriveLog, drive: str, settings: FitSettings, spans: Spans = None) -> Search:
    """Rest is told from motion by the largest speed over a window's length."""
    z, time = part.z[:, part.names.index(drive)], part.log.time
    later = np.searchsorted(time, time + settings.window).clip(max=time.size - 1)
    fastest = float(np.abs(z[later] - z).max()) / settings.window
    return Search(settings.window, settings.tolerance, max(_LEAST_SHARE * fastest, 1e-4), spans)


def _subtracted(model: RigidModel | None, settings: FitSettings) -> RigidModel | None:
    return model if settings.gravity == "model" else None


def _shows_speed(points: Sequence[Point]) -> bool:
    """Whether there are different speeds in every direction that there is."""
    if len(points) < _FEWEST:
        return False
    sides = [[abs(p.speed) for p in points if p.speed * sign > 0] for sign in (1, -1)]
    return all(max(side) > _DIFFERENT * min(side) for side in sides if side)


def _check_directions(drive: str, points: Sequence[Point], settings: FitSettings) -> None:
    if settings.gravity == "symmetric":
        return
    for sign, missing in ((1, "negative"), (-1, "positive")):
        if all(p.speed * sign > 0 for p in points):
            raise InputError(
                f"{drive}: all {len(points)} windows have {'positive' if sign > 0 else 'negative'} speed, so friction "
                f"cannot be told from an offset or an error of gravity: add runs of {missing} speed"
            )


def _check_cancelled(part: DriveLog, drive: str, windows: Sequence[ConstantWindow], model: RigidModel | None) -> None:
    """That gravity does not matter, where it is not to be subtracted."""
    cure = (
        "--gravity model subtracts it (--parameters RESULT where the description is not good enough), --gravity "
        "symmetric cancels it between both directions over the same path"
    )
    if model is None:
        raise InputError(f"{part.log.source}: whether gravity acts on {drive} is not known without a model: {cure}")
    share = gravity_share(part, drive, windows, model)
    if share > _CANCELLED:
        raise InputError(
            f"{part.log.source}: gravity is not cancelled in the windows of {drive}, it takes up to {share:.0%} of "
            f"what their torques are: {cure}"
        )


def _reference(drive: str, points: Sequence[Point], settings: FitSettings) -> tuple[float | None, str]:
    """Reference temperature, where friction may depend on temperature, and what the temperature was."""
    if settings.temperature == "none":
        return None, ""
    known = [p.temperature for p in points if p.temperature is not None]
    if len(known) < len(points) or not known:
        if settings.temperature == "linear":
            raise InputError(
                f"{drive}: the logs have no temperature of every window (NAME.temperature): record it, or leave out "
                "--temperature linear"
            )
        return None, ""
    low, high = min(known), max(known)
    if high - low < _WARMER:
        said = f"temperature is constant, {low:.3g} to {high:.3g} deg C"
        if settings.temperature == "linear":
            raise InputError(
                f"{drive}: {said}, so friction cannot be fitted as a function of it: repeat the runs cold and warm, "
                f"{_WARMER:g} K apart or more, or leave out --temperature linear"
            )
        return None, said
    return float(np.mean(known)), f"{low:.3g} to {high:.3g} deg C"


def _candidates(settings: FitSettings, reference: float | None, *, offset: bool) -> tuple[Form, ...]:
    """Forms to choose among: of a temperature that changes, with and without it, unless it is asked for."""
    of = partial(forms, settings.model, settings.exponent, offset=offset)
    if reference is None or settings.temperature == "linear":
        return of(temperature=reference)
    return (*of(temperature=None), *of(temperature=reference))


def _temperature_said(said: str, reference: float | None, best: Fit | None, settings: FitSettings) -> list[str]:
    if reference is None:
        return [said] if said else []
    if best is None:
        return [f"temperature, {said}, is not in a table: it is the mean of what was measured"]
    if best.form.temperature is None:
        return [f"temperature, {said}, does not matter by {settings.criterion.upper()}"]
    return [f"linear in temperature, {said}; the file holds the curve at {reference:.4g} deg C with its slopes"]


def _unit(robot: Robot, drive: str) -> str:
    if robot.transmission is None:
        return "Nm" if robot.joints[robot.joint_names.index(drive)].kind == "revolute" else "N"
    row = robot.transmission.coupling[[d.name for d in robot.transmission.drives].index(drive)]
    return "Nm" if robot.joints[int(np.flatnonzero(row)[-1])].kind == "revolute" else "N"
