"""Sidecar file of a log: ``LOG.json`` next to ``LOG.csv``, with what is known of the log beside its columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from excite.logs.log import Log
from excite.logs.saturation import Saturation
from excite.storage.atomic import read_json
from excite.storage.manifest import sha256_of
from excite.storage.result_folder import settle_files
from regressors.errors import InputError
from regressors.robot.robot import Robot

SCHEMA = "excite.log/1"
LOG = "log"


def sidecar_path(log: str | Path) -> Path:
    """Path of the sidecar file of a log."""
    path = Path(log)
    if path.suffix == ".json":
        raise InputError(f"{path}: a log ending in .json leaves no name for the file beside it")
    return path.with_suffix(".json")


def log_entry(log: Path) -> dict[str, Any]:
    """Entry ``log`` of a sidecar file, by which an edited log is found; empty where there is no log."""
    sha256 = sha256_of(log)
    return {} if sha256 is None else {LOG: {"sha256": sha256}}


def read_sidecar(log: str | Path) -> dict[str, Any] | None:
    """Content of the sidecar file of a log; None where there is none."""
    if Path(log).suffix == ".json" or not (path := sidecar_path(log)).exists():
        return None
    settle_files(Path(log))
    content = read_json(path)
    if content.get("schema") != SCHEMA:
        raise InputError(f"{path}: expected schema {SCHEMA}, given {content.get('schema')!r}")
    robot, truth = content.get("robot"), content.get("truth")
    if not isinstance(robot, dict) or not all(isinstance(robot.get(key), str) for key in ("name", "sha256")):
        raise InputError(f"{path}: robot should have a name and a sha256")
    if truth is not None and not (isinstance(truth, dict) and all(_is_number(value) for value in truth.values())):
        raise InputError(f"{path}: truth should map names of standard parameters to numbers")
    if LOG in content and not (isinstance(of := content[LOG], dict) and isinstance(of.get("sha256"), str)):
        raise InputError(f"{path}: log should have a sha256")
    saturated_torques(content, path)
    return content


def saturation_content(one: Saturation) -> dict[str, Any]:
    """Saturation as plain JSON values."""
    return {
        "torque": one.label,
        "limit": one.limit,
        "unit": one.unit,
        "rows": one.rows,
        "spans": [list(span) for span in one.spans],
    }


def saturated_torques(content: Mapping[str, Any], source: str | Path) -> tuple[Saturation, ...]:
    """Torques that a file beside a log says were at their limit; none where it says nothing of it."""
    given = content.get("saturated", [])
    if not (isinstance(given, list) and all(_is_saturation(one) for one in given)):
        raise InputError(
            f"{source}: saturated should list objects of torque, limit, unit, rows, and spans of two times each"
        )
    return tuple(
        Saturation(one["torque"], one["limit"], one["unit"], one["rows"], tuple((a, b) for a, b in one["spans"]))
        for one in given
    )


def _is_saturation(one: object) -> bool:
    if not (isinstance(one, dict) and isinstance(one.get("spans"), list)):
        return False
    texts, numbers = (one.get(key) for key in ("torque", "unit")), (one.get(key) for key in ("limit", "rows"))
    spans = all(isinstance(span, list) and len(span) == 2 and all(map(_is_number, span)) for span in one["spans"])
    return spans and all(isinstance(text, str) for text in texts) and all(map(_is_number, numbers))


def with_sidecar(log: Log, robot: Robot) -> Log:
    """A log with what its sidecar file says: true parameters, and torques at their limit.

    A sidecar file of a log that was edited since is ignored, which `Log.left_out` says: what it says of rows and times
    need not hold any longer. One without the hash of its log is used as it is.
    """
    content = read_sidecar(log.source)
    if content is None:
        return log
    if LOG in content and content[LOG]["sha256"] != sha256_of(Path(log.source)):
        beside = sidecar_path(log.source).name
        note = f"{beside} beside it is ignored, since the log was changed after that file was written"
        return replace(log, left_out=(*log.left_out, note))
    if content["robot"]["sha256"] != robot.sha256():
        name, sha256 = (content["robot"][key] for key in ("name", "sha256"))
        raise InputError(
            f"{log.source} is a log of {name} (description {sha256[:12]}), not of {robot.name} ({robot.sha256()[:12]})"
        )
    return replace(log, truth=content.get("truth"), saturated=saturated_torques(content, log.source))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
