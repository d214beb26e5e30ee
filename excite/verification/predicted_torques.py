"""Predicted against measured torques of each equation, and the causes of their difference [KD96] section 6, Fig. 16."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.signal

from regressors.samples import Array

NOISE_ABOVE = 10.0  # frequency above which the motion itself has no content [Hz]
STANDSTILL = 0.02  # of the largest speed of a joint: below, its static friction is undetermined


@dataclass(frozen=True)
class TorqueError:
    """How well one equation is predicted.

    Parameters
    ----------
    name, unit : str
    measured : float
        Root mean square of the measurements [unit].
    error : float
        Root mean square of the difference [unit].
    relative : float
        The ratio of the two; infinite where nothing was measured.
    worst : float
        Largest difference [unit].
    worst_time : float
        When [s].
    noise, standstill, systematic : float
        Shares of the squared error: fast changes that no model of the motion explains; the rest of it while the joint
        is at standstill; and the remainder, an error of the model. Their sum is 1.
    """

    name: str
    unit: str
    measured: float
    error: float
    relative: float
    worst: float
    worst_time: float
    noise: float
    standstill: float
    systematic: float

    @property
    def limited_by(self) -> str:
        """Name of the largest part of the error."""
        parts = {
            "noise of the measurement": self.noise,
            "static friction at standstill": self.standstill,
            "the model (friction, gains, flexibility)": self.systematic,
        }
        return max(parts, key=lambda name: parts[name])


def torque_errors(
    time: Array, measured: Array, predicted: Array, speed: Array, equations: tuple[tuple[str, str], ...]
) -> tuple[TorqueError, ...]:
    """Errors of every equation over a motion."""  # time (N,); measured, predicted (N, r); speed (N, r)
    difference = measured - predicted
    slow = _slow(time, difference)
    return tuple(
        _torque_error(name, unit, time, measured[:, j], difference[:, j], slow[:, j], speed[:, j])
        for j, (name, unit) in enumerate(equations)
    )


def _slow(time: Array, values: Array) -> Array:
    rate = (time.size - 1) / (time[-1] - time[0])
    if rate <= 2.5 * NOISE_ABOVE or time.size < 50:
        return values
    sos = scipy.signal.butter(4, NOISE_ABOVE, output="sos", fs=rate)
    return np.asarray(scipy.signal.sosfiltfilt(sos, values, axis=0))


def _torque_error(
    name: str, unit: str, time: Array, measured: Array, difference: Array, slow: Array, speed: Array
) -> TorqueError:
    total = float(np.mean(difference**2))
    worst = int(np.argmax(np.abs(difference)))
    size = float(np.sqrt(np.mean(measured**2)))
    fast = min(float(np.mean((difference - slow) ** 2)), total)
    with np.errstate(invalid="ignore"):
        still = np.abs(speed) < STANDSTILL * np.abs(speed).max(initial=0.0)
    resting = float(np.sum(slow[still] ** 2)) / float(np.sum(slow**2)) if np.any(slow) else 0.0
    noise = fast / total if total > 0 else 0.0
    return TorqueError(
        name=name,
        unit=unit,
        measured=size,
        error=float(np.sqrt(total)),
        relative=float(np.sqrt(total)) / size if size > 0 else np.inf,
        worst=float(np.abs(difference[worst])),
        worst_time=float(time[worst]),
        noise=noise,
        standstill=(1 - noise) * resting,
        systematic=(1 - noise) * (1 - resting),
    )
