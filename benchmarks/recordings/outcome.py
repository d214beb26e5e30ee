"""What a command did, as numbers: its exit status, and the content of every file that it wrote."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

LONG = 50  # numbers; longer arrays are kept as length, norm and projections
_PROJECTIONS = 3
_PLAIN = re.compile(r"\b[a-z]{2,}\b")
_MOST_WORDS = 3  # in small letters, that a name has; sentences have more
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
# no behaviour: gap is that to singular values that are zero but for rounding, run a random number, class a module's
# place; of the files that a manifest lists, the content is recorded itself
_OTHER = re.compile(
    r"date|created|sha256|hash|versions?|python|machine|command|cpu|(\w+_)?seconds|gap|run|class|.+\.(png|json|csv|npz)"
)


def projected(values: Sequence[float]) -> dict[str, Any]:
    """An array as its length, its 2-norm, and its products with three random vectors.

    Parameters
    ----------
    values : sequence of float
    """
    a = np.asarray(values, dtype=float)
    finite = np.where(np.isfinite(a), a, 0.0)
    directions = np.random.default_rng(a.size).standard_normal((_PROJECTIONS, a.size))
    products = [float(d @ finite) for d in directions]
    found = {"count": a.size, "norm": float(np.linalg.norm(finite)), "projections": products}
    return found if np.all(np.isfinite(a)) else {**found, "infinite": int(np.sum(~np.isfinite(a)))}


def _numbers(value: object) -> list[float] | None:
    """All numbers of a list of numbers, or of lists of them; None if there is anything else."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return [float(value)]
    if not isinstance(value, list):
        return None
    parts = [_numbers(part) for part in value]
    return None if any(part is None for part in parts) else [x for part in parts if part is not None for x in part]


def _is_name(text: str) -> bool:
    return len(_PLAIN.findall(text)) <= _MOST_WORDS


def reduced(value: Any) -> Any:
    """Content of a file without sentences, and without what differs between two runs; long arrays projected.

    Parameters
    ----------
    value : dict, list, str, number, bool or None
    """
    if isinstance(value, dict):
        if "provenance" in value:
            value = {**value, "provenance": {k: v for k, v in value["provenance"].items() if k == "seed"}}
        return {str(k): reduced(v) for k, v in value.items() if not _OTHER.fullmatch(str(k))}
    if isinstance(value, list):
        numbers = _numbers(value)
        if numbers is not None and len(numbers) > LONG:
            return projected(numbers)
        return [reduced(part) for part in value]
    if isinstance(value, str):
        return value if _is_name(value) else None
    return value


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _column(cells: list[str]) -> Any:
    """Numbers of a column; of one of words each word where it begins."""
    numbers = [_number(cell) for cell in cells]
    if None not in numbers:
        return reduced(numbers)
    return [[k, cell] for k, cell in enumerate(cells) if k == 0 or cell != cells[k - 1]]


def _table(path: Path) -> dict[str, Any]:
    with path.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.reader(stream) if row]
    head, body = rows[0], rows[1:]
    return {name: _column([row[k] for row in body]) for k, name in enumerate(head)}


def _yaml(text: str) -> Any:
    return YAML(typ="safe", pure=True).load(text)


def _content(path: Path) -> Any:
    """What is recorded of a file; of a picture that it is there."""
    match path.suffix:
        case ".json":
            return reduced(json.loads(path.read_text(encoding="utf-8")))
        case ".yaml":
            return reduced(_yaml(path.read_text(encoding="utf-8")))
        case ".csv":
            return _table(path)
    return None


def written(folder: Path) -> dict[str, Any]:
    """Content of all files below a folder, by their names in it.

    Parameters
    ----------
    folder : Path
        Need not be there.
    """
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): _content(path) for path in files}


def printed(text: str, kind: str) -> Any:
    """What is recorded of the standard output.

    Parameters
    ----------
    text : str
    kind : {"nothing", "json", "yaml", "text"}
    """
    match kind:
        case "json":
            return reduced(json.loads(text))
        case "yaml":
            return reduced(_yaml(text))
        case "text":
            return reduced([float(number) for number in _NUMBER.findall(text)])
    return None
