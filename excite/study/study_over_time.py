"""Study of how soon motions determine the parameters: entry point of command line and scripts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.designed_motion import DesignedMotion
from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction, announce
from excite.executors.unit_executor import SHORT, InThisProcess, UnitExecutor
from excite.executors.unit_executors import unit_executor
from excite.identification.given_logs import LogLike
from excite.identification.identification import Identification
from excite.identification.identify import identify
from excite.registry import built_in
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate
from excite.simulation.simulation import Simulation
from excite.study.estimates_over_time import estimates_over_time, instants, measured_again, values_again
from excite.study.time_study import TimeCourse, TimeStudy
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.numerical import numerical_work
from regressors.quantities import check

POINTS, BELOW = 100, 0.05
_TOLD = 10  # repetitions between two reports
_CHOSEN = ("cutoff", "delay")
_NOISE = 0.01  # of the torques, where no noise is given


@checked
@numerical_work(
    "the study",
    "rows that hardly move, or numbers of very different sizes are the likely cause: "
    "check the units of the log and `rows`",
)
def study_over_time(
    model: Any,
    logs: Sequence[LogLike] = (),
    *,
    designs: Sequence[DesignedMotion | str | Path] = (),
    trajectories: Sequence[str | Path] = (),
    simulation: Mapping[str, Any] | None = None,
    repeats: int = 0,
    below: float = BELOW,
    points: int = POINTS,
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
    designs : sequence of DesignedMotion or path
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
    LostWorkersError
        Worker processes end again and again, or the Dask scheduler went away.
    """
    for name, value in (("repeats", repeats), ("points", points), ("below", 100 * below)):
        check(name, value)
    if not logs and not designs:
        raise InputError("a study needs logs, or designs that it simulates (`designs`); given neither")
    if repeats and not designs:
        raise InputError("repetitions are simulated from designs (`designs`), but only logs are given")
    if repeats == 1 or repeats < 0:
        raise InputError(f"repeats must be 2 or more, or 0 for none, given {repeats}")
    if trajectories and not designs:
        raise InputError(
            "`trajectories` are simulated for the parameters of the first of the `designs`, but none is given"
        )
    if points < 2:
        raise InputError(f"points must be 2 or more, given {points}")
    study_prediction(points, repeats).check()
    options = {"estimator": "weighted", "choose": _CHOSEN, **options}
    played = [built_in("reader", "design")(one) if isinstance(one, str | Path) else one for one in designs]
    first = played[0] if played else None
    motions = [*((one, None) for one in played), *((played[0], Path(file)) for file in trajectories)]
    known = {name: value for name, value in (simulation or {}).items() if value is not None}
    seconds = _seconds([design for design, _ in motions], known, repeats, points)
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


def _seconds(designs: list[DesignedMotion], simulation: dict[str, Any], repeats: int, points: int) -> float:
    """Time of the motions of some designs, a few repetitions of each."""
    durations = [design.trajectory.duration for design in designs]
    joints = max((design.robot.n for design in designs), default=0)
    return study_seconds(durations, joints, simulation.get("rate", SimulationSettings().rate), points, repeats)


def _of_motion(
    model: Any,
    design: DesignedMotion,
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

    values = values_again(executor, run, how, result, design.trajectory, instants(result, points), repeats, told)
    return course.with_repetitions(values, notes), result


def _with_usual_noise(run: Simulation) -> tuple[SimulationSettings, tuple[str, ...]]:
    """The run's settings with 1 % of each joint's torque as noise."""
    noise = _NOISE * np.sqrt(np.mean(run.run.effort**2, axis=0))
    shown = ", ".join(f"{value:.3g}" for value in noise)
    note = f"simulated with torque noise of 1 % of each joint's torque: {shown} Nm (N)"
    return replace(run.settings, torque_noise=tuple(noise.tolist())), (note,)


_FEWEST = 10  # parameters: how many there are is not known yet
_COPIES = 6.0


def study_prediction(points: int, repeats: int) -> WorkPrediction:
    """Memory of a study."""
    option, value = ("points", points) if points >= repeats else ("repeats", repeats)
    rows = points * (1 + repeats)
    return WorkPrediction(
        "the study", (MemoryPart("estimates", rows, _FEWEST, FLOAT * _COPIES * _FEWEST * rows, option, value),)
    )


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
