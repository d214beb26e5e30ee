"""Motions read from files in the format of ``trajectory.csv``."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from excite.simulation.reference import SampledMotion
from regressors.errors import InputError, UnknownName
from regressors.samples import Array, Samples

_RATES = ("position", "velocity", "acceleration")
_STILL = 1e-9  # rad or m


def read_motion(path: Path, joints: Sequence[str]) -> SampledMotion:
    """Read a motion from a file, with quintics between its samples.

    Parameters
    ----------
    path : Path
        Header ``time``, then ``NAME.position``, ``NAME.velocity``, ``NAME.acceleration`` of every joint [SI]; other
        columns are ignored.
    joints : sequence of str
        Joints that move; the others must rest in the file.

    Raises
    ------
    InputError
        Cannot be read, a cell that is not a finite number (with its line), times that do not increase, or a joint that
        moves and should rest.
    UnknownName
        A column that is not there.
    """
    header, table, _ = read_table(path, _RATES)
    column = {name: table[:, k] for k, name in enumerate(header)}
    for name in ("time", *(f"{joint}.{rate}" for joint in joints for rate in _RATES)):
        if name not in column:
            raise UnknownName(f"column in {path}", name, header)
    for name, values in column.items():
        joint, _, what = name.rpartition(".")
        if what == "position" and joint not in joints and values.size and np.ptp(values) > _STILL:
            raise InputError(
                f"{path}: {joint} moves, but the design holds it still and moves {', '.join(joints)}; "
                "`approach_and_return=False` leaves out the approach from home and the return"
            )
    q, dq, ddq = (np.column_stack([column[f"{joint}.{rate}"] for joint in joints]) for rate in _RATES)
    try:
        return SampledMotion(Samples(column["time"], q, dq, ddq, np.full_like(q, np.nan)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_table(path: Path, rates: Sequence[str], text: str | None = None) -> tuple[list[str], Array, list[str]]:
    """Read the columns ``time`` and ``NAME.RATE`` of a file, and the cells of one text column.

    Parameters
    ----------
    path : Path
    rates : sequence of str
        Suffixes of column names after the last dot, such as ``position``.
    text : str, optional
        Name of the text column.

    Returns
    -------
    header : list of str
    table : ndarray, shape (N, len(header))
    cells : list of str
        Empty where there is no such column.

    Raises
    ------
    InputError
        See `read_motion`.
    """
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            header, *rows = list(csv.reader(stream)) or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from error
    chosen = [k for k, name in enumerate(header) if name == "time" or name.rpartition(".")[2] in rates]
    table = np.empty((len(rows), len(chosen)))
    for line, row in enumerate(rows, 2):
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: {len(row)} cells under {len(header)} names")
        try:
            table[line - 2] = [float(row[k]) for k in chosen]
        except ValueError as error:
            raise InputError(f"{path}, line {line}: {error}") from error
        if not np.all(np.isfinite(table[line - 2])):
            raise InputError(f"{path}, line {line}: a value is not finite")
    cells = [row[header.index(text)] for row in rows] if text in header else []
    return [header[k] for k in chosen], table, cells
