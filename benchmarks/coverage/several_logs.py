"""Coverage across logs: friction, and in one case everything, changes from log to log at random."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import record
from experiments import Experiment
from repetition import Case, noisy

from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.logs.log import Log

LEVEL = 0.03


@dataclass(frozen=True)
class Several:
    """Logs of the same motion, whose true parameters differ.

    Parameters
    ----------
    logs : int
    friction, others : float
        Relative standard deviation of the friction coefficients, and of the other parameters, between logs.
    """

    logs: int
    friction: float = 0.0
    others: float = 0.0


SEVERAL = {
    "2 logs, nothing changes": Several(2),
    "2 logs, friction changes by 5 %": Several(2, 0.05),
    "3 logs, friction changes by 5 %": Several(3, 0.05),
    "5 logs, friction changes by 5 %": Several(5, 0.05),
    "3 logs, everything changes by 3 %": Several(3, 0.03, 0.03),
}


def several_logs(name: str, count: int, seed: int) -> dict[str, Any]:
    """Coverage of the parameters' mean, how wide intervals are, and how often the warning appears."""
    several, experiment = SEVERAL[name], Experiment()
    case = Case(name, experiment, level=LEVEL, recipe=Recipe(sign_width=0.0, cutoff=10.0))
    result = estimate_parameters(experiment.description, experiment.task, [experiment.log], case.recipe)
    W = experiment.regressor(experiment.log)
    began, cpu = time.monotonic(), time.process_time()
    inside, widths, warned = [], [], 0
    friction = np.array(
        [c.group == "friction" for c in (result.target.base.columns[k] for k in result.target.base.index)]
    )
    for k in range(count):
        rng = np.random.default_rng([seed, k, 1])
        sizes = np.where(friction, several.friction, several.others)
        logs = []
        for j in range(several.logs):
            change = experiment.truth * sizes * rng.normal(size=sizes.size)
            logs.append(replace(_changed(noisy(experiment.log, case, seed, k * 100 + j), W, change), source=f"log{j}"))
        estimate = estimate_parameters(experiment.description, experiment.task, logs, case.recipe)
        inside.append(np.abs(estimate.estimate.values - experiment.truth) <= estimate.estimate.half_width)
        widths.append(estimate.estimate.half_width)
        assert estimate.scatter is not None
        warned += bool(estimate.scatter.exceeding)
    cover = np.mean(inside, axis=0)
    return {
        "parameters": list(result.names),
        "coverage": cover.tolist(),
        "warned": warned / count,
        "width_over_one_log": float(np.median(np.median(widths, axis=0) / result_width(experiment, case, seed))),
        "wall": round(time.monotonic() - began, 1),
        "cpu": round(time.process_time() - cpu, 1),
    }


def result_width(experiment: Experiment, case: Case, seed: int) -> np.ndarray:
    """Half widths from one log alone."""
    log = noisy(experiment.log, case, seed, 0)
    return estimate_parameters(experiment.description, experiment.task, [log], case.recipe).estimate.half_width


def _changed(log: Log, W: np.ndarray, change: np.ndarray) -> Log:
    """The log of a robot with other parameters."""
    assert log.effort is not None
    return replace(log, effort=log.effort + (W @ change).reshape(log.effort.shape))


def several_text(results: list[dict[str, Any]]) -> str:
    """One line per case."""
    head = [
        "several logs",
        "repetitions",
        "coverage, mean",
        "worst",
        "warned",
        "width over that of one log",
        "CPU s",
        "wall s",
    ]
    rows = []
    for r in results:
        cover = np.array(r["coverage"])
        worst = int(np.argmin(cover))
        rows.append(
            [
                r["name"],
                r["repetitions"],
                f"{100 * cover.mean():.1f} %",
                f"**{100 * cover[worst]:.1f} %** {r['parameters'][worst]}",
                f"{100 * r['warned']:.0f} %",
                f"{r['width_over_one_log']:.1f}",
                f"{r['cpu']:.0f}",
                f"{r['wall']:.0f}",
            ]
        )
    return record.table(head, rows)
