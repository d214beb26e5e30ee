"""Files of a simulated run: the joints' log, the wrench's log where there is a load, and what is true beside each."""

from __future__ import annotations

from pathlib import Path

from excite.files.motion_source import PlayedMotion, sha256_of
from excite.logs.log_writing import write_log
from excite.logs.sidecar import SCHEMA, sidecar_path
from excite.simulation.simulation import Simulation
from excite.storage.atomic import write_json
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


def write_simulation(found: Simulation, played: PlayedMotion, log: Path, *, force: bool = False) -> list[Path]:
    """Write the logs of a simulated run; the sidecars come last and say that the rest is there.

    Parameters
    ----------
    found : Simulation
    played : PlayedMotion
    log : Path
        Ends in .csv.
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
    content = sidecar_content(found, played)
    for (path, beside), recorded in zip(pairs, logs, strict=True):
        beside.unlink(missing_ok=True)  # that of another log must not be taken for this one's
        write_log(recorded, path)
        write_json(beside, content)
    return [path for pair in pairs for path in pair]


def sidecar_content(found: Simulation, played: PlayedMotion) -> dict[str, object]:
    """Content of ``LOG.json``."""
    steps, file = found.steps, played.file
    settings = {
        **found.settings.to_dict(),
        "substeps": steps.substeps,
        "sign_width": steps.width if steps.sticking is None else None,
        "compensation_width": steps.width,
        "breakaway": None if steps.sticking is None else steps.sticking.distance,
        "breakaway_lead": None if steps.sticking is None else list(steps.sticking.lead),
    }
    return {
        "schema": SCHEMA,
        "robot": {"name": played.robot.name, "sha256": played.robot.sha256()},
        **played.origin,
        "trajectory": None if file is None else {"file": file.name, "sha256": sha256_of(file)},
        "settings": settings,
        "seed": found.settings.seed,
        "truth": dict(found.truth),
        "notes": list(found.notes),
    }
