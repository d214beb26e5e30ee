"""The robot as an earlier identification knows it: parameters, their covariance, and calibrated gains."""

from __future__ import annotations

from typing import Any

import numpy as np

from excite.identification.identification import Identification
from excite.identification.result import IdentificationResult, StoredResult
from excite.payload.known_gains import KnownGains
from regressors.errors import InputError
from regressors.samples import Array

_UNKNOWN = 1e3  # times its size, or one SI unit: deviation of a parameter that was not identified


def known_parameters(result: IdentificationResult) -> tuple[Array, Array]:
    """Base parameters of a result, and their covariance."""
    values = np.asarray(result.coefficients, dtype=float)
    covariance = _covariance(result)
    unknown = ~np.isfinite(np.diag(covariance))
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    covariance[unknown, :] = covariance[:, unknown] = 0.0
    size = np.maximum(np.abs(values), 1.0)
    covariance[unknown, unknown] = (_UNKNOWN * size[unknown]) ** 2
    return values, covariance


def _covariance(result: IdentificationResult) -> Array:
    if isinstance(result, Identification):
        return np.array(result.estimate.covariance)
    if isinstance(result, StoredResult):
        rows = result.content.get("covariance")
        n = len(result.names)
        if isinstance(rows, list) and len(rows) == n and all(isinstance(row, list) and len(row) == n for row in rows):
            return np.array([[np.inf if x is None else float(x) for x in row] for row in rows])
    raise InputError(f"{result.name} has no covariance of its parameters; identify the robot again")


def calibrated_gains(result: IdentificationResult) -> KnownGains | None:
    """Gains that a result was identified with, as factors on corrected torques, which are one; None where as stated."""
    if isinstance(result, Identification):
        content: Any = None if result.calibration is None else result.calibration.content()
    else:
        content = getattr(result, "content", {}).get("drive_gains")
    if not content:
        return None
    drives = tuple(content["drives"])
    relative = np.array([each["standard_deviation"] / each["factor"] for each in content["drives"].values()])
    common = content["kind"] == "common"
    covariance = np.outer(relative, relative) if common else np.diag(relative**2)
    return KnownGains(drives, np.ones(len(drives)), covariance, "drive gains as calibrated with the robot's parameters")
