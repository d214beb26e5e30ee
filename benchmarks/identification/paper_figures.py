"""What the figures of Kozlowski and Dutkiewicz (1996) show, computed here: ``paper_figures.py [NAME ...]``.

Every name is a file of ``results/paper_figures``, which ``docs/draw_paper.py`` draws; without a name all of them are
computed, one after the other. The robot is the simulated IRp-6.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from time import process_time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import friction_separate
import numpy as np
from friction_truth_case import TRUTH
from threadpoolctl import threadpool_limits

import excite
from excite.design.formulation import formulate
from excite.design.initial_guesses import candidates
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.readers.library import load_robot
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import Slope, Warm
from regressors.samples import Array

RESULTS = Path(__file__).resolve().parent / "results" / "paper_figures"
DIGITS, INSTANTS = 5, 161  # of a curve
FREE_SPACE: Mapping[str, Any] = {"floor": "none", "self_collision": False, "seed": 0}
#: Case, options, and the shapes of the paper's initial motion.
CASES: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "row of joint 1": ("Fig. 6", {"equations": ("1",), "start": ("quintic", "quintic", "cosine")}),
    "axes 1-3": ("", {"start": ("quintic", "quintic", "cosine")}),
    "energy, drive 2": ("Figs. 7 to 9", {"model": "energy", "drives": ("2",), "start": ("cosine",)}),
    "load, axes 1-5": ("Figs. 10 to 14", {"model": "load", "period": 6.4, "start": ("sines",)}),
}
NOISE, ENCODER, RATE = 1.0, 4000.0, 1000.0  # Nm, counts per revolution of the motor, Hz
TEMPERATURES = (20.0, 25.0, 30.0, 35.0, 40.0, 45.0)  # [deg C], [KD96] section 5.2 from 20 to 45
#: Assumed, since the paper prints no number: from 20 to 45 deg C friction of z1 falls by about a third.
COOL, FALL = 20.0, Slope(coulomb=-0.10, viscous=-0.35)  # [deg C], per K
SCHEDULE = excite.Schedule(warm_up=0.0, breakaways=2, longest=0.5)
REPEATS = 12  # of the friction runs, of the motion in Fig. 5, and of that of drive 2
WITHIN = 0.02  # of the truth: an estimate that stays there has settled


# --- motions and singular values -------------------------------------------------------------------------------------


def motions() -> dict[str, Any]:
    """Initial and optimal motions of section 5.4, and the singular values of both."""
    found = {}
    for name, (figures, options) in CASES.items():
        task = Task("irp6", **FREE_SPACE, **options)
        formulation = formulate(load_robot("irp6"), task)
        problem, target = formulation.problem, formulation.target
        first = problem.information.trajectory(candidates(problem, 0, np.random.default_rng(0))[0])
        design = excite.design_trajectory(task)
        times = target.model.times(task.trajectory.period, task.output.rate)
        shown = np.linspace(0.0, task.trajectory.period, INSTANTS)
        found[name] = {"figures": figures, "joints": list(target.robot.joint_names), "time": shown.tolist()}
        for which, trajectory in (("initial", first), ("optimal", design.trajectory)):
            W = target.model.selected(trajectory.samples(times), target.base.index)
            samples = trajectory.samples(shown)
            found[name][which] = {
                "q": samples.q.tolist(),
                "dq2": samples.dq[:, 1].tolist(),
                "ddq2": samples.ddq[:, 1].tolist(),
                "singular_values": np.linalg.svd(W, compute_uv=False).tolist(),
            }
    return found


# --- friction --------------------------------------------------------------------------------------------------------


def friction_curves() -> dict[str, Any]:
    """Figs. 2 to 4: mean torques of the runs at constant speed, break-away torques, and the curves that fit them."""
    return {drive: _fitted(drive, FrictionCurves(dict(TRUTH)), (None,)) for drive in TRUTH}


def temperature() -> dict[str, Any]:
    """Fig. 2: friction of the first drive from 20 to 45 deg C."""
    warm = Warm(TRUTH["z1"], COOL, FALL)
    return _fitted("z1", FrictionCurves({**TRUTH, "z1": warm}), TEMPERATURES)


def _fitted(drive: str, friction: FrictionCurves, temperatures: Sequence[float | None]) -> dict[str, Any]:
    """Runs of one drive, once for each temperature, and what is fitted to all of them together."""
    plan = excite.plan_friction("irp6", SCHEDULE, drives=[drive], seed=0)
    with tempfile.TemporaryDirectory() as folder:
        plan.save(Path(folder) / "plan")
        logs = [
            excite.simulate(
                Path(folder) / "plan" / f"{drive}.csv",
                controller="pd",
                bandwidth=10,
                friction=friction,
                torque_noise=NOISE,
                encoder=ENCODER,
                rate=RATE,
                seed=number,
                **({} if at is None else {"temperature": at}),
            )
            for number, at in enumerate(temperatures)
        ]
        fit = excite.fit_friction("irp6", logs, plan=plan)
    (found,) = fit.characteristics
    true, v = friction.curves[drive], np.linspace(0.0, 1.0, 81)[1:] * max(abs(p.speed) for p in found.points)
    speeds = np.concatenate([-v[::-1], v])
    at = [t for t in temperatures if t is not None] or [None]
    return {
        "form": found.fit.form.name,
        "points": [[p.speed, p.torque, p.temperature] for p in found.points],
        "speeds": speeds.tolist(),
        "temperatures": at,
        "fitted": [found.curve.at(t).torque(speeds).tolist() for t in at],
        "true": [true.at(t).torque(speeds).tolist() for t in at],
    }


def figure_5() -> dict[str, Any]:
    """Fig. 5: the first link's mass parameter over time, with friction known beforehand and without."""
    case = friction_separate
    schedule = case.Schedule(
        rate=case.RUNS_RATE, shortest=case.SHORTEST, longest=case.LONGEST, warm_up=0.0, breakaways=0
    )
    plans = case.plan_friction(case.ROBOT, schedule, drives=("z1",)).coordinates
    curves = case.Measured(case.TUSTIN, plans, REPEATS).curves
    poses = np.outer(np.deg2rad(case.POSES["z1"]), [1.0, 0.0, 0.0])
    lengths = case.shortest(poses, case.formulate(case.ROBOT, case.TASK).limits)
    motion, task = case.Moves(poses, lengths, float(lengths.sum())), case.TASK.changed(drives=("z1",), model="energy")
    settings = case.SimulationSettings(rate=case.RATE, breakaway="auto")
    run = case.simulate_motion(case.ROBOT, task, motion, settings, friction=FrictionCurves(case.TUSTIN))
    time, paths = np.linspace(0.0, motion.duration, INSTANTS), {"separate": [], "all at once": []}
    for seed, known in enumerate(curves):
        log = case.remeasured(run, case.COUNTS, case.TORQUE_NOISE, seed)
        for way, friction in (("separate", known), ("all at once", None)):
            result = case.estimate_parameters(case.ROBOT, task, [log], case.Recipe(), friction=friction)
            instants, values = case.recursive(result.observations, every=4).history
            column = values[:, result.estimate.names.index("X1")]
            paths[way].append(np.interp(time, instants, column, left=np.nan, right=np.nan))
    true = case.parameter_values(result.target.model, result.target.base, dict(run.truth))
    return {
        "time": time.tolist(),
        "true": float(true[result.estimate.names.index("X1")]),
        "estimates": {way: [_numbers(path) for path in found] for way, found in paths.items()},
    }


