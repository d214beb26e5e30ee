"""What is shown of a fit of friction curves: parameters with intervals, curves compared, break-aways, points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_fit import FIGURE, KIND, Characteristic, FrictionFit
from excite.views.view import UNIT, Drawing, View, ViewTable, numbers, texts

_GRAVITY = {"model": "subtracted by a model", "symmetric": "cancelled by both directions", "none": "none"}
_SCATTER = 1.5  # of the points over their noise: what is more is said


def friction_fit_view(fit: FrictionFit) -> View:
    """View of a fit of friction curves."""
    drives = fit.characteristics
    return View(
        kind="friction",
        title=f"friction of {fit.robot}",
        verdict=_verdict(drives),
        summary=("coulomb and viscous friction with 99 % intervals; scatter: of the points, over what noise explains",),
        against=tuple(f"{d.drive}: {form} is not fitted: {why}" for d in drives for form, why in d.failed.items()),
        remarks=(
            *(f"{d.drive}: gravity is {_GRAVITY.get(d.gravity, d.gravity)}" for d in drives),
            *(f"{d.drive}: {note}" for d in drives for note in (*d.notes, *_scatter(d))),
            *(f"{log.file}: {each}" for log in fit.logs for each in log.left_out),
        ),
        asked=(("robot", fit.robot), *_settings(fit.settings)),
        tables=(_drives(drives), _parameters(drives), _compared(drives), *_break_aways(drives), _points(drives)),
        figures=(Drawing("Friction over speed", FIGURE, "friction_plots.friction_figure", (fit.robot, drives)),),
        filed=KIND,
        facts={
            "robot": fit.robot,
            "robot_sha256": fit.sha256,
            **{f"log {log.file} sha256": log.sha256 for log in fit.logs},
            **fit.provenance,
        },
    )


def _verdict(drives: tuple[Characteristic, ...]) -> str:
    words = [f"{d.drive} by {d.fit.form.name}" for d in drives if d.fit is not None]
    words += [f"{d.drive} by a table of its points" for d in drives if d.fit is None]
    held = [f"{d.drive} {name}" for d in drives if d.fit is not None for name in d.fit.held]
    not_known = f" The points bound, but do not determine: {', '.join(held)}." if held else ""
    points, count = sum(len(d.points) for d in drives), len(drives)
    begin = f"Friction curves of {count} drive{'s' * (count > 1)} from {points} windows of constant speed"
    return f"{begin}: {'; '.join(words)}.{not_known}"


def _scatter(d: Characteristic) -> tuple[str, ...]:
    if d.fit is None or d.fit.scatter <= _SCATTER:
        return ()
    return (
        f"the points scatter {d.fit.scatter:.2g} times as much as noise within the windows explains; "
        "the intervals allow for it",
    )


def _settings(settings: FitSettings) -> tuple[tuple[str, str], ...]:
    default = FitSettings()
    given = ((each.name, getattr(settings, each.name), getattr(default, each.name)) for each in fields(default))
    return tuple((name.replace("_", " "), f"{value}") for name, value, usual in given if value not in (None, usual))


def _units(unit: str) -> dict[str, str]:
    """Unit of each parameter of a drive."""
    speed, viscous = ("rad/s", "Nm s/rad") if unit == "Nm" else ("m/s", "N s/m")
    per_kelvin = {"coulomb_temperature": f"{unit}/K", "viscous_temperature": f"{viscous}/K"}
    return {
        **dict.fromkeys(("coulomb", "stiction", "offset"), unit),
        "viscous": viscous,
        "stribeck": speed,
        **per_kelvin,
    }


def _drives(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = (
        *texts("drive", "equation", brief=True),
        *numbers("points", brief=True),
        *texts("Coulomb", "viscous", brief=True),
        *numbers("scatter", brief=True),
    )
    rows = tuple(
        (
            d.drive,
            "table" if d.fit is None else d.fit.form.name,
            len(d.points),
            _value(d, "coulomb"),
            _value(d, "viscous"),
            None if d.fit is None else d.fit.scatter,
        )
        for d in drives
    )
    return ViewTable("drives", "Curves", columns, rows)


def _value(d: Characteristic, parameter: str) -> str:
    """A parameter with its interval; in the backward direction where the two differ."""
    known = {} if d.fit is None else d.fit.parameters
    named = [each for name, each in known.items() if name.rpartition(".")[2] == parameter]
    if not named:
        return "-"
    half = named[-1]["interval99"] or 0.0
    return f"{named[-1]['value']:.4g} +- {half:.1g} {_units(d.unit)[parameter]}"


def _parameters(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = (
        *texts("drive", "parameter"),
        *numbers("value"),
        *numbers("lower", "upper", missing="held"),
        UNIT,
        *texts("curve"),
    )
    title = "Parameters of the curves with their 99 % intervals; held: the points bound it but do not determine it"
    return ViewTable("friction", title, columns, tuple(row for d in drives for row in _parameter_rows(d)))


def _parameter_rows(d: Characteristic) -> Iterator[tuple[Any, ...]]:
    if d.fit is None:
        return
    units = _units(d.unit)
    for name, each in d.fit.parameters.items():
        value, half = each["value"], each["interval99"]
        ends = (None, None) if half is None or value is None else (value - half, value + half)
        yield d.drive, name.replace("_", " "), value, *ends, units.get(name.rpartition(".")[2], ""), d.fit.form.name


def _compared(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = (*texts("drive", "curve"), *numbers("BIC", "AICc", "scatter over noise"), *texts("taken"))
    rows = tuple(
        (d.drive, fit.form.name, fit.bic, fit.aicc, fit.scatter, "yes" if fit.form == d.fit.form else "no")
        for d in drives
        if d.fit is not None
        for fit in d.others
    )
    return ViewTable("compared", "Curves that were compared: smaller criteria are better", columns, rows)


def _break_aways(drives: tuple[Characteristic, ...]) -> tuple[ViewTable, ...]:
    columns = (*texts("drive", "direction"), *numbers("torque", "half of its interval"), UNIT, *numbers("tests"))
    rows = tuple(
        (d.drive, "forward" if mean.direction > 0 else "backward", mean.torque, mean.interval99, d.unit, mean.count)
        for d in drives
        for mean in d.means
    )
    return (ViewTable("break-away", "Break-away torques, means", columns, rows),) if rows else ()


def _points(drives: tuple[Characteristic, ...]) -> ViewTable:
    columns = (*texts("drive"), *numbers("speed", "torque", "deviation", "begins [s]", "lasts [s]", "temperature [°C]"))
    rows = tuple(
        (d.drive, p.speed, p.torque, p.deviation, p.time, p.duration, p.temperature) for d in drives for p in d.points
    )
    return ViewTable("points", "Windows of constant speed", columns, rows, folded=True)
