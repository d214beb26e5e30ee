"""``verification-LOG.json``: verification of a result on a log that was not used to identify."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from excite.files.curves_file import write_curves
from excite.files.figure_names import figure_names
from excite.files.verification_curves import CURVES, verification_curves
from excite.simulation.replay import Replay
from excite.storage.atomic import read_json, write_json
from excite.storage.manifest import read_manifest
from excite.storage.result_folder import replace_result, result_folder
from excite.verification.verification import Verification
from regressors.errors import InputError

SCHEMA = "excite.verification/1"
_FIGURES = ("torques", "motion", "parts")


def save_verification(verification: Verification, folder: str | Path, *, name: str | None = None) -> list[Path]:
    """Write a verification into a folder, created if it does not exist; one of the same name is replaced.

    Parameters
    ----------
    verification : Verification
    folder : path
    name : str, optional
        Name of the file, without its ending; ``verification-LOG`` if not given.

    Returns
    -------
    list of Path
        Files that were written.

    Raises
    ------
    InputError
        The folder is being written by another process, or cannot be written to; or a file of the name is there that is
        not a verification.
    """
    stem = name if name is not None else f"verification-{Path(verification.prepared.log.source).stem}"
    folder, file = Path(folder), f"{stem}.json"
    with result_folder(folder) as run:
        check_replaceable(folder, stem)
        older = figure_names(f"{stem}_{part}" for part in _FIGURES) if (folder / file).exists() else []
        with replace_result(folder, stem, run=run, older=older) as staged:
            write_curves(staged / f"{stem}{CURVES}", verification_curves(verification))
            write_json(staged / file, verification_content(verification))
    return [folder / file, folder / f"{stem}{CURVES}"]


def check_replaceable(folder: Path, stem: str) -> None:
    """Raise `InputError` where a file has the name of a verification, but is the user's own.

    Parameters
    ----------
    folder : Path
    stem : str
        Name of the verification's file, without its ending.
    """
    path = folder / f"{stem}.json"
    if not path.exists() or stem in read_manifest(folder):
        return
    try:
        own = read_json(path).get("schema") != SCHEMA
    except InputError:
        own = True
    if own:
        raise InputError(f"{path} is already there, and is not a verification; choose another `folder`")


def verification_content(verification: Verification) -> dict[str, Any]:
    """Content of a verification's JSON file.

    Parameters
    ----------
    verification : Verification
    """
    log = verification.prepared.log
    return {
        "schema": SCHEMA,
        "robot": {"name": verification.robot.name, "sha256": verification.robot.sha256()},
        "log": {
            "file": log.source,
            "sha256": log.sha256,
            "rows": log.count,
            "from": float(log.time[0]),
            "to": float(log.time[-1]),
            "notes": list(verification.prepared.notes),
        },
        "tolerances": vars(verification.tolerances),
        "holds": verification.verdict.holds,
        "verdict": verification.verdict.text,
        "against": list(verification.verdict.against),
        "remarks": list(verification.verdict.remarks),
        "relative_error": _finite(verification.relative_error),
        "training_error": verification.training_error,
        "corrected_error": _corrected(verification),
        "event_free_error": None if verification.event_free_error is None else _finite(verification.event_free_error),
        "horizon": verification.horizon,
        "windows": _windows(verification.replay),
        "torques": [
            {**_plain(asdict(error)), "limited_by": error.limited_by, "corrected": corrected}
            for error, corrected in zip(verification.torques, _of_equations(verification), strict=True)
        ],
        "motions": None if verification.motions is None else [_plain(asdict(error)) for error in verification.motions],
    }


def _corrected(verification: Verification) -> float | None:
    """Relative error over all equations, without the noise of the measurement."""
    whole = verification.corrected_total
    return None if whole is None else _finite(whole.relative)


def _windows(replay: Replay | None) -> dict[str, int] | None:
    """How many windows of the motion there are, and of how many it was simulated."""
    if replay is None:
        return None
    count = len(replay.starts)
    return {"simulated": count, "of": count + replay.left_out}


def _of_equations(verification: Verification) -> list[dict[str, Any] | None]:
    """The same of each equation, with the noise itself."""
    known = [_plain(asdict(error)) for error in verification.corrected]
    return [*known] or [None] * len(verification.torques)


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {name: _finite(value) if isinstance(value, float) else value for name, value in values.items()}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
