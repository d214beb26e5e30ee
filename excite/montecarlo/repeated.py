"""Repetitions of an experiment through the whole chain, one after the other, in little memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import scipy.linalg

from excite.estimates.long_work import announce
from excite.identification.decimated_rows import Decimation
from excite.identification.repetition_count import repetition_prediction
from excite.montecarlo.batch_estimators import ESTIMATORS, Moments, Solved
from excite.montecarlo.equation_columns import EquationColumns
from excite.montecarlo.experiment import Experiment, check_shown
from excite.montecarlo.noise_samples import drawn, measured_position
from excite.montecarlo.repetition_memory import experiment_prediction
from excite.montecarlo.repetition_time import repetition_seconds
from excite.montecarlo.repetitions import Repetitions
from excite.signals.method import FilteredMotion, Method
from regressors.errors import InputError
from regressors.models.base import triangular_factor
from regressors.numerical import numerical_work
from regressors.quantities import check
from regressors.samples import Array, Index, Samples

Part = tuple[slice, Sequence[Array]]
_ENDED = "Ctrl-C ends them, and what was identified is saved"
_WELL = 1e5  # condition number up to which second moments of the columns are accurate as they are


@numerical_work(
    "the repetition of the experiment",
    "rows that hardly move, or numbers of very different sizes are the likely cause: "
    "check the units of the log and `rows`",
)
def repeat_experiment(
    experiment: Experiment, count: int, seed: int, *, progress: Callable[[int, int], None] | None = None
) -> Repetitions:
    """Estimates from repetitions with different noise.

    Parameters
    ----------
    experiment : Experiment
    count : int
        Number of repetitions.
    seed : int
        Repetition k of a seed is the same whatever `count` is.
    progress : callable, optional
        Called after every repetition with the number of repetitions done and `count`.

    Raises
    ------
    InputError
        Fewer than two repetitions, more memory than the cap, a motion from which the parameters are not identifiable,
        or a method that chooses its settings from the positions.
    """
    check("repeats", count)
    check("seed", seed)
    if count < 2:
        raise InputError(f"repetitions: expected 2 or more, given {count}")
    experiment_prediction(experiment).check()
    repetition_prediction(count, experiment.base.rank).check()
    announce("the repetitions", repetition_seconds(experiment, count), _ENDED)
    chain = _Chain(experiment)
    solved = []
    for number in range(count):
        solved.append(chain.repetition(seed, number))
        if progress is not None:
            progress(number + 1, count)
    base, beta = experiment.base, np.asarray(experiment.beta, dtype=float)
    P = np.eye(beta.size) if chain.change is None else chain.change
    estimates = beta + np.array([P @ one.error for one in solved])
    predicted = np.array([np.linalg.norm(P @ one.half, axis=1) for one in solved])
    noise = np.array([one.noise for one in solved])
    return Repetitions(base.names, base.units, beta, estimates, predicted, noise, chain.rows - base.rank, seed)


class _Chain:
    """What the repetitions of an experiment share: the true motion, its equations, and their columns."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        true, self.efforts = experiment.samples, experiment.efforts
        self.spread = experiment.noise.spread(true.q.shape[1], self.efforts.shape[1])
        self.kept, self.samples = slice(0, true.time.size), true
        self.method = None if experiment.method is None else experiment.method.settled(true.time, true.q)
        if self.method is not None:
            motion = self._motion(true.q)
            self.kept, self.samples = motion.kept, motion.samples
        cut, self.decimation = true.rows(self.kept), None
        if experiment.low_pass is not None or experiment.every > 1:
            self.decimation = Decimation.of(cut.time, experiment.low_pass, experiment.every)
        self.columns = EquationColumns(experiment.model, experiment.base.index, self.decimation)
        self.instruments = self._whole(cut) if experiment.estimator == "instrumental" else None
        self.fixed = None if experiment.noise.moves else self._whole(self.samples)
        y = self._left(self.samples, self.efforts[self.kept])
        self.count, self.sizes = len(y), np.sqrt(np.mean(y**2, axis=0))
        self.rows = y.size
        self.change = self._conditioned(cut)
        self.shared: Array | None = None
        if self.fixed is not None:
            self.shared = self._moments(self._parts(self.samples), None)

    def repetition(self, seed: int, number: int) -> Solved:
        """Estimate of one repetition, by its number."""
        true, (effort, position, step) = self.experiment.samples, self.spread
        draw = drawn(seed, number, true.time.size, true.q.shape[1], self.efforts.shape[1])
        samples = self.samples
        if self.experiment.noise.moves:
            motion = self._motion(measured_position(true.q, draw, position, step))
            if motion.kept != self.kept:
                raise _chooses(self.method)
            samples = motion.samples
        y = self._left(samples, (self.efforts + effort * draw.effort)[self.kept])
        G = self._moments(self._parts(samples), y)
        return ESTIMATORS[self.experiment.estimator](Moments(G, self.count, self.sizes))

    def _motion(self, q: Array) -> FilteredMotion:
        assert self.method is not None
        return self.method.motion(self.experiment.samples.time, q)

    def _left(self, samples: Samples, efforts: Array) -> Array:
        """Left-hand sides y of all rows, shape (m, r)."""
        y = self.experiment.model.right_side(samples, efforts).reshape(-1, len(self.experiment.model.row_labels))
        return y if self.decimation is None else self.decimation(y)

    def _parts(self, samples: Samples) -> Iterable[Part]:
        return self.columns.parts(samples) if self.fixed is None else [(slice(0, self.count), self.fixed)]

    def _whole(self, samples: Samples) -> list[Array]:
        """Transposed columns of each equation, of all rows."""
        parts = [X for _, X in self.columns.parts(samples)]
        return [np.concatenate(pieces, axis=1) for pieces in zip(*parts, strict=True)]

    def _conditioned(self, true: Samples) -> Array | None:
        """Matrix P by which columns are multiplied, so that their moments are accurate; None where that changes little.

        Raises
        ------
        InputError
            Not all parameters are identifiable, from the true motion or from that by the method.
        """
        names = self.experiment.base.names
        check_shown(self._factor(self.columns.parts(true)), self.rows, names)
        R = self._factor(self._parts(self.samples))
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

    def _moments(self, parts: Iterable[Part], y: Array | None) -> Array:
        """Moments of ``[W P, e]``, or of ``[Z P, W P, e]``, shape (r, k, k); without e where y is not given."""
        b, front = self.experiment.base.rank, 0 if self.instruments is None else self.experiment.base.rank
        G = (
            np.zeros((len(self.columns.used), front + b + 1, front + b + 1))
            if self.shared is None
            else self.shared.copy()
        )
        for rows, X in parts:
            for j, (x, used) in enumerate(zip(X, self.columns.used, strict=True)):
                A, place = self._mixed(x, used), used if self.change is None else np.arange(b)
                if self.instruments is not None:
                    A = np.concatenate([self._mixed(self.instruments[j][:, rows], used), A])
                    place = np.concatenate([place, front + place])
                if self.shared is None:
                    G[j][np.ix_(place, place)] += A @ A.T
                if y is not None:
                    e = y[rows, j] - self.experiment.beta[used] @ x
                    c = A @ e
                    G[j][place, -1] += c
                    G[j][-1, place] += c
                    G[j][-1, -1] += e @ e
        return G

    def _mixed(self, x: Array, used: Index) -> Array:
        return x if self.change is None else self.change[used].T @ x


def _chooses(method: Method | None) -> InputError:
    """Error where the instants that a method keeps depend on the noise."""
    name = "" if method is None else f" {method.name!r}"
    return InputError(f"repetitions: the method{name} keeps other instants with other noise; give its settings")
