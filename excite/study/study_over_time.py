"""Study of how soon motions determine the parameters: entry point of command line and scripts."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.design import Design
from excite.design.design_json import load_design
from excite.design.executors.dask_cluster import check_versions, unit_executor, versions_of
from excite.design.executors.unit_executor import SHORT, InThisProcess, LostUnit, UnitExecutor
from excite.errors import LostWorkersError
from excite.identification.covariance import divisors
from excite.identification.identification import Identification
from excite.identification.identify import identify
from excite.identification.procedure import LogLike, estimate_parameters
from excite.logs.log import Log
from excite.simulation.sensors import joint_log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate
from excite.simulation.simulation import Simulation
from excite.study.repetitions import LIKELY_CAUSE, check_enough
from excite.study.time_study import TimeCourse, TimeStudy
from excite.tasks.further_settings import StudySettings
from excite.trajectories.family import Trajectory
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.numerical import numerical_work, one_thread
from regressors.quantities import check
from regressors.samples import Array, Index
from regressors.work_prediction import FLOAT, announce, check_memory

_TOLD = 10  # repetitions between two reports
_CHOSEN = ("cutoff", "delay")
_NOISE = 0.01  # of the torques, where no noise is given


@checked
@numerical_work("the study", LIKELY_CAUSE)
def study_over_time(
    model: Any,
    logs: Sequence[LogLike] = (),
    *,
    designs: Sequence[Design | str | Path] = (),
    trajectories: Sequence[str | Path] = (),
    simulation: Mapping[str, Any] | None = None,
    repeats: int = StudySettings.repeats,
    below: float = StudySettings.below,
    points: int = StudySettings.points,
    executor: str | UnitExecutor = "process",
    workers: int | None = None,
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> TimeStudy:
    """Estimates, intervals and condition numbers over the growing time of several motions, as in [KD96] Fig. 15.

    Parameters
    ----------
    model : RegressorModel, Robot, Task or str
        See `identify`.
    logs : sequence of Log, Simulation or path
        Each is a motion of its own.
    designs : sequence of Design or path
        Motions that are simulated first.
    trajectories : sequence of path
        Files of other motions, in the format of trajectory.csv, that are simulated like the first design and for its
        parameters.
    simulation : mapping of str to value, optional
        Options of `simulate`, such as `rate` and `encoder`; `torque_noise` is 1 % of each joint's torque if not given.
    repeats : int
        Number of times that each simulated run is measured with other noise; 0 for none.
    below : float
        Share of their magnitude that deviations are to fall below.
    points : int
        Number of instants.
    executor : str or UnitExecutor
        Where repetitions are computed, with the same numbers: ``process``, which is this process where the study is
        predicted to take less than 10 s, ``serial``, ``dask://HOST:PORT``, ``dask-file:PATH`` or ``dask-local[:N]``.
        The 10 s are those of `repeat_experiment`; they were not measured for studies, and neither was the memory of
        the workers, each of which holds a copy of the run.
    workers : int, optional
        Processes of this machine; one per core if not given.
    progress : callable
        Called with a description of each step.
    **options
        Of `identify`, such as `cutoff`, `mapping` and `estimator`, weighted or least-squares. Parameters are not
        chosen if not asked for by `choose`, so that all motions have the same.

    Returns
    -------
    TimeStudy

    Raises
    ------
    InputError
        Neither logs nor designs, numbers out of range, what `identify` refuses, or Dask not reachable.
    excite.errors.LostWorkersError
        Worker processes end again and again, or the Dask scheduler went away.
    """
    for name, value in (("repeats", repeats), ("points", points), ("below", 100 * below)):
        check(name, value)
    if not logs and not designs:
        raise InputError("a study needs logs, or designs that it simulates (`designs`); given neither")
    if repeats and not designs:
        raise InputError("repetitions are simulated from designs (`designs`), but only logs are given")
    if repeats == 1:
        raise InputError(f"repeats must be 2 or more, or 0 for none, given {repeats}")
    if trajectories and not designs:
        raise InputError(
            "`trajectories` are simulated for the parameters of the first of the `designs`, but none is given"
        )
    if points < 2:
        raise InputError(f"points must be 2 or more, given {points}")
    estimates = points * (1 + repeats)
    check_memory("the study", FLOAT * _COPIES * estimates, f"{estimates:.3g} estimates", "lower `points` or `repeats`")
    options = {"estimator": "weighted", "choose": _CHOSEN, **options}
    played = [load_design(one) if isinstance(one, str | Path) else one for one in designs]
    first = played[0] if played else None
    motions = [*((one, None) for one in played), *((played[0], Path(file)) for file in trajectories)]
    known = {name: value for name, value in (simulation or {}).items() if value is not None}
    durations, joints = [one.trajectory.duration for one, _ in motions], max((one.robot.n for one in played), default=0)
    seconds = study_seconds(durations, joints, known.get("rate", SimulationSettings().rate), points, repeats)
    announce("the study", seconds)
    units = unit_executor(executor, workers)
    if executor == "process" and seconds < SHORT:
        units = InThisProcess()
    studied = [
        _of_motion(model, design, file, known, repeats, points, units, progress, options) for design, file in motions
    ]
    for log in logs:
        progress(f"identifying from {getattr(log, 'source', log)}")
        result = identify(model, log, design=first, **options)
        studied.append((estimates_over_time(result, result.observations.logs[0], points), result))
    robot = studied[0][1].robot
    return TimeStudy(robot.name, robot.sha256(), tuple(course for course, _ in studied), below)


def _of_motion(
    model: Any,
    design: Design,
    file: Path | None,
    simulation: dict[str, Any],
    repeats: int,
    points: int,
    executor: UnitExecutor,
    progress: Callable[[str], None],
    options: dict[str, Any],
) -> tuple[TimeCourse, Identification]:
    """Time course of a simulated run of a design, or of another motion of its joints, and of its repetitions."""
    name = design.name if file is None else str(file)
    progress(f"simulating {name}")
    run = simulate(design, trajectory=file, approach_and_return=False, **simulation)
    how, notes = (run.settings, ()) if "torque_noise" in simulation else _with_usual_noise(run)
    log = measured_again(run, how, 0)
    progress(f"identifying from {name}")
    result = identify(model, log, design=design, **options)
    course = estimates_over_time(result, name, points)
    notes = (*notes, *run.outcome.failures)
    if not repeats:
        return replace(course, notes=notes), result

    def told(done: int) -> None:
        if done % _TOLD == 0:
            progress(f"{name}: repetition {done} of {repeats}")

    again = run, how, result, design.trajectory, instants(result, points), versions_of(executor)
    values = values_again(executor, again, repeats, told)
    return course.with_repetitions(values, notes), result


def _with_usual_noise(run: Simulation) -> tuple[SimulationSettings, tuple[str, ...]]:
    """The run's settings with 1 % of each joint's torque as noise."""
    noise = _NOISE * np.sqrt(np.mean(run.run.effort**2, axis=0))
    shown = ", ".join(f"{value:.3g}" for value in noise)
    note = f"simulated with torque noise of 1 % of each joint's torque: {shown} Nm (N)"
    return replace(run.settings, torque_noise=tuple(noise.tolist())), (note,)


_COPIES = 60.0  # numbers of an estimate, of which there are some copies


_SIMULATED = 2e-5  # seconds of each sample and joint of a simulation
_FIRST = 3e-3  # seconds of the choices of the first measurement, for each joint to the third power
_ROW, _POINT = 5e-7, 7e-6  # seconds of each row, and of each instant, of one measurement, for each pair of joints


def study_seconds(durations: list[float], joints: int, rate: float, points: int, repeats: int) -> float:
    """Time of the simulated motions of a study on one core [s]; right within a factor of three.

    The units that it grows with are the numbers of the regressor, rows times joints times joints, and those of a
    triangular factor at each instant. Logs add the time of their identification.
    """
    samples = rate * sum(durations)
    measurement = (_ROW * samples + _POINT * points * len(durations)) * joints**2
    first = _SIMULATED * samples * joints + _FIRST * len(durations) * joints**3
    return float(first + (1 + repeats) * measurement)


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
    values[:, ~np.isfinite(estimate.values)] = np.nan
    reference, growing = result.reference, growing_factors(observations.matrix, _ends(result, time))
    return TimeCourse(
        name=name,
        names=estimate.names,
        units=estimate.units,
        time=time - observations.time[0],
        values=values,
        deviation=np.where(np.isfinite(values), deviation, np.inf),
        quantile=_quantile(result),
        condition_number=np.array([_condition_number(R) for R in growing]),
        reference=np.full(len(estimate.names), np.nan) if reference is None else reference.values,
        reference_kind="description" if reference is None else reference.kind,
    )


def instants(result: Identification, count: int) -> Array:
    """Evenly spaced instants of a result's rows, the last one at the end, shape (count,) [s]."""
    time = result.observations.time
    return np.asarray(np.linspace(time[0], time[-1], count + 1)[1:])


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


