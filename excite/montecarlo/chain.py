"""What the repetitions of an experiment share, and one repetition after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import scipy.linalg

from excite.identification.decimated_rows import Decimation
from excite.montecarlo.batch_estimators import ESTIMATORS, Moments, Solved
from excite.montecarlo.equation_columns import BLOCK, EquationColumns, Part
from excite.montecarlo.experiment import Experiment, check_shown
from excite.montecarlo.jax_moments import JaxMoments, has_gpu
from excite.montecarlo.moment_sums import MomentSums
from excite.montecarlo.noise_samples import drawn, measured_position
from regressors.errors import InputError
from regressors.models.base import triangular_factor
from regressors.samples import Array, Samples

_WELL = 1e5  # condition number up to which second moments of the columns are accurate as they are


class Chain:
    """The true motion of an experiment, its equations, and their columns."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        true, self.efforts = experiment.samples, experiment.efforts
        self.spread = experiment.noise.spread(true.q.shape[1], self.efforts.shape[1])
        self.kept, self.samples = slice(0, true.time.size), true
        if experiment.method is not None:
            self.motion = experiment.method.operator(true.time, true.q)
            motion = self.motion(true.q)
            self.kept, self.samples = motion.kept, motion.samples
        cut, self.decimation = true.rows(self.kept), None
        if experiment.low_pass is not None or experiment.every > 1:
            self.decimation = Decimation.of(cut.time, experiment.low_pass, experiment.every)
        self.columns = EquationColumns(experiment.model, experiment.base.index, self.decimation)
        instruments = self._whole(cut) if experiment.estimator == "instrumental" else None
        self.fixed = None if experiment.noise.moves else self._whole(self.samples)
        y = self._left(self.samples, self.efforts[self.kept])
        self.count, self.sizes = len(y), np.sqrt(np.mean(y**2, axis=0))
        self.rows = y.size
        self.change = self._conditioned(cut)
        beta = np.asarray(experiment.beta, dtype=float)
        self.sums = MomentSums(self.columns.used, beta, self.change, instruments)
        if self.fixed is not None:
            self.shared = self.sums.shared(self._held())
            self.predicted = np.column_stack(
                [beta[used] @ x for x, used in zip(self.fixed, self.columns.used, strict=True)]
            )
        self.jax = JaxMoments.of(self.sums, self.columns) if self.fixed is None and has_gpu() else None

    @property
    def batch(self) -> int:
        """Repetitions that are computed at once."""
        return 1 if self.jax is None else self.jax.batch(self.samples.time.size)

    def repetitions(self, seed: int, numbers: Sequence[int]) -> Iterator[Solved]:
        """Estimates of some repetitions, by their numbers."""
        if self.jax is None:
            moments: Iterable[Array] = (self._moments(*self._measured(seed, number)) for number in numbers)
        else:
            moments = self.jax([self._measured(seed, number) for number in numbers])
        for G in moments:
            yield ESTIMATORS[self.experiment.estimator](Moments(G, self.count, self.sizes))

    def _measured(self, seed: int, number: int) -> tuple[Samples, Array]:
        """Motion that one repetition sees, and its left-hand sides, shape (m, r)."""
        true, (effort, position, step) = self.experiment.samples, self.spread
        draw = drawn(seed, number, true.time.size, true.q.shape[1], self.efforts.shape[1])
        samples = self.samples
        if self.experiment.noise.moves:
            motion = self.motion(measured_position(true.q, draw, position, step))
            if motion.kept != self.kept:
                raise self._chooses()
            samples = motion.samples
        return samples, self._left(samples, (self.efforts + effort * draw.effort)[self.kept])

    def _moments(self, samples: Samples, y: Array) -> Array:
        if self.fixed is None:
            return self.sums.of(self.columns.parts(samples), y)
        return self.sums.with_errors(self.shared, self._held(), y - self.predicted)

    def _left(self, samples: Samples, efforts: Array) -> Array:
        """Left-hand sides y of all rows, shape (m, r)."""
        y = self.experiment.model.right_side(samples, efforts).reshape(-1, len(self.experiment.model.row_labels))
        return y if self.decimation is None else self.decimation(y)

    def _held(self) -> Iterator[Part]:
        """The columns that are the same in every repetition, in blocks of rows."""
        assert self.fixed is not None
        for first in range(0, self.count, BLOCK):
            rows = slice(first, min(first + BLOCK, self.count))
            yield rows, [x[:, rows] for x in self.fixed]

    def _whole(self, samples: Samples) -> list[Array]:
        """Transposed columns of each equation, of all rows."""
        parts = [X for _, X in self.columns.parts(samples)]
        return [np.concatenate(pieces, axis=1) for pieces in zip(*parts, strict=True)]

    def _conditioned(self, true: Samples) -> Array | None:
        """Matrix P that makes the moments of columns accurate; None where that changes little."""
        names = self.experiment.base.names
        check_shown(self._factor(self.columns.parts(true)), self.rows, names)
        R = self._factor(self.columns.parts(self.samples) if self.fixed is None else self._held())
        sigma = check_shown(R, self.rows, names)
        return None if sigma[0] <= _WELL * sigma[-1] else np.asarray(scipy.linalg.solve_triangular(R, np.eye(len(R))))

    def _factor(self, parts: Iterable[Part]) -> Array:
        """Triangular factor of all columns."""
        b = self.experiment.base.rank
        R = np.zeros((0, b))
        for _, X in parts:
            for x, used in zip(X, self.columns.used, strict=True):
                W = np.zeros((x.shape[1], b))
                W[:, used] = x.T
                R = triangular_factor(np.concatenate([R, W]))
        return R

    def _chooses(self) -> InputError:
        """Error where the instants that a method keeps depend on the noise."""
        method = self.experiment.method
        name = "" if method is None else f" {method.name!r}"
        return InputError(f"repetitions: the method{name} keeps other instants with other noise; give its settings")
