"""A simulated run that is measured again and again: what each measurement gives, wherever it is computed."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.problem_identity import PACKAGES
from excite.errors import LostWorkersError
from excite.executors.dask_starts import check_versions
from excite.executors.unit_executor import LostUnit, UnitExecutor
from excite.identification.estimation import estimate_parameters
from excite.identification.identification import Identification
from excite.logs.log import Log
from excite.simulation.measured import joint_log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulation import Simulation
from excite.timecourse.estimates_over_time import values_over_time
from excite.trajectories.family import Trajectory
from regressors.errors import InputError
from regressors.samples import Array

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
