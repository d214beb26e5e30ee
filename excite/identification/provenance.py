"""Provenance of an identification: the design that was played, versions, files and times."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from excite.design.designed_motion import DesignedMotion
from regressors.input_files import read_bytes
from regressors.symbolic.vectorised import evaluation

_PACKAGES = ("excite-trajectories", "casadi", "clarabel", "numpy", "scipy")


def design_summary_of(design: DesignedMotion) -> Mapping[str, Any]:
    """Folder, hash and condition number of the design whose motion was played."""
    file = None if design.folder is None else design.folder / "design.json"
    return {
        "file": None if file is None else str(file),
        "sha256": None if file is None else sha256(read_bytes(file)).hexdigest(),
        "folder": None if design.folder is None else str(design.folder),
        "condition_number": design.condition_number,
    }


def provenance_of(spent: tuple[float, float], mapping: object, drop: tuple[str, ...], seed: int) -> Mapping[str, Any]:
    """Date, seed, files, times [s] and versions."""
    wall, cpu = spent
    file = Path(mapping) if isinstance(mapping, str | Path) else None
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": seed,
        "mapping": None if file is None else {"file": str(file), "sha256": sha256(read_bytes(file)).hexdigest()},
        "drop": list(drop),
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "evaluation": evaluation(),
        "python": platform.python_version(),
        "versions": {package: version(package) for package in _PACKAGES},
    }