def drive_2() -> dict[str, Any]:
    """Section 5.1: the second drive alone on splined polynomials of fifth order, by the differential model."""
    case = friction_separate
    task = case.TASK.changed(drives=("z2",))
    target = target_of(case.ROBOT, task, 0.0)
    poses = target.motion.offset + np.outer(np.deg2rad(case.POSES["z2"]), target.motion.matrix[:, 0])
    lengths = case.shortest(poses, case.formulate(case.ROBOT, case.TASK).limits)
    motion = case.Moves(poses, lengths, float(lengths.sum()))
    run = case.simulate_motion(case.ROBOT, task, motion, case.SimulationSettings(rate=case.RATE))
    true = case.parameter_values(target.model, target.base, dict(run.truth))
    estimates, settled = [], []
    for seed in range(REPEATS):
        log = case.remeasured(run, case.COUNTS, case.TORQUE_NOISE, seed)
        result = case.estimate_parameters(case.ROBOT, task, [log], case.Recipe())
        instants, values = case.recursive(result.observations, every=4).history
        outside = np.abs(values - true) > WITHIN * np.abs(true)
        last = [np.flatnonzero(column)[-1] + 1 if column.any() else 0 for column in outside.T]
        settled.append([instants[k] if k < len(instants) else np.nan for k in last])
        estimates.append(result.estimate)
    error = np.array([estimate.coefficients for estimate in estimates]) - true
    return {
        "names": list(target.base.names),
        "expressions": list(target.base.expressions),
        "true": true.tolist(),
        "seconds": motion.duration,
        "rms_error": np.sqrt(np.mean(error**2, axis=0)).tolist(),
        "stated_deviation": np.mean([estimate.deviation for estimate in estimates], axis=0).tolist(),
        "settled": np.median(settled, axis=0).tolist(),
    }


