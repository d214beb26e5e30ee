"""The robot as an earlier identification knows it: parameters, their covariance, and calibrated gains."""

from __future__ import annotations

import numpy as np

from excite.identification.identification import Identification
from excite.identification.torque_target import stated_covariance
from excite.payload.known_gains import KnownGains
from regressors.errors import InputError
from regressors.samples import Array

_UNKNOWN = 1e3  # times its size, or one SI unit: deviation of a parameter that was not identified


def known_parameters(result: Identification) -> tuple[Array, Array]:
    """Base parameters of a result, and their covariance."""
    values = np.asarray(result.coefficients, dtype=float)
    stated = stated_covariance(result)
    if stated is None:
        raise InputError(f"{result.name} has no covariance of its parameters; identify the robot again")
    covariance = np.array(stated)
    unknown = ~np.isfinite(np.diag(covariance))
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    covariance[unknown, :] = covariance[:, unknown] = 0.0
    size = np.maximum(np.abs(values), 1.0)
    covariance[unknown, unknown] = (_UNKNOWN * size[unknown]) ** 2
    return values, covariance


def calibrated_gains(result: Identification) -> KnownGains | None:
    """Gains that a result was identified with, as factors on corrected torques, which are one; None where as stated."""
    known = result.calibration
    if known is None:
        return None
    relative = known.deviation / known.factor
    covariance = np.outer(relative, relative) if known.kind == "common" else np.diag(relative**2)
    drives = known.drives
    return KnownGains(drives, np.ones(len(drives)), covariance, "drive gains as calibrated with the robot's parameters")
