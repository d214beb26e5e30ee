"""Samples of the posterior: possible robots, as values of their standard parameters, and their files.

A file is ``.npz``, with the arrays and everything else as JSON in ``facts``, or ``.csv``, a table of the samples with
every digit below a first line of JSON.
"""

from __future__ import annotations

import csv
import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from excite.storage.codec import Arrays, content_of, record_of
from excite.storage.migrations import is_of_kind, migrated, schema_of
from excite.storage.result_folder import write_file
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.input_files import LOG, opened, read_text
from regressors.quantities import check
from regressors.samples import Array

KIND = "posterior"
NPZ, CSV = ".npz", ".csv"
_NAMES = ("names", "units", "base_names", "base_units")  # arrays of their own too, for programs that read the file
LEVEL = 0.99
_TAIL = 5  # samples beyond each end of a range, below which it is not stated


@dataclass(frozen=True)
class ParameterRange:
    """What the samples say of one parameter."""

    name: str
    unit: str
    low: float  # this and `high` are quantiles that enclose the level between them
    high: float
    mean: float
    deviation: float


@dataclass(frozen=True, eq=False, repr=False)
class PosteriorSamples:
    """Possible robots that data and description allow.

    Parameters
    ----------
    robot : str
        Name of the robot.
    result_sha256 : str or None
        Hash of the ``result.json``; None for a result that was not saved.
    seed : int
    prior : float
        Relative uncertainty of the description.
    names, units : tuple of str, length t
        Of the standard parameters of the moving bodies and drives.
    values : ndarray, shape (N, t)
        In SI.
    base_names, base_units : tuple of str, length b
    base_matrix : ndarray, shape (b, t)
        ``beta = base_matrix @ theta``.
    distance : float
        Of the nearest possible robot from the estimate, in deviations of the posterior.
    effective : float
        Independent samples that say as much of the least known mean.
    split_deviation : float
        Largest potential scale reduction R of the parameters; 1 for chains that agree.
    notes : tuple of str
    """

    robot: str
    result_sha256: str | None
    seed: int
    prior: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    base_names: tuple[str, ...]
    base_units: tuple[str, ...]
    base_matrix: Array
    distance: float
    effective: float
    split_deviation: float
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that the arrays fit the names."""
        shape = (len(self.base_names), len(self.names))
        if self.values.ndim != 2 or self.values.shape[1] != shape[1] or self.base_matrix.shape != shape:
            raise InputError("arrays of other sizes")

    def __len__(self) -> int:
        """Number N of samples."""
        return len(self.values)

    @property
    def base_values(self) -> Array:
        """Base parameters of every sample, shape (N, b)."""
        return np.asarray(self.values @ self.base_matrix.T)

    @property
    def mean(self) -> Array:
        """Mean of the standard parameters, itself a possible robot, shape (t,)."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def covariance(self) -> Array:
        """Covariance of the standard parameters, shape (t, t)."""
        return np.cov(self.values, rowvar=False)

    def standard(self, number: int) -> dict[str, float]:
        """Standard parameters of one sample by name.

        Parameters
        ----------
        number : int
            0 for the first.
        """
        return dict(zip(self.names, self.values[number].tolist(), strict=True))

    def ranges(self, level: float = LEVEL) -> tuple[ParameterRange, ...]:
        """Range, mean and deviation of each standard parameter, then of each base parameter that is not one of them.

        Parameters
        ----------
        level : float
            Share of the samples between low and high, such as 0.99; as many are below as above.

        Raises
        ------
        InputError
            A level that is not between 0 and 1, or too few samples for it.
        """
        check("level", level)
        needed = int(np.ceil(2 * _TAIL / (1 - level) - 1e-9))
        if len(self) < needed:
            raise InputError(f"level: a range of {100 * level:g} % needs at least {needed} samples, given {len(self)}")
        new = [k for k, name in enumerate(self.base_names) if name not in self.names]
        values = np.hstack([self.values, self.base_values[:, new]])
        names = (*self.names, *(self.base_names[k] for k in new))
        units = (*self.units, *(self.base_units[k] for k in new))
        low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2], axis=0)
        rows = zip(names, units, low, high, values.mean(axis=0), values.std(axis=0, ddof=1), strict=True)
        return tuple(ParameterRange(name, unit, *map(float, numbers)) for name, unit, *numbers in rows)

    def save(self, path: str | Path, *, replace: bool = False) -> Path:
        """Write the samples to a file that `excite.load` reads: ``.npz``, or ``.csv`` with every digit.

        Parameters
        ----------
        path : path
        replace : bool
            Replace a file that is already there.

        Raises
        ------
        InputError
            Another suffix, or a file that is there already or cannot be written.
        """
        path = Path(path)
        write_file(path, self.file_content(_suffix(path)), replace=replace)
        return path

    def file_content(self, suffix: str) -> bytes:
        """Content of a file with this suffix, the same for the same samples."""
        content, arrays = content_of(self)
        facts = {"schema": schema_of(KIND), **content}
        if suffix == NPZ:
            names = {name: content[name] for name in _NAMES}
            np.savez(file := io.BytesIO(), allow_pickle=False, facts=json.dumps(facts), **names, **arrays)
            return file.getvalue()
        del facts["values"]
        facts["base_matrix"] = self.base_matrix.tolist()
        stream = io.StringIO()
        stream.write(f"# {json.dumps(facts)}\n")
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(self.names)
        writer.writerows([repr(value) for value in row] for row in self.values.tolist())
        return stream.getvalue().encode("utf-8")

    def __repr__(self) -> str:
        """One line."""
        return (
            f"<PosteriorSamples of {self.robot}: {len(self)} possible robots of {len(self.names)} parameters, about "
            f"{self.effective:.0f} of them independent>"
        )


@checked
def load_posterior(path: str | Path) -> PosteriorSamples:
    """Read samples that `PosteriorSamples.save` or `export_ensemble` has written, ``.npz`` or ``.csv``."""
    path = Path(path)
    read = _from_arrays if _suffix(path) == NPZ else _from_table
    what = f"{str(path)!r} holds no samples of a posterior ({schema_of(KIND)})"
    try:
        facts, arrays = read(path)
        if not is_of_kind(KIND, facts["schema"]):
            raise InputError("another schema")
        return record_of(PosteriorSamples, *migrated(KIND, facts, arrays, path.parent))
    except OSError as error:
        raise InputError(f"cannot read {str(path)!r}: {error.strerror or error}") from error
    except (AttributeError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{what}: {error}") from error


def _from_arrays(path: Path) -> tuple[dict[str, Any], Arrays]:
    with opened(path, LOG) as stream, np.load(stream, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    return dict(json.loads(str(arrays.pop("facts")))), arrays


def _from_table(path: Path) -> tuple[dict[str, Any], Arrays]:
    head, *rows = read_text(path).splitlines()
    if not head.startswith("# {"):
        raise ValueError("no facts in its first line")
    table = list(csv.reader(rows))
    facts = dict(json.loads(head[2:]))
    if not table or table[0] != facts["names"]:
        raise ValueError("columns of other names")
    values = np.array([[float(value) for value in row] for row in table[1:]]).reshape(-1, len(table[0]))
    arrays = {"values": values, "base_matrix": np.array(facts["base_matrix"], dtype=float)}
    return {**facts, **{name: {"array": name} for name in arrays}}, arrays


def _suffix(path: Path) -> str:
    if path.suffix.lower() not in (NPZ, CSV):
        raise InputError(f"samples are written to and read from {NPZ} or {CSV}, given {str(path)!r}")
    return path.suffix.lower()
