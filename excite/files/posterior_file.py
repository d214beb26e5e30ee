"""Samples of a posterior as a file: arrays for NumPy, or a table in CSV with every digit."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from excite.posterior.posterior_samples import PosteriorSamples
from excite.storage.atomic import replacing
from excite.storage.result_file import result_file
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.input_files import LOG, opened, read_text

SCHEMA = "excite.posterior/1"
NPZ, CSV = ".npz", ".csv"
_FACTS = ("robot", "result_sha256", "seed", "prior", "distance", "effective", "split_deviation", "notes")
_LISTS = ("names", "units", "base_names", "base_units")
_OLDEST = (1980, 1, 1, 0, 0, 0)  # of every member, so that the same samples give the same bytes


def save_posterior(samples: PosteriorSamples, path: str | Path, *, replace: bool = False) -> Path:
    """Write samples to a file."""
    path = Path(path)
    content = posterior_content(samples, _suffix(path))
    with result_file(path):
        if path.exists() and not replace:
            raise InputError(f"{str(path)!r} is there already; `replace` replaces it, or choose another name")
        with replacing(path, "wb") as stream:
            stream.write(content)
    return path


def posterior_content(samples: PosteriorSamples, suffix: str) -> bytes:
    """Content of the file, the same for the same samples."""
    facts = {"schema": SCHEMA, **{name: getattr(samples, name) for name in _FACTS}}
    facts = {name: None if isinstance(value, float) and np.isnan(value) else value for name, value in facts.items()}
    if suffix == NPZ:
        return _arrays(samples, json.dumps(facts))
    facts |= {name: list(getattr(samples, name)) for name in _LISTS}
    facts["base_matrix"] = samples.base_matrix.tolist()
    stream = io.StringIO()
    stream.write(f"# {json.dumps(facts)}\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(samples.names)
    writer.writerows([repr(value) for value in row] for row in samples.values.tolist())
    return stream.getvalue().encode("utf-8")


def _arrays(samples: PosteriorSamples, facts: str) -> bytes:
    arrays: dict[str, Any] = {name: np.array(getattr(samples, name)) for name in _LISTS}
    arrays |= {"facts": np.array(facts), "values": samples.values, "base_matrix": samples.base_matrix}
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(values), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", _OLDEST), member.getvalue())
    return stream.getvalue()


@checked
def load_posterior(path: str | Path) -> PosteriorSamples:
    """Read samples that `PosteriorSamples.save` or `export_ensemble` has written.

    Parameters
    ----------
    path : path
        Ends in ``.npz`` or ``.csv``.

    Raises
    ------
    InputError
        The file cannot be read, or holds no samples of this schema.
    """
    path = Path(path)
    read = _from_arrays if _suffix(path) == NPZ else _from_table
    try:
        facts, values = read(path)
        if facts.pop("schema") != SCHEMA:
            raise ValueError("another schema")
        lists = {name: tuple(map(str, facts[name])) for name in _LISTS}
        spread = facts["split_deviation"]
        matrix = np.asarray(facts["base_matrix"], dtype=float)
        given = {**facts, **lists, "notes": tuple(facts["notes"]), "base_matrix": matrix, "values": values}
        samples = PosteriorSamples(**{**given, "split_deviation": np.nan if spread is None else float(spread)})
    except OSError as error:
        raise InputError(f"cannot read {str(path)!r}: {error.strerror or error}") from error
    except (KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{str(path)!r} holds no samples of a posterior ({SCHEMA}): {error}") from error
    shape = (len(samples.base_names), len(samples.names))
    if samples.values.ndim != 2 or samples.values.shape[1] != shape[1] or samples.base_matrix.shape != shape:
        raise InputError(f"{str(path)!r} holds no samples of a posterior ({SCHEMA}): arrays of other sizes")
    return samples


def _from_arrays(path: Path) -> tuple[dict[str, Any], np.ndarray]:
    with opened(path, LOG) as stream, np.load(stream, allow_pickle=False) as file:
        facts = dict(json.loads(str(file["facts"])))
        facts |= {name: file[name].tolist() for name in _LISTS}
        return {**facts, "base_matrix": file["base_matrix"]}, np.asarray(file["values"], dtype=float)


def _from_table(path: Path) -> tuple[dict[str, Any], np.ndarray]:
    head, *rows = read_text(path).splitlines()
    if not head.startswith("# {"):
        raise ValueError("no facts in its first line")
    table = list(csv.reader(rows))
    facts = dict(json.loads(head[2:]))
    if not table or table[0] != facts["names"]:
        raise ValueError("columns of other names")
    return facts, np.array([[float(value) for value in row] for row in table[1:]]).reshape(-1, len(table[0]))


def _suffix(path: Path) -> str:
    if path.suffix.lower() not in (NPZ, CSV):
        raise InputError(f"samples are written to and read from {NPZ} or {CSV}, given {str(path)!r}")
    return path.suffix.lower()
