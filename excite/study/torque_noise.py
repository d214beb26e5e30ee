"""Noise of measured torques: stated by its level and colour, or measured in an earlier identification."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import scipy.signal

from excite.identification.autoregressive_noise import AutoregressiveNoise, noise_of_residuals
from excite.identification.identification import Identification
from excite.identification.observations import rows_of_groups
from excite.simulation.sensors import first_order_noise
from excite.simulation.settings import SimulationSettings, one_each
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.samples import Array

_SAME_RATE = 0.02
_SETTLED = 1e-6  # what is left of the initial state of coloured noise


class TorqueNoise(ABC):
    """Noise of the torques of n joints, stationary in time, with zero mean."""

    @abstractmethod
    def draw(self, time: Array, joints: int, rng: np.random.Generator) -> Array:
        """Noise at uniform instants, shape (N, n) [Nm or N].

        Parameters
        ----------
        time : ndarray, shape (N,)
            [s]
        joints : int
            n.
        rng : numpy.random.Generator
        """


@dataclass(frozen=True)
class StatedNoise(TorqueNoise):
    """White noise, and noise through a first-order low-pass, as of `excite.simulation.settings.SimulationSettings`."""

    white: tuple[float, ...]  # standard deviations, one for all joints or one each [Nm or N]
    coloured: tuple[float, ...]
    corner: float  # corner frequency of the coloured noise [Hz]; its time constant is ``1 / (2 pi corner)``

    @classmethod
    def of(cls, settings: SimulationSettings) -> StatedNoise:
        """The noise of simulated torques."""
        return cls(settings.torque_noise, settings.coloured_noise, settings.noise_corner)

    def draw(self, time: Array, joints: int, rng: np.random.Generator) -> Array:
        """See `TorqueNoise.draw`."""
        white = rng.standard_normal((time.size, joints)) * np.array(one_each(self.white, joints, "torque_noise"))
        if not any(self.coloured):
            return np.asarray(white)
        coloured = one_each(self.coloured, joints, "coloured_noise")
        return np.asarray(white + first_order_noise(time, coloured, self.corner, rng))


@dataclass(frozen=True, eq=False)
class MeasuredNoise(TorqueNoise):
    """Autoregressive noise of each joint's equation, ``n_t = sum_k a_k n_{t-k} + u_t``.

    Parameters
    ----------
    rate : float
        Of its instants [Hz].
    joints : tuple of AutoregressiveNoise
    """

    rate: float
    joints: tuple[AutoregressiveNoise, ...]

    @property
    def deviation(self) -> Array:
        """Standard deviation of each joint's noise, shape (n,) [Nm or N]."""
        count = 2**14
        return np.array([np.sqrt(np.mean(_two_sided(noise.spectrum(count)))) for noise in self.joints])

    def draw(self, time: Array, joints: int, rng: np.random.Generator) -> Array:
        """See `TorqueNoise.draw`."""
        rate = rate_of(time)
        if abs(rate / self.rate - 1) > _SAME_RATE or joints != len(self.joints):
            raise InputError(
                f"noise was measured of {len(self.joints)} joints at {self.rate:.4g} Hz, and the motion has {joints} "
                f"joints at {rate:.4g} Hz; give noise that was measured at the same rate"
            )
        return np.column_stack([_drawn(noise, time.size, rng) for noise in self.joints])


def _two_sided(spectrum: Array) -> Array:
    return np.concatenate([spectrum, spectrum[1:-1]])


def _drawn(noise: AutoregressiveNoise, count: int, rng: np.random.Generator) -> Array:
    polynomial = np.append(1.0, -noise.coefficients)
    slowest = float(np.abs(np.roots(polynomial)).max(initial=0.0))
    lead = 0 if slowest == 0.0 else int(np.ceil(np.log(_SETTLED) / np.log(min(slowest, 0.9999))))
    white = rng.standard_normal(lead + count) * np.sqrt(noise.variance)
    return np.asarray(scipy.signal.lfilter([1.0], polynomial, white)[lead:])


@checked
def measured_noise(result: Identification, log: int = 0) -> MeasuredNoise:
    """Noise of the torques of one log, by its residuals: of each joint, level and colour.

    What the model does not explain, such as friction of another form, counts as noise. Each spectrum is that of an
    autoregressive process, see `excite.identification.autoregressive_noise`.

    Parameters
    ----------
    result : Identification
        With an instantaneous model of joint torques, neither low-passed nor decimated.
    log : int
        Which of its logs.

    Raises
    ------
    InputError
        Another model, or filtered equations.
    """
    recipe, rows = result.recipe, result.observations
    if not 0 <= log < len(result.prepared):
        raise InputError(f"log: expected the number of one of {len(result.prepared)} logs, from 0 on, given {log}")
    if result.target.model.window is not None or result.target.model.channel != "effort":
        raise InputError("noise is measured with a model of joint torques at single instants, such as `differential`")
    if recipe.low_pass is not None or (recipe.every or 1) > 1 or recipe.average:
        raise InputError("noise is measured by unfiltered equations; leave out `low_pass`, `every` and `average`")
    residual, r = result.estimate.residual(rows), len(rows.equations)
    joints, deviation = [], result.estimate.noise[log]
    for group, own in rows_of_groups(rows.group):
        if group // r == log:
            e = residual[own]
            fitted = float(np.sqrt(np.mean(e**2)))  # less than the noise by what the parameters take up
            joints.append(noise_of_residuals(e * deviation[group % r] / fitted if fitted > 0 else e))
    return MeasuredNoise(rate_of(result.prepared[log].samples.time), tuple(joints))


def rate_of(time: Array) -> float:
    """Samples per second [Hz]."""
    return (time.size - 1) / float(time[-1] - time[0])
