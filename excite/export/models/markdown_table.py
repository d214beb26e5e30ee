"""Identified models as tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_feature import LISTED
from excite.export.models.model_format import ModelFormat, ModelText
from excite.export.models.parameter_table import SIX_DIGITS, rounded, sections


class MarkdownTable(ModelFormat):
    """Tables of GitHub Flavored Markdown, numbers with six digits."""

    name = "Markdown"
    suffix = ".md"
    expresses = LISTED

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        lines = [f"# Identified parameters of {_escaped(model.described.name)}", ""]
        lines += [*(f"- {_escaped(line)}" for line in (*comment, SIX_DIGITS)), ""]
        for title, head, rows in sections(model):
            lines += [f"## {title}", "", _row(head), _row(["---"] * len(head))]
            lines += [*(_row([_escaped(cell) for cell in rounded(row)]) for row in rows), ""]
        return ModelText("\n".join(lines), (SIX_DIGITS,))


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _escaped(text: str) -> str:
    for letter in "\\`*_[]<>|":
        text = text.replace(letter, f"\\{letter}")
    return text