_log = logging.getLogger(__name__)


#: What all measurements of a simulated run have in common: the run, the settings of the sensors, the result from the
#: first measurement, whose choices the others keep, the commanded motion, the instants up to which the parameters are
#: estimated [s], and the packages that a process elsewhere must have in the same version.
MeasuredRun = tuple[Simulation, SimulationSettings, Identification, Trajectory, Array, dict[str, str]]


def measured_again(run: Simulation, settings: SimulationSettings, number: int) -> Log:
    """Log of a simulated run as another measurement of it would be."""
    own = replace(settings, seed=settings.seed + number)
    log = joint_log(run.robot, run.run, own, np.random.default_rng(own.seed))
    log = replace(log, source=f"measurement {number}", truth=run.log.truth, saturated=run.log.saturated)
    return replace(log, sha256=log.identity)


def values_again(executor: UnitExecutor, common: MeasuredRun, count: int, progress: Callable[[int], None]) -> Array:
    """Estimates over time from further measurements of a run, shape (count, k, b)."""
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
    check_enough(len(found), count)
    return np.array([found[index] for index in sorted(found)])


def _values(common: MeasuredRun, number: int) -> Array:
    run, settings, result, commanded, time, versions = common
    check_versions(versions)
    log = measured_again(run, settings, number)
    with one_thread():
        again = estimate_parameters(
            result.robot, result.task, [log], result.recipe, commanded=commanded, friction=result.friction
        )
        return _solutions(again, time)[0]
