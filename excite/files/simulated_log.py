"""Files of a simulated run: the joints' log, the wrench's log where there is a load, and what is true beside each."""

from __future__ import annotations

import hashlib
from pathlib import Path

from excite.files.atomic import write_json
from excite.files.design_folder import DESIGN
from excite.files.design_json import StoredDesign
from excite.logs.sidecar import SCHEMA, sidecar_path
from excite.logs.writing import write_log
from excite.simulate.simulation import Simulation
from regressors.errors import InputError


def paths_of(log: Path, *, wrench: bool, force: bool = False) -> list[tuple[Path, Path]]:
    """Log and sidecar of the joints, and of the wrench where there is one, once it is sure that they may be written.

    Parameters
    ----------
    log : Path
        Ends in .csv.
    wrench : bool
        True if there is a wrench log as well.
    force : bool
        Allow files that are there already.

    Raises
    ------
    InputError
        Another ending, no such folder, or files that are there already.
    """
    if log.suffix != ".csv":
        raise InputError(f"--out {log}: expected a name that ends in .csv")
    logs = [log, log.with_suffix(".wrench.csv")] if wrench else [log]
    pairs = [(path, sidecar_path(path)) for path in logs]
    there = [str(path) for pair in pairs for path in pair if path.exists()]
    if there and not force:
        raise InputError(f"{', '.join(there)} already there; --force replaces, or choose another --out")
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write to {log.parent}: {error.strerror}") from error
    return pairs


def write_simulation(
    found: Simulation, design: StoredDesign, log: Path, *, played: Path | None = None, force: bool = False
) -> list[Path]:
    """Write the logs of a simulated run; the sidecars come last and say that the rest is there.

    Parameters
    ----------
    found : Simulation
    design : StoredDesign
        That was played.
    log : Path
        Ends in .csv.
    played : Path, optional
        File of the motion, where it was not the design's own.
    force : bool
        Replace what is there.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    InputError
        See `paths_of`.
    """
    pairs = paths_of(log, wrench=found.wrench_log is not None, force=force)
    logs = [found.log] if found.wrench_log is None else [found.log, found.wrench_log]
    content = sidecar_content(found, design, played)
    for (path, beside), recorded in zip(pairs, logs, strict=True):
        beside.unlink(missing_ok=True)  # that of another log must not be taken for this one's
        write_log(recorded, path)
        write_json(beside, content)
    return [path for pair in pairs for path in pair]


def sidecar_content(found: Simulation, design: StoredDesign, played: Path | None = None) -> dict[str, object]:
    """Content of ``LOG.json``."""
    settings = {**found.settings.to_dict(), "substeps": found.steps.substeps, "sign_width": found.steps.width}
    return {
        "schema": SCHEMA,
        "robot": {"name": design.robot.name, "sha256": design.robot.sha256()},
        "design": {
            "folder": design.folder.name,
            "sha256": _sha256(design.folder / DESIGN),
            "condition_number": design.content.get("criteria", {}).get("condition_number"),
        },
        "trajectory": None if played is None else {"file": played.name, "sha256": _sha256(played)},
        "settings": settings,
        "seed": found.settings.seed,
        "truth": dict(found.truth),
        "notes": list(found.notes),
    }


def _sha256(file: Path) -> str | None:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.exists() else None
