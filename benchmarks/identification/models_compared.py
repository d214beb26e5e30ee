"""Study 3: differential model, the same low-passed, and energy model with short and long windows, on the same data.

Each run of the IRp-6 is simulated once and measured many times; every model is identified from the very same logs.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from remeasured import remeasured
from threadpoolctl import threadpool_limits

from excite.design.optimisation import design_trajectory
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.tasks.task import Task
from excite.views.style import (
    BLUE,
    DARK,
    DPI,
    GREEN,
    LABEL,
    NOTE,
    PURPLE,
    VERMILLION,
    drawing_style,
    figure_of,
    log_scale,
)
from regressors.models.nominal import parameter_values
from regressors.readers.library import load_robot

HERE = Path(__file__).resolve().parent
MEASUREMENTS = 30
RATE, TORQUE_NOISE, COUNTS = 2000.0, 1.0, 4000.0  # Hz, Nm, per revolution of the motor
LOW_PASS, OFFSET = 10.0, 1.0  # Hz, Nm
ROBOT = load_robot("irp6")


@dataclass(frozen=True)
class Way:
    """A way to identify from a log."""

    name: str
    task: Task
    recipe: Recipe


@dataclass(frozen=True)
class Data:
    """A motion, and what its torques have beside white noise."""

    name: str
    designed_for: Task
    offset: float = 0.0


DIFFERENTIAL, SHORT = Task("irp6"), Task("irp6", model="energy")
LONG = Task("irp6", model="energy", window="long")
MODELS = (
    ("differential", DIFFERENTIAL, Recipe()),
    (f"differential, low-pass {LOW_PASS:g} Hz", DIFFERENTIAL, Recipe(low_pass=LOW_PASS)),
    ("energy, short windows (5 ms)", SHORT, Recipe()),
    ("energy, long windows", LONG, Recipe()),
)
SIGNALS = {"butterworth": "positions low-passed (default)", "differences": "three-point differences"}
WAYS = [
    Way(f"{name}; {said}", task, replace(recipe, signals=signals))
    for signals, said in SIGNALS.items()
    for name, task, recipe in MODELS
]
DATA = (
    Data("motion designed for the differential model", DIFFERENTIAL),
    Data("motion designed for the energy model, short windows", SHORT.changed(starts=30)),
    Data("motion designed for the differential model, torques with an offset", DIFFERENTIAL, OFFSET),
)


def logs_of(data: Data) -> tuple[list[Log], dict[str, float]]:
    """Measurements of one simulated run, and the true parameters."""
    motion = design_trajectory(data.designed_for.changed(robot=ROBOT)).trajectory
    settings = SimulationSettings(rate=RATE, encoder=(COUNTS,), torque_noise=(TORQUE_NOISE,))
    run = simulate_motion(ROBOT, data.designed_for, motion, settings)
    logs = [remeasured(run, COUNTS, TORQUE_NOISE, seed) for seed in range(MEASUREMENTS)]
    shifted = [replace(log, effort=np.asarray(log.effort) + data.offset) for log in logs]
    return shifted, dict(run.truth)


def found_by(way: Way, logs: list[Log], truth: dict[str, float]) -> dict[str, Any]:
    """Errors of one way's estimates."""
    began = time.process_time()
    results = [estimate_parameters(ROBOT, way.task, [log], way.recipe) for log in logs]
    target, estimates = results[0].target, [result.estimate for result in results]
    beta = parameter_values(target.model, target.base, truth)
    error = np.array([estimate.coefficients for estimate in estimates]) - beta
    stated = np.array([np.where(np.isfinite(e.deviation), e.deviation, np.nan) for e in estimates])
    inside = np.array([np.abs(x) <= e.half_width for x, e in zip(error, estimates, strict=True)])
    return {
        "way": way.name,
        "names": list(target.base.names),
        "true": beta.tolist(),
        "rms_error": np.sqrt(np.mean(error**2, axis=0)).tolist(),
        "mean_error": error.mean(axis=0).tolist(),
        "stated_deviation": np.nanmean(stated, axis=0).tolist(),
        "inside_99": float(inside.mean()),
        "unseen": sorted({name for estimate in estimates for name in estimate.unseen}),
        "condition_number": results[0].condition_number,
        "equations": int(results[0].observations.y.size),
        "recipe": results[0].recipe.to_dict(),
        "notes": [*results[0].prepared[0].notes, *results[0].estimate.notes],
        "cpu_seconds": (time.process_time() - began) / len(logs),
    }


HEAD = (
    "way", "cond(W)", "equations", "rms error, geometric mean", "largest", "of these the mean error",
    "rms error / stated deviation", "in 99 % intervals", "CPU s",
)  # fmt: skip


