"""Provenance of an identification: the design that was played, versions, files, times and reference values."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

from excite.design.designed_motion import DesignedMotion
from excite.identification.result import PlayedDesign
from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from excite.logs.mapping import LogMapping, read_mapping
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.models.nominal import parameter_values, standard_values
from regressors.samples import Array
from regressors.symbolic.vectorised import evaluation

_PACKAGES = ("excite-trajectories", "casadi", "clarabel", "numpy", "scipy")


def played_design(design: DesignedMotion) -> PlayedDesign:
    """The design whose motion was played."""
    if design.folder is None:
        return PlayedDesign(None, None, None, design.condition_number)
    file = design.folder / "design.json"
    digest = sha256(read_bytes(file)).hexdigest()
    return PlayedDesign(str(file), digest, str(design.folder), design.condition_number)


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


def check_played(design: DesignedMotion | None, mapping: LogMapping | str | Path | None) -> None:
    """Refuse a design that is not the one that a log mapping names."""
    if design is None or mapping is None:
        return
    named = (read_mapping(mapping) if isinstance(mapping, str | Path) else mapping).design
    if named is not None and named not in (design.file_sha256, design.coefficients_sha256):
        raise InputError(
            f"the log mapping is of a recording of another design: it names the SHA-256 {named[:12]}..., and "
            f"{design.name} has {(design.file_sha256 or design.coefficients_sha256)[:12]}...; give the `design` "
            "that was played, or the mapping that was written with this one"
        )


@dataclass(frozen=True, eq=False)
class ReferenceValues:
    """Values that an estimate is compared with.

    Parameters
    ----------
    kind : {"truth", "description"}
        Of a simulated log, or as the robot's description states them.
    values : ndarray, shape (p,)
        NaN where unknown.
    """

    listed: ClassVar[bool] = True

    kind: str
    values: Array


def reference_of(target: IdentificationTarget, logs: Sequence[Log]) -> ReferenceValues:
    """True values of simulated logs, else those of the robot's description."""
    truths: list[Mapping[str, float]] = [log.truth for log in logs if log.truth]
    model, base = target.model, target.base
    if truths and len(truths) == len(logs) and all(truth == truths[0] for truth in truths):
        return ReferenceValues("truth", parameter_values(model, base, dict(truths[0])))
    return ReferenceValues("description", parameter_values(model, base, standard_values(target.robot)))
