"""Identified models as tables in LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_feature import LISTED
from excite.export.models.model_format import ModelFormat, ModelText
from excite.export.models.parameter_table import SIX_DIGITS, rounded, sections

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
                rf"\caption{{{title} of {_escaped(model.described.name)}}}\\",
            ]
            lines += [r"\hline", _row(head), r"\hline", r"\endhead"]
            lines += [*(_row([_escaped(cell) for cell in rounded(row)]) for row in rows), r"\hline", r"\end{longtable}"]
        return ModelText("\n".join([*lines, ""]), notes)


def _row(cells: Sequence[str]) -> str:
    return " & ".join(cell.replace("99 %", r"99\,\%") if cell.startswith("99 ") else cell for cell in cells) + r" \\"


def _escaped(text: str) -> str:
    return "".join(_ESCAPES.get(letter, letter) for letter in text)