def row(found: dict[str, Any], best: float) -> list[object]:
    """One line of the first tables."""
    beta, rms, mean = (np.abs(found[key]) for key in ("true", "rms_error", "mean_error"))
    relative = 100 * rms / beta
    worst = int(np.argmax(relative))
    typical = float(np.exp(np.mean(np.log(relative))))
    ratio = rms / np.array(found["stated_deviation"])
    text = f"{typical:.3g} %"
    return [
        found["way"],
        f"{found['condition_number']:.4g}",
        found["equations"],
        f"**{text}**" if typical == best else text,
        f"{relative[worst]:.3g} % ({found['names'][worst]})",
        f"{100 * np.sqrt(np.mean((mean / rms) ** 2)):.0f} %",
        f"{float(np.exp(np.mean(np.log(ratio)))):.2f}",
        f"{100 * found['inside_99']:.1f} %",
        f"{found['cpu_seconds']:.2f}",
    ]


def typical(found: dict[str, Any]) -> float:
    """Geometric mean of the relative rms errors [%]."""
    return float(np.exp(np.mean(np.log(100 * np.abs(found["rms_error"]) / np.abs(found["true"])))))


def parameter_table(found: list[dict[str, Any]]) -> str:
    """Rms errors and stated deviations of every parameter, the default signals only."""
    shown = [one for one in found if SIGNALS["butterworth"] in one["way"]]
    head = ["parameter", "true", *(f"{one['way'].split(';')[0]}: rms error %, stated %" for one in shown)]
    rows = []
    for k, name in enumerate(shown[0]["names"]):
        true = shown[0]["true"][k]
        errors = [100 * one["rms_error"][k] / abs(true) for one in shown]
        cells = []
        for one, error in zip(shown, errors, strict=True):
            text = f"{error:.3g}"
            stated = 100 * one["stated_deviation"][k] / abs(true)
            cells.append(f"{f'**{text}**' if error == min(errors) else text}, {stated:.3g}")
        rows.append([name, f"{true:.4g}", *cells])
    return record.table(head, rows)


@drawing_style("screen")
def figure(found: list[dict[str, Any]], path: Path) -> None:
    """Relative rms errors of the parameters on the first data, default signals, a mark per model."""
    drawing = figure_of(9.5, 4.6, "IRp-6: errors of the parameters by model, same data")
    ax = drawing.subplots()
    shown = [one for one in found if SIGNALS["butterworth"] in one["way"]]
    lowest, highest = np.inf, 0.0
    for one, colour, mark in zip(shown, (BLUE, GREEN, VERMILLION, PURPLE), "os^D", strict=True):
        values = 100 * np.array(one["rms_error"]) / np.abs(one["true"])
        stated = 100 * np.array(one["stated_deviation"]) / np.abs(one["true"])
        ax.plot(values, mark, color=colour, label=one["way"].split(";")[0])
        ax.plot(stated, mark, color=colour, markerfacecolor="none", alpha=0.6)
        lowest, highest = min(lowest, values.min(), stated.min()), max(highest, values.max(), stated.max())
    log_scale(ax.yaxis, lowest / 1.4, highest * 1.4)
    ax.set_xticks(range(len(shown[0]["names"])), shown[0]["names"])
    ax.set_ylabel("rms error (filled), stated deviation (hollow) [%]", fontsize=LABEL, color=DARK)
    ax.legend(fontsize=NOTE)
    path.parent.mkdir(exist_ok=True)
    drawing.savefig(path, dpi=DPI)


LIMITATIONS = (
    f"IRp-6, joints 1-3, 13 parameters, 10 s at {RATE:g} Hz; white noise of {TORQUE_NOISE:g} Nm on every torque, "
    f"encoders of {COUNTS:g} counts on the motors whose steps lie elsewhere in each of {MEASUREMENTS} measurements; "
    "no tachometers",
    "one simulated run per motion: computed torque, friction that turns within 0.1 % of the largest velocity, no "
    "errors of the model: a real robot's friction is no two numbers",
    "rms error over the measurements, in percent of the true parameter; the mean error, in percent of the rms error, "
    "is what more measurements would not remove",
    "each model by the weighted estimator and the defaults of `excite identify` but for what the line says; covariance "
    "by Newey and West where residuals are correlated. The low-pass is applied to both sides of the equations, and "
    "rows are left out after it",
    f"the offset of {OFFSET:g} Nm on every torque is in no model; it stands for drift and bias of sensors",
    "three-point differences as in section 5.3 of the paper, at the rate of the log; its own were at longer intervals",
)


@threadpool_limits.wrap(limits=1)
def main() -> None:
    """All ways on all data."""
    before = record.load()
    parts, content = [], []
    for data in DATA:
        logs, truth = logs_of(data)
        found = [found_by(way, logs, truth) for way in WAYS]
        best = min(typical(one) for one in found)
        parts += [f"### {data.name[0].upper()}{data.name[1:]}", record.table(HEAD, [row(one, best) for one in found])]
        if data is DATA[0]:
            parts += ["Parameters one by one:", parameter_table(found)]
            figure(found, HERE / "results" / "models_compared.png")
            parts.append("![Errors by model](results/models_compared.png)")
        content.append({"data": data.name, "offset": data.offset, "ways": found})
        print(parts[-1], flush=True)
    record.save("models_compared", before, {"data": content}, "\n\n".join(parts), LIMITATIONS, folder=HERE)


if __name__ == "__main__":
    main()
