"""Reader of Denavit-Hartenberg tables: a CSV file with one row per joint, as a `Robot`.

The first line says which convention the table follows, ``# convention: standard`` or ``# convention: modified``; lines
``# name: ...`` may follow. Then comes the header. A unit may stand behind a column's name, ``alpha [deg]``; without one
values are in SI units, angles in radians. A cell without a value is not known, or zero for ``a, alpha, d, theta``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from regressors.errors import LONGEST_NAME, InputError, about, check_names, reading, shortened
from regressors.input_files import read_text
from regressors.readers.urdf_elements import number_of
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import Array, from_centre_of_mass, inertia_tensor, transport
from regressors.robot.robot import Drive, Joint, JointKind, Limits, Link, Robot, Transmission

CONVENTIONS = ("standard", "modified")
KINDS: Mapping[str, JointKind] = {"": "revolute", "revolute": "revolute", "r": "revolute",
                                  "prismatic": "prismatic", "p": "prismatic"}  # fmt: skip
_ANGLES = {"rad": 1.0, "deg": np.pi / 180.0}
_LENGTHS = {"m": 1.0, "mm": 1e-3}
_INERTIA = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_CENTRE = ("cx", "cy", "cz")


def _rates(suffix: str) -> dict[str, float]:
    return {f"{unit}{suffix}": factor for unit, factor in {**_ANGLES, **_LENGTHS}.items()}


# columns of numbers and their units
_COLUMNS: Mapping[str, Mapping[str, float]] = {
    "alpha": _ANGLES,
    "theta": _ANGLES,
    "a": _LENGTHS,
    "d": _LENGTHS,
    "lower": {**_ANGLES, **_LENGTHS},
    "upper": {**_ANGLES, **_LENGTHS},
    "velocity": _rates("/s"),
    "acceleration": _rates("/s^2"),
    "jerk": _rates("/s^3"),
    "torque": {"Nm": 1.0, "N": 1.0},
    "mass": {"kg": 1.0},
    **dict.fromkeys(_CENTRE, _LENGTHS),
    **{column: {"kg m^2": 1.0} for column in _INERTIA},
    "ratio": {},
    "rotor_inertia": {"kg m^2": 1.0},
    "viscous": {"Nm s/rad": 1.0, "N s/m": 1.0},
    "coulomb": {"Nm": 1.0, "N": 1.0},
}
_TEXTS = ("name", "type")
_LONGEST = 10_000  # characters of a line
_DRIVE = ("ratio", "rotor_inertia", "viscous", "coulomb")


def read_dh_table(path: str | Path) -> Robot:
    """Robot of a Denavit-Hartenberg table.

    ``modified`` is ``Rx(alpha) Tx(a) Rz(theta + q) Tz(d)`` [Craig 1986], with alpha and a of the step to the joint;
    ``standard`` is ``Rz(theta + q) Tz(d) Tx(a) Rx(alpha)`` [Denavit, Hartenberg 1955], with alpha and a of the step
    behind it. A prismatic joint adds q to d. The centre of mass ``cx, cy, cz`` and the inertia about it, ``Ixx`` ...
    ``Izz``, are given in the table's own frame of the link, which for a standard table is the one behind the step.

    Columns: ``name`` (``q1``, ``q2``, ... if not given), ``type`` (``revolute`` or ``r``, ``prismatic`` or ``p``), ``a,
    alpha, d, theta``, limits ``lower, upper, velocity, acceleration, jerk, torque`` of the joint, ``mass, cx, cy, cz,
    Ixx, Ixy, Ixz, Iyy, Iyz, Izz``, and of its drive ``ratio, rotor_inertia, viscous, coulomb``.
    """
    path = Path(path)
    with reading(repr(str(path))):
        lines = read_text(path, encoding="utf-8-sig").splitlines()
    head = dict(_said(line) for line in lines if line.startswith("#"))
    convention = head.get("convention", "")
    if convention not in CONVENTIONS:
        given = f", given {convention!r}" if convention else ""
        raise InputError(
            f"{path.name}: expected a first line '# convention: standard' or '# convention: modified'{given}"
        )
    filled = [(k, line) for k, line in enumerate(lines, 1) if line.strip(" ,;\t") and not line.startswith("#")]
    rows = _rows(filled, path.name)
    with about(path.name):
        return _robot(head.get("name") or path.stem, rows, convention, path.name)


_Row = dict[str, Any]  # numbers of a joint by column, in SI units, with its texts


def _array(row: _Row, *columns: str) -> Array:
    return np.array([row.get(column, 0.0) for column in columns])


def _said(line: str) -> tuple[str, str]:
    key, _, value = line.lstrip("# ").partition(":")
    return key.strip().lower(), value.strip().strip(",;").strip()


def _rows(lines: list[tuple[int, str]], source: str) -> list[_Row]:
    if len(lines) < 2:
        raise InputError(f"{source}: expected a header and a row for every joint")
    delimiter = ";" if ";" in lines[0][1] else ","
    cells = [(number, _cells(line, delimiter, f"{source}, line {number}")) for number, line in lines]
    columns = [_column(title, f"{source}, line {cells[0][0]}") for title in cells[0][1]]
    return [_row(columns, row, k, f"{source}, line {number}") for k, (number, row) in enumerate(cells[1:], 1)]


def _cells(line: str, delimiter: str, place: str) -> list[str]:
    if len(line) > _LONGEST:
        raise InputError(
            f"{place}: a line of a table has at most {_LONGEST} characters, and a name at most {LONGEST_NAME} "
            f"characters, given {len(line)}: {shortened(line)}"
        )
    return next(csv.reader([line], delimiter=delimiter))


def _column(title: str, place: str) -> tuple[str, str]:
    """Name of a column and its unit."""
    match = re.fullmatch(r"\s*(\w+)\s*(?:\[(.*)\])?\s*", title)
    name, unit = (match[1], match[2] or "") if match else (title.strip(), "")
    check_names(f"column in {place}", [name], (*_TEXTS, *_COLUMNS))
    if unit and unit not in _COLUMNS.get(name, {}):
        raise InputError(f"{place}: {name}: no unit {unit!r}; available: {', '.join(_COLUMNS.get(name, {})) or 'none'}")
    return name, unit


def _row(columns: list[tuple[str, str]], cells: list[str], number: int, place: str) -> _Row:
    if len(cells) != len(columns):
        raise InputError(f"{place}: expected {len(columns)} cells as in the header, given {len(cells)}")
    row, texts = _Row(), {"name": "", "type": ""}
    for (name, unit), cell in zip(columns, (cell.strip() for cell in cells), strict=True):
        if name in texts:
            texts[name] = cell
        elif cell and name in row:
            raise InputError(f"{place}: {name} is given twice")
        elif cell:
            row[name] = _number(cell, f"{place}: {name}") * _COLUMNS[name].get(unit, 1.0)
    if texts["type"].lower() not in KINDS:
        raise InputError(f"{place}: type: expected revolute or prismatic, given {texts['type']!r}")
    kind = KINDS[texts["type"].lower()]
    _check_units(columns, cells, kind, place)
    if ("lower" in row) != ("upper" in row):
        raise InputError(f"{place}: give lower and upper, or neither")
    body = [column for column in ("mass", *_CENTRE, *_INERTIA) if column in row]
    missing = [column for column in ("mass", "Ixx", "Iyy", "Izz") if column not in row]
    if body and missing:
        raise InputError(f"{place}: give mass, centre of mass and inertia, or none; no {', '.join(missing)}")
    return {**row, "name": texts["name"] or f"q{number}", "type": kind}


def _number(cell: str, place: str) -> float:
    value = number_of(cell)
    if not np.isfinite(value):
        raise InputError(f"{place}: expected a number, given {cell!r}")
    return value


def _check_units(columns: list[tuple[str, str]], cells: list[str], kind: JointKind, place: str) -> None:
    others = _LENGTHS if kind == "revolute" else _ANGLES
    for (name, unit), cell in zip(columns, cells, strict=True):
        moving = name in ("lower", "upper", "velocity", "acceleration", "jerk")
        if moving and cell.strip() and unit.partition("/")[0] in others:
            raise InputError(f"{place}: {name} of a {kind} joint is not in {unit}")


def _robot(name: str, rows: list[_Row], convention: str, source: str) -> Robot:
    bounds = {"lower": -np.inf, **dict.fromkeys(("upper", "velocity", "acceleration", "jerk", "torque"), np.inf)}
    return Robot(
        name=name,
        joints=tuple(_joints(rows, convention)),
        links=tuple(Link(f"link{k}", _parameters(row, convention)) for k, row in enumerate(rows, 1)),
        limits=Limits(*(np.array([row.get(name, none) for row in rows]) for name, none in bounds.items())),
        transmission=_transmission(rows),
        source=f"{convention} Denavit-Hartenberg table {source}",
    )


def _joints(rows: list[_Row], convention: str) -> list[Joint]:
    """Joints in modified parameters: a standard table's alpha and a are those of the next joint."""
    steps = [_array(row, "alpha", "a") for row in rows]
    if convention == "standard":
        steps = [np.zeros(2), *steps[:-1]]
    return [
        Joint.from_mdh(
            row["name"], row["type"], alpha=float(x), a=float(a), d=row.get("d", 0.0), offset=row.get("theta", 0.0)
        )
        for row, (x, a) in zip(rows, steps, strict=True)
    ]


def _parameters(row: _Row, convention: str) -> Array | None:
    if "mass" not in row:
        return None
    tensor = inertia_tensor(_array(row, "mass", *_CENTRE, *_INERTIA))
    theta = from_centre_of_mass(row["mass"], _array(row, *_CENTRE), tensor)
    if convention == "modified":
        return theta
    step = Joint.from_mdh("step", "revolute", alpha=row.get("alpha", 0.0), a=row.get("a", 0.0))
    return transport(step.rotation, step.translation) @ theta


def _transmission(rows: list[_Row]) -> Transmission | None:
    if not any(column in row for row in rows for column in _DRIVE):
        return None
    gears = (ConstantRatio(row.get("ratio", 1.0)) for row in rows)
    drives = tuple(
        Drive(row["name"], gear, row.get("rotor_inertia"), row.get("coulomb"), row.get("viscous"))
        for row, gear in zip(rows, gears, strict=True)
    )
    return Transmission(np.eye(len(rows)), drives, Limits.none(len(rows)))
