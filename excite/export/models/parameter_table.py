"""Tables of an identified model: CSV, LaTeX, Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_drives import ModelDrive
from excite.export.models.model_feature import LISTED
from excite.export.models.model_format import ModelFormat, ModelText
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


class CsvTable(ModelFormat):
    """Comma-separated values [RFC 4180] below comment lines that begin with ``#``."""

    name = "CSV"
    suffix = ".csv"
    expresses = LISTED

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        stream = io.StringIO()
        stream.writelines(f"# {line}\n" for line in comment)
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(HEAD)
        writer.writerows(cells(row) for row in table_rows(model))
        return ModelText(stream.getvalue())


_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    **{letter: f"\\{letter}" for letter in "#$%&_"},
}


class LatexTable(ModelFormat):
    r"""Tables of LaTeX to ``\input``, by the package longtable, numbers with six digits."""

    name = "LaTeX"
    suffix = ".tex"
    expresses = LISTED

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        notes = (SIX_DIGITS, r"the LaTeX tables need \usepackage{longtable}")
        lines = [f"% {line}" for line in (*comment, *notes)]
        for title, head, rows in sections(model):
            lines += [
                rf"\begin{{longtable}}{{{'l' * len(head)}}}",
                rf"\caption{{{title} of {_latex_escaped(model.described.name)}}}\\",
            ]
            lines += [r"\hline", _latex_row(head), r"\hline", r"\endhead"]
            lines += [
                *(_latex_row([_latex_escaped(cell) for cell in rounded(row)]) for row in rows),
                r"\hline",
                r"\end{longtable}",
            ]
        return ModelText("\n".join([*lines, ""]), notes)


def _latex_row(cells: Sequence[str]) -> str:
    return " & ".join(cell.replace("99 %", r"99\,\%") if cell.startswith("99 ") else cell for cell in cells) + r" \\"


def _latex_escaped(text: str) -> str:
    return "".join(_ESCAPES.get(letter, letter) for letter in text)


class MarkdownTable(ModelFormat):
    """Tables of GitHub Flavored Markdown, numbers with six digits."""

    name = "Markdown"
    suffix = ".md"
    expresses = LISTED

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        lines = [f"# Identified parameters of {_markdown_escaped(model.described.name)}", ""]
        lines += [*(f"- {_markdown_escaped(line)}" for line in (*comment, SIX_DIGITS)), ""]
        for title, head, rows in sections(model):
            lines += [f"## {title}", "", _markdown_row(head), _markdown_row(["---"] * len(head))]
            lines += [*(_markdown_row([_markdown_escaped(cell) for cell in rounded(row)]) for row in rows), ""]
        return ModelText("\n".join(lines), (SIX_DIGITS,))


def _markdown_row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _markdown_escaped(text: str) -> str:
    for letter in "\\`*_[]<>|":
        text = text.replace(letter, f"\\{letter}")
    return text
