"""One training set: ours with plain defaults and every rival, judged on the raw torques of the same rows."""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from filtered_motion import Array
from friction_columns import COMPARED, VARIANTS
from interval_agreement import BODIES, FRICTION, ROTORS
from rigid_regressor import RigidRegressor
from rival_fits import CUTOFFS, RivalFit, RivalLog, rival_fits

import excite
from excite.identification.identification import Identification
from excite.verification.verification import Verification

HERE = Path(__file__).resolve().parent


def training_case(folder: Path, robot: dict[str, Any], train: list[str], tests: list[str]) -> dict[str, Any]:
    """Ours and the rivals from one training set.

    Parameters
    ----------
    folder : Path
        Of all data.
    robot : dict
        Of splits.yaml.
    train, tests : list of str
        Names of logs.

    Returns
    -------
    dict
        For JSON; with ``refused`` where the tool refuses the training set.
    """
    place = folder / robot["robot"]
    name = str(place) if place.is_file() else str(robot["robot"])
    mapping = HERE / robot["mapping"]
    paths = {log: folder / robot["folder"] / robot["logs"][log] for log in (*train, *tests)}
    cpu, wall = time.process_time(), time.monotonic()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = excite.identify(name, [paths[log] for log in train], mapping=mapping)
    except excite.ExciteError as error:
        return {"train": train, "refused": str(error).replace(f"{folder}/", "")}
    cpu, wall = time.process_time() - cpu, time.monotonic() - wall
    layout = excite.read_mapping(mapping)
    verified = {log: excite.verify(result, paths[log], mapping=mapping) for log in tests}
    read = {log: excite.read_log(path, None, layout) for log, path in paths.items()}
    rivals = _rivals(result, verified, read, train)
    ours = {"cpu": cpu, "wall": wall, **_described(result)}
    return {
        "train": train,
        "ours": ours,
        "tests": {log: _judged(v) for log, v in verified.items()},
        "rivals": rivals,
        "rival_groups": rival_groups(RigidRegressor(result.robot)),
    }


def rival_groups(regressor: RigidRegressor) -> list[str]:
    """Group of each parameter of the rivals whose intervals are compared."""
    n = regressor.robot.n
    rigid = [BODIES if k < 10 * n else ROTORS for k in regressor.independent]
    return [*rigid, *[FRICTION] * (n * len(VARIANTS[COMPARED]))]


def _described(result: Identification) -> dict[str, Any]:
    """What ours chose, says of itself, and estimates."""
    estimate = result.estimate
    expressions = dict(zip(result.target.base.names, result.target.base.expressions, strict=True))
    return {
        "training_error": result.training_error,
        "choices": [choice.reason for choice in result.choices],
        "doubts": [doubt.text for doubt in result.doubts],
        "method": estimate.method,
        "names": list(estimate.names),
        "expressions": [expressions.get(name, name) for name in estimate.names],
        "values": _finite(estimate.values),
        "deviation": _finite(estimate.deviation),
        "half_width": _finite(estimate.half_width),
    }


def _finite(values: Array) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]


def _judged(found: Verification) -> dict[str, Any]:
    return {
        "error": found.relative_error,
        "joints": [torque.relative for torque in found.torques],
        "rows": int(found.time.size),
        "seconds": float(found.time[-1] - found.time[0]),
        "holds": found.holds,
    }


def _rivals(
    result: Identification, verified: dict[str, Verification], read: dict[str, Any], train: list[str]
) -> list[dict[str, Any]]:
    """Every rival, trained on the rows that the tool found and judged on those that `verify` judged."""
    regressor = RigidRegressor(result.robot)
    spans = [(float(part.log.time[0]), float(part.log.time[-1])) for part in result.prepared]
    rows = []
    for cutoff in CUTOFFS:
        logs = {log: RivalLog(regressor, read[log], cutoff) for log in verified}
        for made in rival_fits(regressor, [read[log] for log in train], spans, cutoff):
            errors = {log: _errors(logs[log], made, verified[log]) for log in verified}
            rows.append({**_rival(made), "tests": errors})
    return rows


def _rival(made: RivalFit) -> dict[str, Any]:
    fit, rival = made.fit, made.rival
    told = {"estimator": rival.estimator, "friction": rival.friction, "cutoff": rival.cutoff}
    intervals = {}
    if fit.deviation is not None and rival.friction == COMPARED:
        intervals = {"values": fit.x.tolist(), "deviation": fit.deviation.tolist()}
    return {**told, "cpu": made.cpu, "wall": made.wall, **intervals}


def _errors(log: RivalLog, made: RivalFit, judged: Verification) -> dict[str, Any]:
    error = judged.measured - log.predicted(made, judged.time)
    size = np.linalg.norm(judged.measured, axis=0)
    joints = np.linalg.norm(error, axis=0) / size
    return {"error": float(np.linalg.norm(error) / np.linalg.norm(size)), "joints": joints.tolist()}