# --- verification ----------------------------------------------------------------------------------------------------


def verification() -> dict[str, Any]:
    """Figs. 16 and 17: torques of the third joint, and simulated positions of the first, on a log that is new."""
    design = excite.design_trajectory("irp6", seed=0)
    other = excite.design_trajectory("irp6", seed=1, criterion="logdet")
    log, unseen = (
        excite.simulate(each, encoder=ENCODER, torque_noise=NOISE, seed=seed)
        for seed, each in enumerate((design, other), 1)
    )
    check = excite.verify(excite.identify("irp6", log, design=design), unseen)
    q, replay = check.motion, check.replay
    some = np.linspace(0, len(check.time) - 1, INSTANTS * 2).astype(int)
    few = np.linspace(0, len(q.time) - 1, INSTANTS).astype(int)
    return {
        "time": check.time[some].tolist(),
        "measured": check.measured[some, 2].tolist(),
        "predicted": check.predicted[some, 2].tolist(),
        "relative": [torque.relative for torque in check.torques],
        "motion_time": q.time[few].tolist(),
        "position": q.q[few, 0].tolist(),
        "simulated": replay.q[few, 0].tolist(),
        "horizon": check.horizon,
        "rms_position": [motion.error for motion in check.motions],
    }


# --- files -----------------------------------------------------------------------------------------------------------


def _numbers(values: Array) -> list[float | None]:
    """Values of a curve; None where there is none yet."""
    return [float(value) if np.isfinite(value) else None for value in values]


def _rounded(content: Any) -> Any:
    """The same with as many digits as a figure shows; None for what is not finite."""
    if isinstance(content, Mapping):
        return {key: _rounded(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_rounded(value) for value in content]
    if isinstance(content, float):
        return float(f"{content:.{DIGITS}g}") if np.isfinite(content) else None
    return content


FIGURES: Mapping[str, Callable[[], dict[str, Any]]] = {
    "motions": motions,
    "friction": friction_curves,
    "temperature": temperature,
    "figure-5": figure_5,
    "drive-2": drive_2,
    "verification": verification,
}


@threadpool_limits.wrap(limits=1)
def main() -> None:
    """Compute what is named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FIGURES))
    RESULTS.mkdir(parents=True, exist_ok=True)
    for name in parser.parse_args().names or FIGURES:
        began = process_time()
        content = FIGURES[name]()
        command = f".venv/bin/python benchmarks/identification/paper_figures.py {name}"
        made = {"command": command, "date": datetime.now(UTC).date().isoformat()}
        file = RESULTS / f"{name}.json"
        beside = file.with_suffix(".tmp")
        beside.write_text(json.dumps(_rounded({**made, **content}), separators=(",", ":")) + "\n", encoding="utf-8")
        beside.replace(file)
        print(f"{name}: {process_time() - began:.0f} s of processor time in this process, {file.stat().st_size} bytes")


if __name__ == "__main__":
    main()
