"""Files of a simulated run: joint log, wrench log where there is a load, and sidecars with the true values."""

from __future__ import annotations

from pathlib import Path

from excite.logs.log_reading import write_log
from excite.logs.sidecar import LOG, SCHEMA, log_entry, saturation_content, sidecar_path
from excite.simulation.simulation import Simulation
from excite.storage.atomic import read_json, write_json
from excite.storage.manifest import sha256_of
from excite.storage.result_folder import replace_files, result_file
from regressors.errors import InputError, TakenError


def paths_of(log: Path, *, wrench: bool, replace: bool = False) -> list[tuple[Path, Path]]:
    """Paths of log and sidecar of the joints, and of the wrench where there is one, checked to be writable."""
    if log.suffix != ".csv":
        raise InputError(f"{log}: expected a name that ends in .csv")
    logs = [log, log.with_suffix(".wrench.csv")] if wrench else [log]
    pairs = [(path, sidecar_path(path)) for path in logs]
    there = [str(path) for pair in pairs for path in pair if path.exists()]
    if there and not replace:
        raise TakenError(f"{', '.join(there)} already there")
    return pairs


def save_simulation(simulation: Simulation, log: str | Path, *, replace: bool = False) -> list[Path]:
    """Write the logs of a simulated run with their sidecars, and replace older ones, all at once."""
    log = Path(log)
    logs = [simulation.log] if simulation.wrench_log is None else [simulation.log, simulation.wrench_log]
    with result_file(log):
        pairs = paths_of(log, wrench=simulation.wrench_log is not None, replace=replace)
        content = sidecar_content(simulation)
        with replace_files(log, remove=_older_wrench(log)) as staged:
            for (path, beside), recorded in zip(pairs, logs, strict=True):
                write_log(recorded, staged / path.name)
                write_json(staged / beside.name, {**content, **log_entry(staged / path.name)})
    return [path for pair in pairs for path in pair]


def _older_wrench(log: Path) -> list[str]:
    """Wrench log of the run that is replaced, which leaves with it; its sidecar is that of the joints."""
    path = log.with_suffix(".wrench.csv")
    try:
        of_joints, of_wrench = (read_json(sidecar_path(each)) for each in (log, path))
    except InputError:
        return []
    of_joints.pop(LOG, None)  # of the one file alone
    of_wrench.pop(LOG, None)
    return [path.name, sidecar_path(path).name] if of_joints == of_wrench else []


def sidecar_content(simulation: Simulation) -> dict[str, object]:
    """Content of ``LOG.json``."""
    steps, source = simulation.steps, simulation.source
    file = None if source is None else source.file
    robot = simulation.robot if source is None else source.robot
    origin = {"design": None, "friction_plan": None} if source is None else source.origin
    settings = {
        **simulation.settings.to_dict(),
        "substeps": steps.substeps,
        "sign_width": steps.width if steps.sticking is None else None,
        "compensation_width": steps.width,
        "breakaway": None if steps.sticking is None else steps.sticking.distance,
        "breakaway_lead": None if steps.sticking is None else list(steps.sticking.lead),
    }
    return {
        "schema": SCHEMA,
        "robot": {"name": robot.name, "sha256": robot.sha256()},
        **origin,
        "trajectory": None if file is None else {"file": file.name, "sha256": sha256_of(file)},
        "settings": settings,
        "seed": simulation.settings.seed,
        "truth": dict(simulation.truth),
        "notes": list(simulation.notes),
        "holds": simulation.outcome.holds,
        "against": list(simulation.outcome.failures),
        "saturated": [saturation_content(one) for one in simulation.outcome.saturated],
    }
