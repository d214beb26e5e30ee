"""CSV files of motions: the first line, which may have to quote names, and rows of floats that read back exactly."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from excite.storage.atomic import check_table, replacing
from regressors.samples import Array, Samples

SEGMENT = "segment"


def motion_columns(joints: Iterable[str], samples: Samples) -> tuple[list[str], Array]:
    """Header and table, shape (N, 1 + 3 n): time, then position, velocity and acceleration of each joint."""
    header, columns = ["time"], [samples.time]
    for joint, name in enumerate(joints):
        header += [f"{name}.{what}" for what in ("position", "velocity", "acceleration")]
        columns += [samples.q[:, joint], samples.dq[:, joint], samples.ddq[:, joint]]
    return header, np.column_stack(columns)


def write_motion_table(path: Path, header: Sequence[str], table: Array, segments: Sequence[str] | None = None) -> None:
    """Write a table of finite numbers, with the segment of each row in a last column where there are segments."""
    check_table(path, header, table)
    form = ",".join(["%.17g"] * len(header))
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
