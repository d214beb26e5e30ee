"""Rows of the tables that list an identified model: base parameters with their uncertainty, then bodies and drives."""

from __future__ import annotations

from dataclasses import dataclass

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_drives import ModelDrive
from regressors.models.columns import COULOMB, ROTOR, VISCOUS
from regressors.models.drives import drive_column
from regressors.models.standard_columns import inertial_columns

HEAD = ("part", "owner", "name", "expression", "value", "standard deviation", "99 % low", "99 % high", "unit")


@dataclass(frozen=True)
class TableRow:
    """One parameter."""

    part: str  # ``base parameter``, ``body`` or ``drive``
    owner: str  # name of the body or the drive; empty for a base parameter
    name: str
    expression: str
    value: float
    deviation: float | None  # standard deviation and 99 % interval, of base parameters
    low: float | None
    high: float | None
    unit: str


def table_rows(model: IdentifiedModel) -> tuple[TableRow, ...]:
    """All rows of a model."""
    rows = []
    for p in model.parameters:
        low, high = p.interval if p.interval is not None else (None, None)
        rows.append(TableRow("base parameter", "", p.name, p.expression, p.value, p.deviation, low, high, p.unit))
    columns = iter(inertial_columns(model.robot))
    for body in model.robot.bodies:
        for k in range(10):
            column = next(columns)
            if body.theta is not None:
                value = float(body.theta[k])
                rows.append(TableRow("body", body.name, column.name, "", value, None, None, None, column.unit))
    return (*rows, *(row for drive in model.drives for row in _of_drive(drive, model)))


def _of_drive(drive: ModelDrive, model: IdentifiedModel) -> list[TableRow]:
    linear = any(joint.kind == "prismatic" and c for joint, c in zip(model.robot.joints, drive.row, strict=True))
    known = {ROTOR: drive.rotor_inertia, COULOMB: drive.coulomb, VISCOUS: drive.viscous, **drive.beyond}
    rows = []
    for kind, value in known.items():
        if value is not None and kind not in ("temperature", "table"):
            column = drive_column(drive.number, kind, linear=linear)
            rows.append(TableRow("drive", drive.name, column.name, "", value, None, None, None, column.unit))
    return rows


def cells(row: TableRow) -> tuple[str, ...]:
    """Texts of a row in the order of `HEAD`; numbers with every digit, empty where there is none."""
    numbers = ("" if x is None else repr(float(x)) for x in (row.value, row.deviation, row.low, row.high))
    return (row.part, row.owner, row.name, row.expression, *numbers, row.unit)


SIX_DIGITS = "numbers are rounded to six digits; the CSV table holds every digit"
_BASE_HEAD = ("parameter", "expression", "value", "standard deviation", "99 % low", "99 % high", "unit")
_STANDARD_HEAD = ("owner", "parameter", "value", "unit")


def sections(model: IdentifiedModel) -> list[tuple[str, tuple[str, ...], list[tuple[str | float | None, ...]]]]:
    """Titles, heads and rows of the tables for readers: base parameters, then bodies, then drives; none is empty."""
    rows = table_rows(model)
    base: list[tuple[str | float | None, ...]] = [
        (r.name, r.expression, r.value, r.deviation, r.low, r.high, r.unit) for r in rows if r.part == "base parameter"
    ]
    parts = {part: [(r.owner, r.name, r.value, r.unit) for r in rows if r.part == part] for part in ("body", "drive")}
    of_bodies: list[tuple[str | float | None, ...]] = [*parts["body"]]
    of_drives: list[tuple[str | float | None, ...]] = [*parts["drive"]]
    tables = [
        ("Base parameters", _BASE_HEAD, base),
        ("Bodies, about the origin of each link's frame", _STANDARD_HEAD, of_bodies),
        ("Drives", _STANDARD_HEAD, of_drives),
    ]
    return [table for table in tables if table[2]]


def rounded(row: tuple[str | float | None, ...]) -> list[str]:
    """Cells of a row for readers: numbers with six digits, empty where there is none."""
    return ["" if x is None else x if isinstance(x, str) else f"{x:.6g}" for x in row]
