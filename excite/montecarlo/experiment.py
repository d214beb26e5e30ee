"""An experiment to be repeated: the true motion, the measurement noise, and how parameters are estimated."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from excite.montecarlo.batch_estimators import ESTIMATORS
from excite.montecarlo.equation_columns import BLOCK
from excite.montecarlo.noise_samples import Noise
from excite.signals.method import Method, spacing
from regressors.errors import InputError, UnknownName
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.samples import Array, Samples

_SHOWN = 1e-10  # least singular value of an identifiable scaled regressor, relative to the largest


@dataclass(frozen=True, eq=False)
class Experiment:
    """One experiment, from the true motion to the estimate."""

    model: RegressorModel  # model in which the parameters are identified, and with which the true efforts are computed
    base: Base  # its base columns
    samples: Samples  # True motion, N uniform instants
    beta: Array  # (b,) True base parameters
    noise: Noise = field(default_factory=Noise)
    # how velocity and acceleration are obtained from measured positions, with the settings that it chooses for the
    # true ones; without one the regressor is that of the true motion
    method: Method | None = None
    low_pass: float | None = None  # the same low-pass on both sides of the equations [Hz]
    every: int = 1  # decimation factor of the equations, after the low-pass
    estimator: str = "weighted"  # instruments are the regressor of the true motion

    def __post_init__(self) -> None:
        n = self.samples.q.shape[1]
        if n != self.model.robot.n:
            raise InputError(f"experiment: motion of {n} joints for a robot of {self.model.robot.n}")
        if np.shape(self.beta) != (self.base.rank,) or not np.all(np.isfinite(self.beta)):
            raise InputError(f"experiment: expected {self.base.rank} finite parameters, given {np.asarray(self.beta)}")
        if self.estimator not in ESTIMATORS:
            raise UnknownName("estimator", self.estimator, ESTIMATORS)
        if self.noise.moves and self.method is None:
            raise InputError("experiment: positions with noise or counts need a method that differentiates them")
        if self.every < 1:
            raise InputError(f"experiment: every must be 1 or more, given {self.every}")
        if self.model.window is not None and (self.low_pass is not None or self.every > 1):
            raise InputError(
                "experiment: low_pass and every are for models of single instants; a "
                "model of windows integrates already"
            )
        spacing(self.samples.time, "an experiment", 3)
        self.noise.spread(n, self.efforts.shape[1])

    @property
    def efforts(self) -> Array:
        """True joint torques or wrench at every instant, shape (N, c) [Nm or N], without measurement noise."""
        model, standard = self.model.instantaneous(), np.zeros(len(self.model.columns))
        standard[self.base.index] = self.beta
        count = self.samples.time.size
        blocks = (self.samples.rows(slice(first, first + BLOCK)) for first in range(0, count, BLOCK))
        return np.concatenate([model.instants(block) @ standard for block in blocks]).reshape(count, -1)

    def regressor(self, samples: Samples) -> Array:
        """Base columns of the stacked regressor of a motion, shape (m, r, b)."""
        W = self.model.assemble(samples)[:, self.base.index]
        return W.reshape(-1, len(self.model.row_labels), self.base.rank)


def check_shown(R: Array, rows: int, names: tuple[str, ...]) -> Array:
    """Singular values of the columns scaled to length one, shape (b,)."""  # R (k, b)
    sizes = np.linalg.norm(R, axis=0)
    if np.any(sizes == 0.0):
        raise InputError(f"experiment: {names[int(np.argmin(sizes))]} is not identifiable from the motion")
    if rows <= len(names):
        raise InputError(f"experiment: {rows} rows are too few for {len(names)} parameters and their noise")
    sigma: Array = np.linalg.svd(R / sizes, compute_uv=False)
    if sigma[-1] < _SHOWN * sigma[0]:
        raise InputError(
            f"experiment: not all of {', '.join(names)} are identifiable from the motion; "
            f"condition number of the scaled regressor {sigma[0] / sigma[-1]:.1e}"
        )
    return sigma
