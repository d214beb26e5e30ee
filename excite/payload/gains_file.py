"""``gains.yaml``: factors of drive gains with their deviations, schema ``excite.gains/1``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from excite.payload.known_gains import KnownGains
from excite.storage.atomic import replacing
from excite.storage.result_file import replace_files, result_file, settle_files
from regressors.errors import InputError, TakenError
from regressors.input_files import read_text
from regressors.readers.documents import parse_document, validate

SCHEMA = "excite.gains/1"
_HEAD = (
    "# Measured torques, or currents times the stated gains, are to be multiplied by `factor`; `deviation` is its",
    "# standard deviation. `correlation` is that between the factors, in the order of the drives.",
)
_LARGEST = 1e6


class _Drive(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    factor: float
    deviation: float


class _Gains(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    form: str = Field(alias="schema")
    robot: str = ""
    known_mass: float | None = None
    drives: dict[str, _Drive]
    correlation: list[list[float]] | None = None
    logs: list[str] = []


@contextmanager
def save_gains(path: Path, *, replace: bool = False) -> Iterator[Callable[..., None]]:
    """Be the only writer of a file of gains, and get what writes it, whole or not at all."""
    with result_file(path):
        if path.exists() and not replace:
            raise TakenError(f"{path} already exists")

        def write(gains: KnownGains, **more: Any) -> None:
            with replace_files(path) as staged:
                write_gains(gains, staged / path.name, **more)

        yield write


def write_gains(gains: KnownGains, path: Path, *, robot: str, mass: float) -> None:
    """Write a file of gains."""
    deviation = gains.deviation
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.nan_to_num(gains.covariance / np.outer(deviation, deviation))
    np.fill_diagonal(correlation, 1.0)
    lines = [*_HEAD, f"schema: {SCHEMA}", f"robot: {json.dumps(robot)}", f"known_mass: {mass!r}", "drives:"]
    for name, factor, own in zip(gains.drives, gains.factor.tolist(), deviation.tolist(), strict=True):
        lines.append(f"  {json.dumps(name)}: {{factor: {factor!r}, deviation: {own!r}}}")
    lines.append("correlation:")
    lines += [f"  - {json.dumps([round(x, 12) for x in row])}" for row in correlation.tolist()]
    lines.append(f"logs: {json.dumps(list(gains.logs))}")
    with replacing(path) as stream:
        stream.write("\n".join(lines) + "\n")


def read_gains(path: Path) -> KnownGains:
    """Read a file of gains."""
    settle_files(path)
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read gains {path}: {getattr(error, 'strerror', None) or error}") from error
    document = parse_document(text, str(path))
    content: Any = validate(document, _Gains)
    if content.form != SCHEMA:
        raise InputError(f"{path}: expected schema {SCHEMA}, given {str(content.form)[:40]}")
    drives = tuple(content.drives)
    factor = np.array([drive.factor for drive in content.drives.values()])
    deviation = np.array([drive.deviation for drive in content.drives.values()])
    k = len(drives)
    correlation = np.eye(k) if content.correlation is None else np.array(content.correlation, dtype=object)
    if correlation.shape != (k, k):
        raise InputError(f"{path}: the correlation of {k} drives needs {k} rows of {k} numbers")
    if k == 0 or np.any(deviation < 0) or np.any(np.abs(factor) > _LARGEST) or np.any(deviation > _LARGEST):
        raise InputError(f"{path}: factors and deviations must be positive numbers up to {_LARGEST:g}, of some drives")
    covariance = np.asarray(correlation, dtype=float) * np.outer(deviation, deviation)
    try:
        return KnownGains(drives, factor, covariance, f"drive gains as calibrated in {path}", tuple(content.logs))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
