"""Course of an estimate over the growing time of its log, also of logs that are measured again and again."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.problem_identity import PACKAGES
from excite.errors import LostWorkersError
from excite.executors.dask_starts import check_versions
from excite.executors.unit_executor import LostUnit, UnitExecutor
from excite.identification.covariance import divisors
from excite.identification.estimation import estimate_parameters
from excite.identification.identification import Identification
from excite.logs.log import Log
from excite.simulation.sensors import joint_log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulation import Simulation
from excite.study.time_study import TimeCourse
from excite.trajectories.family import Trajectory
from regressors.errors import InputError
from regressors.samples import Array, Index

METHODS = ("weighted", "least-squares")
_SINGULAR = 1e-12  # smallest over largest singular value of columns of unit length


def estimates_over_time(result: Identification, name: str, count: int) -> TimeCourse:
    """Estimates and 99 % intervals of a result from the rows up to each of several instants.

    ``beta(t) = R_W(t)^-1 z(t)`` with ``[R_W z; 0 r]`` the triangular factor of ``[W y] / sigma`` up to t, sigma the
    noise of each equation over the whole log. The deviations are those of the whole log, as stated, times
    ``sqrt(diag((W'W)^-1))(t)`` over its value at the end: how correlated residuals are is taken from the whole log.
    """
    estimate, observations = result.estimate, result.observations
    if estimate.method not in METHODS:
        raise InputError(
            f"estimates over time are made by the estimators {', '.join(METHODS)}, not by {estimate.method}"
        )
    if len(observations.logs) != 1:
        raise InputError(f"estimates over time are made of one log each, given {len(observations.logs)}")
    time = instants(result, count)
    values, unscaled = _solutions(result, time)
    with np.errstate(invalid="ignore", divide="ignore"):
        deviation = unscaled * (estimate.deviation / unscaled[-1])
    seen = np.isfinite(estimate.values)
    deviation[:, ~seen] = np.inf
    values[:, ~seen] = np.nan
    reference = result.reference
    return TimeCourse(
        name=name,
        names=estimate.names,
        units=estimate.units,
        time=time - observations.time[0],
        values=values,
        deviation=np.where(np.isfinite(values), deviation, np.inf),
        quantile=_quantile(result),
        condition_number=_condition_numbers(observations.matrix, _ends(result, time)),
        reference=np.full(len(estimate.names), np.nan) if reference is None else reference.values,
        reference_kind="description" if reference is None else reference.kind,
    )


def instants(result: Identification, count: int) -> Array:
    """Evenly spaced instants of a result's rows, the last one at the end, shape (count,) [s]."""
    time = result.observations.time
    return np.asarray(np.linspace(time[0], time[-1], count + 1)[1:])


def values_over_time(result: Identification, time: Array) -> Array:
    """Estimates alone from the rows up to each instant, shape (K, p)."""  # time (K,)
    return _solutions(result, time)[0]


def _ends(result: Identification, time: Array) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Number of rows up to each instant."""
    rounding = 1e-9 * float(np.ptp(result.observations.time))
    return np.searchsorted(result.observations.time, time + rounding, side="right")


def _solutions(result: Identification, time: Array) -> tuple[Array, Array]:
    """Values and ``sqrt(diag((W'W)^-1))`` of the weighted rows up to each instant, both shape (K, p)."""
    observations = result.observations
    weight = 1 / divisors(result.estimate)[observations.group]
    rows = np.column_stack([observations.matrix, observations.y]) * weight[:, None]
    size = np.linalg.norm(rows, axis=0)
    size[size == 0] = 1.0
    solved = [_solution(R) for R in growing_factors(rows / size, _ends(result, time))]
    values, unscaled = (np.array(x) for x in zip(*solved, strict=True))
    return values * size[-1] / size[:-1], unscaled / size[:-1]


def _solution(R: Array) -> tuple[Array, Array]:
    p = R.shape[1] - 1
    W, z = R[:p, :p], R[:p, p]
    if W.shape[0] == p:
        U, s, V = np.linalg.svd(W)
        if s[-1] > _SINGULAR * s[0]:
            inverse = V.T / s
            return inverse @ (U.T @ z), np.linalg.norm(inverse, axis=1)
    return np.full(p, np.nan), np.full(p, np.inf)


def _condition_numbers(W: Array, ends: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Array:
    return np.array([_condition_number(R) for R in growing_factors(W, ends)])


def _condition_number(R: Array) -> float:
    sigma = np.linalg.svd(R, compute_uv=False) if R.shape[0] == R.shape[1] else np.zeros(1)
    return float(sigma[0] / sigma[-1]) if sigma[-1] > 1e-13 * sigma[0] else np.inf


def _quantile(result: Identification) -> float:
    """Half-width over deviation, alike for all parameters."""
    estimate = result.estimate
    seen = np.isfinite(estimate.deviation) & (estimate.deviation > 0)
    return float((estimate.half_width[seen] / estimate.deviation[seen])[0]) if np.any(seen) else np.nan


def growing_factors(A: Array, ends: Index) -> Iterator[Array]:
    """``R_k`` with ``R_k' R_k = A[:e_k]' A[:e_k]`` for every end ``e_k``, each from the one before and the new rows.

    All rows are read once: ``[R_{k-1}; A[e_{k-1}:e_k]] = Q R_k``.
    """  # A (m, p); ends (k,)
    R, begin = np.zeros((0, A.shape[1])), 0
    for end in ends:
        if end > begin:
            R, begin = np.asarray(np.linalg.qr(np.concatenate([R, A[begin:end]]), mode="r")), int(end)
        yield R


_FEWEST = 2  # measurements that have a scatter
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """What all measurements of a simulated run have in common."""

    run: Simulation
    settings: SimulationSettings  # of the sensors
    result: Identification  # from the first measurement, whose choices the others keep
    commanded: Trajectory
    time: Array  # (k,) instants [s] up to which the parameters are estimated
    versions: dict[str, str]  # packages that a process elsewhere must have in the same version


def measured_again(run: Simulation, settings: SimulationSettings, number: int) -> Log:
    """Log of a simulated run as another measurement of it would be."""
    own = replace(settings, seed=settings.seed + number)
    log = joint_log(run.robot, run.run, own, np.random.default_rng(own.seed))
    known = run.log.truth, run.log.saturated
    log = replace(log, source=f"measurement {number}", truth=known[0], saturated=known[1])
    return replace(log, sha256=log.identity)


def values_again(
    executor: UnitExecutor,
    run: Simulation,
    settings: SimulationSettings,
    result: Identification,
    commanded: Trajectory,
    time: Array,
    count: int,
    progress: Callable[[int], None],
) -> Array:
    """Estimates over time from further measurements of a run, shape (count, k, b)."""
    versions = {} if executor.shares_disk else {name: version(name) for name in PACKAGES}
    common = MeasuredRun(run, settings, result, commanded, time, versions)
    found: dict[int, Array] = {}
    try:
        with closing(executor.run(_values, common, range(1, count + 1))) as results:
            for index, values in results:
                if isinstance(values, LostUnit):
                    _log.warning("repetition %d is left out: %s", index + 1, values.reason)
                    continue
                found[index] = values
                progress(len(found))
    except LostWorkersError as error:
        remedy = "nothing of the study is kept: repeat it with fewer `workers`, or with another `executor`"
        raise LostWorkersError(error.args[0], remedy) from error
    if len(found) < _FEWEST:
        raise InputError(
            f"repetitions: {len(found)} of {count} are left, since workers ended; repeat with fewer `workers`, or with "
            "another `executor`"
        )
    return np.array([found[index] for index in sorted(found)])


def _values(common: MeasuredRun, number: int) -> Array:
    check_versions(common.versions)
    log, result = measured_again(common.run, common.settings, number), common.result
    with threadpool_limits(1):  # on matrices of this size more threads only wait for each other
        again = estimate_parameters(
            result.robot,
            result.task,
            [log],
            result.recipe,
            commanded=common.commanded,
            friction=result.friction,
        )
        return values_over_time(again, common.time)
