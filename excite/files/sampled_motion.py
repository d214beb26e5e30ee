"""Motions sampled in files, ours or others'."""

from __future__ import annotations

import csv
import io
import math
import sys
from array import array
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from excite.design.design import Design
from excite.logs.csv_motion import motion_columns, write_motion_table
from excite.simulation.reference import SampledMotion
from regressors.errors import InputError, UnknownName
from regressors.input_files import LOG, opened
from regressors.quoting import shortened
from regressors.samples import Array, Samples

RATES = ("position", "velocity", "acceleration")
_STILL = 1e-9  # rad or m


def read_motion(path: Path, joints: Sequence[str]) -> SampledMotion:
    """Read a motion from a file, with quintics between its samples."""
    header, table, _ = read_table(path, RATES)
    column = {name: table[:, k] for k, name in enumerate(header)}
    for name in ("time", *(f"{joint}.{rate}" for joint in joints for rate in RATES)):
        if name not in column:
            raise UnknownName(f"column in {path}", name, header)
    for name, values in column.items():
        joint, _, what = name.rpartition(".")
        if what == "position" and joint not in joints and values.size and np.ptp(values) > _STILL:
            raise InputError(
                f"{path}: {joint} moves, but the design holds it still and moves {', '.join(joints)}; "
                "`approach_and_return=False` leaves out the approach from home and the return"
            )
    q, dq, ddq = (np.column_stack([column[f"{joint}.{rate}"] for joint in joints]) for rate in RATES)
    try:
        return SampledMotion(Samples(column["time"], q, dq, ddq, np.full_like(q, np.nan)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_table(path: Path, rates: Sequence[str], text: str | None = None) -> tuple[list[str], Array, list[str]]:
    """Read the columns ``time`` and ``NAME.RATE`` of a file, and the cells of one text column."""
    # result (N, len(header)
    try:
        with opened(path, LOG) as stream:
            rows = csv.reader(io.TextIOWrapper(stream, encoding="utf-8", newline=""))
            header = next(rows, [])
            return _columns(path, header, rows, rates, text)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from error


def _columns(
    path: Path, header: list[str], rows: Iterable[list[str]], rates: Sequence[str], text: str | None
) -> tuple[list[str], Array, list[str]]:
    """Chosen columns of the rows, each row read and forgotten."""
    chosen = [k for k, name in enumerate(header) if name == "time" or name.rpartition(".")[2] in rates]
    of_text = header.index(text) if text in header else None
    values, cells = array("d"), list[str]()
    for line, row in enumerate(rows, 2):
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: {len(row)} cells under {len(header)} names")
        numbers = [_number(row[k], path, line) for k in chosen]
        values.extend(numbers)
        if of_text is not None:
            cells.append(sys.intern(row[of_text]))
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


def trajectory_columns(design: Design, speed: float = 1.0) -> tuple[list[str], Array]:
    """Header and table: ``time``, then position, velocity, acceleration of each joint.

    Locked joints are included, at their resting position; velocity and acceleration at both ends are exact zeros.
    """
    return motion_columns(design.robot.joint_names, design.sequence.sampled(speed)[0])


def write_trajectory(design: Design, path: Path, speed: float = 1.0) -> None:
    """Write the motion of a design; with approach and return, a last column ``segment`` is added."""
    samples, segments = design.sequence.sampled(speed)
    header, table = motion_columns(design.robot.joint_names, samples)
    write_motion_table(path, header, table, None if design.approach_and_return is None else segments)
