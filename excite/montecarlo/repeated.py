"""Repetitions of an experiment through the whole chain, in batches, by JAX.

Positions are measured and differentiated for a whole batch at once; regressors and estimates follow a few at a time,
so memory is bounded by the batch whatever the number of repetitions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from excite.montecarlo.batch_estimators import ESTIMATORS, Solved, group_factors
from excite.montecarlo.experiment import Experiment, check_shown
from excite.montecarlo.noise_samples import drawn, measured_position
from excite.montecarlo.operators import Blocks, filter_matrix, motion_matrices
from excite.montecarlo.repetitions import Repetitions
from regressors.errors import InputError
from regressors.jax_models import JaxModel
from regressors.samples import Samples

BATCH = 64
_AT_ONCE = {"cpu": 1}  # regressors computed together; on other devices as many as fill it
_AT_ONCE_ELSEWHERE = 64

_Motion = tuple[jax.Array, jax.Array, jax.Array]


class _Constants(NamedTuple):
    """Arrays of an experiment that repetitions share, on the device."""

    q: jax.Array  # (N, n), true positions
    motion: _Motion  # (M, n) each, by the method from the true positions
    W: jax.Array  # (m, r, b), of that motion, filtered
    Z: jax.Array  # (m, r, b), of the true motion, filtered
    efforts: jax.Array  # (N, c)
    deviations: tuple[jax.Array, jax.Array, jax.Array]  # of efforts and positions; steps of the encoders
    matrices: Blocks | None  # of the method
    rows: Blocks | None  # of the filter


def repeat_experiment(
    experiment: Experiment,
    count: int,
    seed: int,
    *,
    batch: int = BATCH,
    progress: Callable[[int, int], None] | None = None,
) -> Repetitions:
    """Estimates from repetitions with different noise.

    Parameters
    ----------
    experiment : Experiment
    count : int
        Number of repetitions.
    seed : int
        Repetition k of a seed is the same (to rounding) whatever `count` and `batch` are.
    batch : int
        Repetitions whose motions are held in memory together.
    progress : callable, optional
        Called after every batch with the number of repetitions done and `count`.

    Raises
    ------
    InputError
        Fewer than two repetitions, an empty batch, a motion from which the parameters are not identifiable, or a method
        that is no fixed linear function of the positions.
    """
    if count < 2:
        raise InputError(f"repetitions: expected 2 or more, given {count}")
    if batch < 1:
        raise InputError(f"batch of repetitions: expected 1 or more, given {batch}")
    with jax.enable_x64(True):
        chain = _Chain(experiment)
        run = jax.jit(chain.batch)
        parts = []
        for start in range(0, count, batch):
            numbers = np.arange(start, start + min(batch, count))  # constant size, so that it is compiled once
            parts.append(jax.tree.map(np.asarray, run(chain.constants, seed, numbers)))
            if progress is not None:
                progress(min(start + batch, count), count)
    values, deviation, noise = (np.concatenate(x)[:count] for x in zip(*parts, strict=True))
    base, rows = experiment.base, chain.constants.W.shape[0] * chain.constants.W.shape[1]
    beta = np.asarray(experiment.beta, dtype=float)
    return Repetitions(base.names, base.units, beta, values, deviation, noise, rows - base.rank, seed)


class _Chain:
    """Programs and constants of one experiment."""

    def __init__(self, experiment: Experiment) -> None:
        self._instruments = experiment.estimator == "instrumental"
        self._estimator = ESTIMATORS[experiment.estimator]
        self._jax_model = JaxModel(experiment.model, experiment.base.index)
        self._kept, self.constants = _prepared(experiment)
        self._time = experiment.samples.time[self._kept]

    def batch(self, constants: _Constants, seed: jax.Array, numbers: jax.Array) -> Solved:
        """Estimates of some repetitions, by their numbers."""
        (N, n), c = constants.q.shape, constants.efforts.shape[1]
        draws = jax.vmap(lambda k: drawn(seed, k, N, n, c))(numbers)
        effort, position, step = constants.deviations
        efforts = (constants.efforts + effort * draws.effort)[:, self._kept]
        motion = None
        if constants.matrices is not None:
            q = jax.vmap(lambda draw: measured_position(constants.q, draw, position, step))(draws)
            columns = jnp.moveaxis(q, 0, 1).reshape(N, -1)  # (N, R n)
            motion = [jnp.moveaxis(x.reshape(-1, len(numbers), n), 0, 1) for x in constants.matrices(columns)]
        at_once = _AT_ONCE.get(jax.default_backend(), _AT_ONCE_ELSEWHERE)
        solved: Solved = jax.lax.map(lambda x: self._estimate(constants, *x), (motion, efforts), batch_size=at_once)
        return solved

    def _estimate(self, constants: _Constants, motion: _Motion | None, efforts: jax.Array) -> Solved:
        """One repetition from its motion, the shared one if None, and the measured efforts."""
        q, dq, ddq = motion if motion is not None else constants.motion
        y = self._jax_model.right_side(self._time, q, dq, efforts)[..., None]
        W = constants.W
        if motion is not None:
            W = self._jax_model.assemble(self._time, q, dq, ddq)
            y, W = jnp.split(_filtered(constants.rows, jnp.concatenate([y, W], axis=2)), [1], axis=2)
        else:
            y = _filtered(constants.rows, y)
        front = (constants.Z,) if self._instruments else ()
        return self._estimator(group_factors(*front, W, y), W.shape[0])


def _filtered(rows: Blocks | None, x: jax.Array) -> jax.Array:
    """Low-passed and decimated rows; `x` has shape (m, r, k)."""
    return x if rows is None else rows(x.reshape(x.shape[0], -1))[0].reshape(rows.count, *x.shape[1:])


def _prepared(experiment: Experiment) -> tuple[slice, _Constants]:
    """Instants that the method keeps, and the shared arrays."""
    true, efforts = experiment.samples, experiment.efforts
    kept, matrices, samples = slice(0, true.time.size), None, true
    if experiment.method is not None:
        motion = experiment.method.motion(true.time, true.q)
        kept, samples = motion.kept, motion.samples
        if experiment.noise.moves:
            matrices = motion_matrices(experiment.method, true.time, true.q)
    cut = Samples(*(getattr(true, name)[kept] for name in ("time", "q", "dq", "ddq", "dddq")))
    rows = None
    if experiment.low_pass is not None or experiment.every > 1:
        rate = (cut.time.size - 1) / float(cut.time[-1] - cut.time[0])
        rows = filter_matrix(cut.time.size, rate, experiment.low_pass, experiment.every)
    W, Z = (_filtered(rows, jnp.asarray(experiment.regressor(x))) for x in (samples, cut))
    for A in (W, Z):
        check_shown(np.asarray(A).reshape(-1, A.shape[2]), experiment.base.names)
    effort, position, step = experiment.noise.spread(true.q.shape[1], efforts.shape[1])
    constants = _Constants(
        q=jnp.asarray(true.q),
        motion=(jnp.asarray(samples.q), jnp.asarray(samples.dq), jnp.asarray(samples.ddq)),
        W=W,
        Z=Z,
        efforts=jnp.asarray(efforts),
        deviations=(jnp.asarray(effort), jnp.asarray(position), jnp.asarray(step)),
        matrices=matrices,
        rows=rows,
    )
    return kept, jax.tree.map(jnp.asarray, constants)
