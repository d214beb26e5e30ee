"""Tables of sampled motions."""

from __future__ import annotations

import csv
import io
import math
import sys
from array import array
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from excite.storage.atomic import check_table, replacing
from regressors.errors import InputError, shortened
from regressors.input_files import LOG, opened
from regressors.samples import Array, Samples


def read_table(path: Path, rates: Sequence[str], text: str | None = None) -> tuple[list[str], Array, list[str]]:
    """Read the columns ``time`` and ``NAME.RATE`` of a file, and the cells of one text column."""
    # result (N, len(header)
    try:
        with opened(path, LOG) as stream:
            rows = csv.reader(io.TextIOWrapper(stream, encoding="utf-8", newline=""))
            header = next(rows, [])
            chosen = [k for k, name in enumerate(header) if name == "time" or name.rpartition(".")[2] in rates]
            of_text = header.index(text) if text in header else None
            values, cells = array("d"), list[str]()
            for line, row in enumerate(rows, 2):  # each row is read and forgotten
                if len(row) != len(header):
                    raise InputError(f"{path}, line {line}: {len(row)} cells under {len(header)} names")
                values.extend([_number(row[k], path, line) for k in chosen])
                if of_text is not None:
                    cells.append(sys.intern(row[of_text]))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from error
    table = np.frombuffer(values, float) if values else np.zeros(0)
    return [header[k] for k in chosen], table.reshape(-1, len(chosen)) if chosen else np.zeros((0, 0)), cells


def _number(cell: str, path: Path, line: int) -> float:
    try:
        number = float(cell)
    except ValueError:
        raise InputError(f"{path}, line {line}: {shortened(cell)} is not a number") from None
    if not math.isfinite(number):
        raise InputError(f"{path}, line {line}: a value is not finite")
    return number


SEGMENT = "segment"


def motion_columns(joints: Iterable[str], samples: Samples) -> tuple[list[str], Array]:
    """Header and table, shape (N, 1 + 3 n): time, then position, velocity and acceleration of each joint."""
    header = ["time", *(f"{name}.{what}" for name in joints for what in ("position", "velocity", "acceleration"))]
    motion = np.stack([samples.q, samples.dq, samples.ddq], axis=2).reshape(samples.time.size, -1)
    return header, np.column_stack([samples.time, motion])


def write_motion_table(path: Path, header: Sequence[str], table: Array, segments: Sequence[str] | None = None) -> None:
    """Write a table of finite numbers, with the segment of each row in a last column where there are segments."""
    check_table(path, header, table)
    form = ",".join(["%.17g"] * len(header))
    table = table + 0.0  # without the sign of a zero
    with replacing(path) as stream:
        if segments is None:
            np.savetxt(stream, table, fmt=form, header=header_text(header), comments="")
            return
        stream.write(header_text([*header, SEGMENT]) + "\n")
        stream.writelines(f"{form % tuple(row)},{segment}\n" for row, segment in zip(table, segments, strict=True))


def header_text(names: Iterable[str]) -> str:
    """The first line, without its end: a name that holds a comma or quotation marks is quoted."""
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow(names)
    return line.getvalue()


def header_names(line: str) -> list[str]:
    """Names in the first line, without white space around them."""
    try:
        return [name.strip() for name in next(csv.reader([line], skipinitialspace=True)) or [""]]
    except csv.Error:  # a name of more than 131072 characters
        return [name.strip() for name in line.split(",")]
