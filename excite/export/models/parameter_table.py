"""Tables of an identified model: CSV, LaTeX, Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from pathlib import Path

from excite.export.models.identified_model import LISTED, TABLE, TEMPERATURE, IdentifiedModel
from excite.export.models.model_format import ModelFormat, ModelText
from regressors.models.reduction import inertial_columns
from regressors.robot.columns import COULOMB, ROTOR, VISCOUS, drive_column

HEAD = ("part", "owner", "name", "expression", "value", "standard deviation", "99 % low", "99 % high", "unit")
Row = tuple[str | float | None, ...]  # one parameter, in the order of the head; None where there is no number
_UNKNOWN = (None, None, None)  # deviation and interval
SIX_DIGITS = "numbers are rounded to six digits; the CSV table holds every digit"
# tables for readers: title, part, and columns
_TABLES = (
    ("Base parameters", "base parameter", (2, 3, 4, 5, 6, 7, 8)),
    ("Bodies, about the origin of each link's frame", "body", (1, 2, 4, 8)),
    ("Drives", "drive", (1, 2, 4, 8)),
)


def table_rows(model: IdentifiedModel) -> Iterator[Row]:
    """All rows of a model."""
    for p in model.parameters:
        interval = p.interval if p.interval is not None else (None, None)
        yield ("base parameter", "", p.name, p.expression, p.value, p.deviation, *interval, p.unit)
    columns = iter(inertial_columns(model.robot))
    for body in model.robot.bodies:
        for k in range(10):
            column = next(columns)
            if body.theta is not None:
                yield ("body", body.name, column.name, "", float(body.theta[k]), *_UNKNOWN, column.unit)
    for drive in model.drives:
        linear = any(joint.kind == "prismatic" and c for joint, c in zip(model.robot.joints, drive.row, strict=True))
        known = {ROTOR: drive.rotor_inertia, COULOMB: drive.coulomb, VISCOUS: drive.viscous, **drive.beyond}
        for kind, value in known.items():
            if value is not None and kind not in (TEMPERATURE, TABLE):
                column = drive_column(drive.number, kind, linear=linear)
                yield ("drive", drive.name, column.name, "", value, *_UNKNOWN, column.unit)


def _text(value: str | float | None, form: str = "") -> str:
    """A cell: a number with every digit, or in a format; empty where there is none."""
    if value is None or isinstance(value, str):
        return value or ""
    return format(value, form) if form else repr(float(value))


def sections(model: IdentifiedModel) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Titles, heads and rows of the tables for readers, numbers with six digits; none is empty."""
    rows = list(table_rows(model))
    for title, part, places in _TABLES:
        if cells := [[_text(row[k], ".6g") for k in places] for row in rows if row[0] == part]:
            yield title, ["parameter" if HEAD[k] == "name" else HEAD[k] for k in places], cells


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
        writer.writerows(map(_text, row) for row in table_rows(model))
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
            lines += [rf"\begin{{longtable}}{{{'l' * len(head)}}}"]
            lines += [rf"\caption{{{title} of {_latex_escaped(model.described.name)}}}\\"]
            lines += [r"\hline", _latex_row(head), r"\hline", r"\endhead"]
            lines += [*(_latex_row(map(_latex_escaped, row)) for row in rows), r"\hline", r"\end{longtable}"]
        return ModelText("\n".join([*lines, ""]), notes)


def _latex_row(cells: Iterable[str]) -> str:
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
            lines += [*(_markdown_row(map(_markdown_escaped, row)) for row in rows), ""]
        return ModelText("\n".join(lines), (SIX_DIGITS,))


def _markdown_row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _markdown_escaped(text: str) -> str:
    for letter in "\\`*_[]<>|":
        text = text.replace(letter, f"\\{letter}")
    return text
