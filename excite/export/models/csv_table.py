"""Identified models as a table in CSV."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_feature import LISTED
from excite.export.models.model_format import ModelFormat, ModelText
from excite.export.models.parameter_table import HEAD, cells, table_rows


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
