"""Metrics of a motion: condition numbers under all conventions, and the predicted accuracy for given noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from excite.information.target import IdentificationTarget
from excite.storage.codec import OBJECT, named
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.models.nominal import MotorSide, motor_sides
from regressors.samples import Array, Samples

LENGTH = 0.1
DEFAULT_NOISE = 1.0
_LENGTH_POWER = {"kg m": 1, "kg m^2": 2}

CONVENTIONS = {
    "condition_number": "cond(W), columns of the left-to-right QR base (Gautier 1991), SI, unscaled",
    "condition_number_pivoted": "cond(W), columns of the column-pivoted QR base, SI, unscaled",
    "condition_number_orthonormal": "sigma_1 / sigma_b of the full regressor: cond(W) in an orthonormal base",
    "condition_number_column_normalised": "cond(W), left-to-right base, each column divided by its length",
    "condition_number_length_scaled": f"cond(W), left-to-right base, lengths of inertial parameters in {LENGTH:g} m",
    "condition_number_noise_weighted": "cond(W), left-to-right base, each row divided by its noise",
    "condition_number_frobenius": "|W|_F |W^+|_F, left-to-right base, SI, unscaled",
    "smallest_singular_value": "sigma_b(W), left-to-right base, SI",
    "log_det": "natural log det(W'W), left-to-right base, SI, all rows",
    "log_det_per_sample": "natural log det(W'W / N), left-to-right base, SI, N rows per equation",
    "trace_inverse": "tr((W'W)^-1), left-to-right base, SI",
    "smallest_singular_value_noise_weighted": "sigma_b(W), left-to-right base, each row divided by its noise",
    "log_det_noise_weighted": "natural log det(W'W), left-to-right base, each row divided by its noise",
    "trace_inverse_noise_weighted": "tr((W'W)^-1), left-to-right base, each row divided by its noise",
}


@dataclass(frozen=True)
class PredictedAccuracy:
    """Predicted accuracy of one base parameter.

    Parameters
    ----------
    name, expression, unit : str
        The base column, its parameter in standard parameters, and its unit.
    standard_deviation : float
        Standard deviation of the weighted least-squares estimate for the stated torque noise, independent from instant
        to instant.
    motor_side : MotorSide, optional
        The rotor inertia that a parameter at the drive coordinate stands for.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"motor_side.standard_deviation": lambda p: p.of_motor}

    name: str
    expression: str
    unit: str
    standard_deviation: float
    motor_side: MotorSide | None = None

    @property
    def of_motor(self) -> float | None:
        """Standard deviation of the motor's own inertia, where the parameter stands for one."""
        return None if self.motor_side is None else self.standard_deviation / self.motor_side.factor


def noise_per_row(noise: tuple[float, ...] | None, model: RegressorModel) -> Array:
    """Standard deviation of the noise of each of a model's equations, shape (r,), in their units."""
    given = noise if noise is not None else (DEFAULT_NOISE,)
    labels = [name for name, _ in model.row_labels]
    if len(given) not in (1, len(labels)):
        raise InputError(f"noise needs one value, or {len(labels)} for {', '.join(labels)}; given {len(given)}")
    return np.broadcast_to(np.asarray(given, dtype=float), (len(labels),)).copy()


def noise_text(noise: tuple[float, ...] | None, model: RegressorModel) -> str:
    """Text of the noise that the predictions assume, such as ``noise of 1 Nm (assumed) in each row``."""
    values = noise_per_row(noise, model)
    shown = f"{values[0]:g}" if np.all(values == values[0]) else f"{values.min():g} to {values.max():g}"
    units = " or ".join(dict.fromkeys(unit for _, unit in model.row_labels))
    return f"noise of {shown} {units}{' (assumed)' if noise is None else ''} in each row"


def _cond(singular_values: Array) -> float:
    return float(singular_values[0] / singular_values[-1]) if singular_values[-1] > 0 else np.inf


def _log_det(singular_values: Array) -> float:
    return float(2 * np.sum(np.log(singular_values))) if singular_values[-1] > 0 else -np.inf


def _trace_inverse(singular_values: Array) -> float:
    return float(np.sum(singular_values**-2.0)) if singular_values[-1] > 0 else np.inf


def _singular_values(W: Array) -> Array:
    return np.asarray(np.linalg.svd(np.linalg.qr(W, mode="r"), compute_uv=False))


@dataclass(frozen=True, eq=False)
class MotionMeasures:
    """What one motion says of the parameters of a target."""

    listed: ClassVar[bool] = True

    criteria: dict[str, float] = field(metadata=OBJECT)  # see `CONVENTIONS`
    predicted: tuple[PredictedAccuracy, ...] = field(metadata=named("predicted.parameters"))
    # (b,) singular values of W in the left-to-right base, largest first
    spectrum: Array = field(metadata=named("base.singular_values"))
    rows: int = field(default=0, metadata=named("base.rows"))  # number of rows of W

    @classmethod
    def of(cls, target: IdentificationTarget, samples: Samples, noise: Array) -> MotionMeasures:
        """Those of samples, for the noise of each equation, shape (r,)."""
        W = target.model.assemble(samples)[:, target.base.index]
        weighted = W / np.tile(noise, W.shape[0] // noise.size)[:, None]
        spectrum = _singular_values(W)
        criteria = _criteria(target, W, spectrum, _singular_values(weighted), W.shape[0] // noise.size)
        return cls(criteria, _predicted(target, weighted), spectrum, int(W.shape[0]))


def _criteria(target: IdentificationTarget, W: Array, plain: Array, weighted: Array, count: int) -> dict[str, float]:
    """All metrics, defined in `CONVENTIONS`, of W and of its singular values, plain and noise-weighted."""
    base, R = target.base, np.asarray(np.linalg.qr(W, mode="r"))
    sizes = np.linalg.norm(R, axis=0)
    length = np.array([LENGTH ** _LENGTH_POWER.get(unit, 0) for unit in base.units])
    log_det, trace_inverse = _log_det(plain), _trace_inverse(plain)
    return {
        "condition_number": _cond(plain),
        "condition_number_pivoted": _cond(_singular_values(R @ target.transforms["pivoted"])),
        "condition_number_orthonormal": _cond(_singular_values(R @ target.transforms["orthonormal"])),
        "condition_number_column_normalised": _cond(_singular_values(R / np.where(sizes > 0, sizes, 1.0))),
        "condition_number_length_scaled": _cond(_singular_values(R * length)),
        "condition_number_noise_weighted": _cond(weighted),
        "condition_number_frobenius": float(np.linalg.norm(plain)) * float(np.sqrt(trace_inverse)),
        "smallest_singular_value": float(plain[-1]),
        "log_det": log_det,
        "log_det_per_sample": log_det - base.rank * float(np.log(count)),
        "trace_inverse": trace_inverse,
        "smallest_singular_value_noise_weighted": float(weighted[-1]),
        "log_det_noise_weighted": _log_det(weighted),
        "trace_inverse_noise_weighted": _trace_inverse(weighted),
    }


def _predicted(target: IdentificationTarget, weighted: Array) -> tuple[PredictedAccuracy, ...]:
    """Standard deviation of each base parameter, ``sqrt(diag((W' S^-1 W)^-1))`` with S the noise covariance."""
    base, inverse = target.base, np.linalg.pinv(np.linalg.qr(weighted, mode="r"))
    deviation, sides = np.linalg.norm(inverse, axis=1), motor_sides(target.model, base)
    return tuple(
        PredictedAccuracy(name, expression, unit, float(s), sides.get(name))
        for name, expression, unit, s in zip(base.names, base.expressions, base.units, deviation, strict=True)
    )
