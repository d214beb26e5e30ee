"""The section of a fit of friction curves."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, cast

import numpy as np

from excite.files.friction_file import read_friction
from excite.files.friction_fit_file import FIT, FRICTION, KIND, SCHEMA, fit_content
from excite.files.stored import complete, stored_content
from excite.friction.fit.breakaway_torque import BreakAway
from excite.friction.fit.characteristic import Characteristic
from excite.friction.fit.curve_fit import CurveFit
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.friction_equations import Form
from excite.friction.fit.friction_fit import FrictionFit
from excite.friction.fit.points import Point
from excite.report.drawings import drawn
from excite.report.provenance_facts import facts
from excite.report.sections import ReportCell, ReportSection, ReportTable, number, text_of, unit
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from regressors.friction.curves import FrictionCurve

_EXPONENT = re.compile(r"exponent ([\d.]+)")
_NORMAL = 2.5758  # half a 99 % interval over the standard deviation, where the file does not tell


@dataclass(frozen=True)
class StoredFrictionFit:
    """A fit of friction curves read from its folder.

    Parameters
    ----------
    folder : Path
    content : mapping
        Of ``fit.json``.
    characteristics : tuple of Characteristic
    """

    folder: Path
    content: Mapping[str, Any]
    characteristics: tuple[Characteristic, ...]


def load_friction_fit(folder: Path) -> StoredFrictionFit:
    """Load the fit in a folder.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    InputError
        Another schema, entries that are missing, or files that are not those that were written.
    """
    return read_settled(Destination(folder), lambda: _loaded(folder))


def _loaded(folder: Path) -> StoredFrictionFit:
    content = stored_content(folder / FIT, SCHEMA)
    check_files(folder, KIND, (FIT, FRICTION))
    known = read_friction(folder / FRICTION).curves
    with complete(folder / FIT, "fit of friction curves"):
        for name in ("logs", "settings", "subtracted", "provenance"):
            content[name]
        drives = tuple(_characteristic(each, cast(FrictionCurve, known[each["name"]])) for each in content["drives"])
        if not drives:
            raise ValueError("no drive")
    return StoredFrictionFit(folder, content, drives)


def _characteristic(content: Mapping[str, Any], curve: FrictionCurve) -> Characteristic:
    fit = content["fit"]
    return Characteristic(
        drive=str(content["name"]),
        unit=str(content["unit"]),
        gravity=str(content["gravity"]),
        points=tuple(Point(**each) for each in content["points"]),
        rests=tuple(Point(**each) for each in content["points_at_rest"]),
        curve=curve,
        fit=None if fit is None else _fit(fit),
        others=(),
        failed=dict(content["not_fitted"]),
        stiction=tuple(BreakAway(**each) for each in content["stiction"]),
        notes=tuple(map(str, content["notes"])),
    )


def _fit(content: Mapping[str, Any]) -> CurveFit:
    parameters, name = content["parameters"], str(content["model"])
    covariance = np.array(content["covariance"], dtype=float)
    halves = np.array(
        [np.nan if p["interval99"] is None else p["interval99"] for p in parameters.values()], dtype=float
    )
    deviations = np.sqrt(np.diag(covariance))
    ratio = halves[deviations > 0] / deviations[deviations > 0]
    exponent = _EXPONENT.search(name)
    form = Form(
        name,
        stribeck="stribeck" in name,
        asymmetric=name.startswith("asymmetric"),
        exponent=1.0 if exponent is None else float(exponent[1]),
        offset="offset" in parameters,
        temperature=content["reference_temperature"],
        load="load" in name.partition(", ")[2],
    )
    if set(form.parameters) != set(parameters) or covariance.shape != (len(parameters),) * 2:
        raise ValueError(f"expected the parameters {', '.join(form.parameters)} of {name}")
    return CurveFit(
        form=form,
        values=np.array([float(parameters[each]["value"]) for each in form.parameters]),
        covariance=covariance,
        scatter=float(content["scatter"]),
        quantile=float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else _NORMAL,
        bic=float(content["bic"]),
        aicc=np.inf if content["aicc"] is None else float(content["aicc"]),
        held=tuple(each for each, value in parameters.items() if value["interval99"] is None),
    )


def friction_fit_section(given: StoredFrictionFit | FrictionFit, prefix: str) -> ReportSection:
    """Everything that a page says of a fit of friction curves.

    Parameters
    ----------
    given : StoredFrictionFit or FrictionFit
    prefix : str
        Begins the identifiers of its figures.
    """
    folder = str(given.folder) if isinstance(given, StoredFrictionFit) else "friction/this"
    content = given.content if isinstance(given, StoredFrictionFit) else fit_content(given)
    robot, drives = content["robot"], content["drives"]

    def figure() -> Any:
        from excite.plots.friction_plot import friction_figure

        return friction_figure(str(robot["name"]), given.characteristics)

    figures, missing = drawn({"Friction over speed": figure}, prefix)
    gravity = {"model": "subtracted by a model", "symmetric": "cancelled by both directions", "none": "none"}
    left_out = tuple(f"{log['file']}: {each}" for log in content["logs"] for each in log["left_out"])
    return ReportSection(
        kind="friction",
        title=str(given.folder) if isinstance(given, StoredFrictionFit) else f"friction of {robot['name']}",
        verdict=_verdict(drives),
        asked=(("robot", str(robot["name"])), *_settings(content["settings"])),
        assumed=(
            *(f"{each['name']}: gravity is {gravity.get(each['gravity'], each['gravity'])}" for each in drives),
            *(f"{each['name']}: {note}" for each in drives for note in each["notes"]), *left_out,
        ),
        notes=(*_failed(drives), *missing),
        tables=(_parameters(drives), _compared(drives), *_break_aways(drives), _points(drives)),
        figures=figures,
        facts=facts(content["provenance"], robot=robot["name"], robot_sha256=robot["sha256"], **_hashes(content)),
        commands=_commands(content, folder),
    )  # fmt: skip


def _verdict(drives: Sequence[Mapping[str, Any]]) -> str:
    fitted = [each for each in drives if each["fit"] is not None]
    tables = [each["name"] for each in drives if each["fit"] is None]
    words = [f"{each['name']} by {each['fit']['model']}" for each in fitted]
    words += [f"{name} by a table of its points" for name in tables]
    held = [
        f"{each['name']} {name}"
        for each in fitted
        for name, p in each["fit"]["parameters"].items()
        if p["interval99"] is None
    ]
    not_known = f" The points bound, but do not determine: {', '.join(held)}." if held else ""
    wide = [each["name"] for each in fitted if each["fit"]["scatter"] > 2.0]
    scatter = f" Points of {', '.join(wide)} scatter more than their noise explains." if wide else ""
    count = f"{len(drives)} drive{'s' * (len(drives) != 1)}"
    return f"Friction of {count} is described: {'; '.join(words)}.{not_known}{scatter}"


def _failed(drives: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    return tuple(
        f"{each['name']}: {form} is not fitted: {why}" for each in drives for form, why in each["not_fitted"].items()
    )


def _settings(settings: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    default = FitSettings()
    known = {field.name: getattr(default, field.name) for field in fields(default)}
    return tuple(
        (name.replace("_", " "), text_of(value))
        for name, value in settings.items()
        if value is not None and value != known.get(name)
    )


def _parameters(drives: Sequence[Mapping[str, Any]]) -> ReportTable:
    rows = tuple(
        (
            ReportCell(each["name"]), ReportCell(name.replace("_", " ")), number(p["value"]),
            *(number(None if p["interval99"] is None else p["value"] + sign * p["interval99"]) for sign in (-1, 1)),
            ReportCell(each["fit"]["model"]),
        )
        for each in drives if each["fit"] is not None for name, p in each["fit"]["parameters"].items()
    )  # fmt: skip
    return ReportTable(
        "Parameters of the curves with their 99 % intervals",
        ("drive", "parameter", "value", "lower", "upper", "curve"),
        rows,
        "SI units of the drive. A dash: held fixed, since the points bound it but do not determine it.",
        "friction",
    )


def _compared(drives: Sequence[Mapping[str, Any]]) -> ReportTable:
    rows = tuple(
        (
            ReportCell(each["name"]), ReportCell(fit["model"]), number(fit["bic"]), number(fit["aicc"]),
            number(fit["scatter"]), ReportCell("yes" if fit["model"] == (each["fit"] or {}).get("model") else "no"),
        )
        for each in drives for fit in each["compared"]
    )  # fmt: skip
    columns = ("drive", "curve", "BIC", "AICc", "scatter over noise", "taken")
    return ReportTable("Curves that were compared", columns, rows, "Smaller criteria are better.", "compared")


def _break_aways(drives: Sequence[Mapping[str, Any]]) -> tuple[ReportTable, ...]:
    rows = tuple(
        (
            ReportCell(each["name"]), ReportCell("forward" if mean["direction"] > 0 else "backward"),
            number(mean["torque"]), number(mean["interval99"]), unit(each["unit"]), number(mean["count"]),
        )
        for each in drives for mean in each["break_away"]
    )  # fmt: skip
    columns = ("drive", "direction", "torque", "half of its interval", "unit", "tests")
    return (ReportTable("Break-away torques, means", columns, rows, name="break-away"),) if rows else ()


def _points(drives: Sequence[Mapping[str, Any]]) -> ReportTable:
    rows = tuple(
        (
            ReportCell(each["name"]),
            *(number(p[name]) for name in ("speed", "torque", "deviation", "time", "duration", "temperature")),
        )
        for each in drives for p in each["points"]
    )  # fmt: skip
    columns = ("drive", "speed", "torque", "deviation", "begins [s]", "lasts [s]", "temperature [°C]")
    return ReportTable("Windows of constant speed", columns, rows, name="points", folded=True)


def _hashes(content: Mapping[str, Any]) -> dict[str, Any]:
    return {f"log {log['file']} sha256": log["sha256"] for log in content["logs"]}


def _commands(content: Mapping[str, Any], folder: str) -> tuple[str, ...]:
    robot, logs = str(content["robot"]["name"]), [str(log["file"]) for log in content["logs"]]
    return (
        shlex.join(["excite", "friction", "fit", robot, *logs, "--out", f"{folder}-again"]),
        shlex.join(
            [
                "excite",
                "identify",
                robot,
                "LOG.csv",
                "--friction-curves",
                f"{folder}/friction.yaml",
                "--out",
                "results/this",
            ]
        ),
    )
