"""First line of a CSV file: names of columns, in quotation marks where a name holds a comma or such marks itself."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable


def header_text(names: Iterable[str]) -> str:
    """The line, without its end."""
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow(names)
    return line.getvalue()


def header_names(line: str) -> list[str]:
    """Names in the line, without white space around them."""
    try:
        return [name.strip() for name in next(csv.reader([line], skipinitialspace=True)) or [""]]
    except csv.Error:  # a name of more than 131072 characters
        return [name.strip() for name in line.split(",")]
