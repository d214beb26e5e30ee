"""Whether a precision that was asked for comes true, and what counts as about zero.

An IRp-6 experiment for 5 % is designed, simulated with white noise, all runs in one recording, and identified with
plain defaults, many times: how often does every half-width keep to what was allowed? The same where friction holds the
drives over a break-away distance, with one run fewer, and with each run as a log of its own, whose scatter the
intervals then allow for. ``--resume`` goes on from the repetitions that are done.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import record

import excite
from excite.information import half_widths
from excite.information.prior import prior_of
from excite.storage.codec import content_of
from excite.tasks.robot_of_task import robot_and_task

ROBOT, SHARE, NOISE = "irp6", 0.05, 1.0
BREAKAWAYS = (1e-4, 3e-4, 1e-3)  # [rad]
REPETITIONS, OF_FEWER, OF_LOGS = 50, 20, 8
ROBOTS = {"irp6": 1.0, "panda": 0.1, "ur10e": 0.1}
THRESHOLDS = (0.01, 0.1, 0.2, 0.33, 0.5)
PARTS = Path(__file__).parent / "results" / "precision.part.json"
SERIAL = excite.Search(executor="serial")


def repetition(design: excite.Design, seed: int, runs: int, apart: bool, breakaway: float | None) -> dict[str, Any]:
    """Half-widths of one simulated experiment over the allowed ones, and whether the truth is inside each interval."""
    options: dict[str, Any] = {"noise": NOISE, "rate": design.task.output.rate, "breakaway": breakaway}
    if apart:
        logs: Any = [excite.simulate(design, seed=1000 * seed + k, **options) for k in range(runs)]
    else:
        logs = excite.simulate(design, seed=1000 * seed, periods=runs, **options)
    estimate = excite.identify(design.robot, logs, design=design).estimate
    base = design.target.base
    truth = np.nan_to_num(prior_of(design.target.model, base, None).base_values(np.eye(base.rank)))  # offsets are zero
    place = [estimate.names.index(name) for name in base.names]
    half, value = estimate.half_width[place], estimate.values[place]
    allowed = np.array([p.allowed or np.inf for p in design.precision.parameters])  # nothing is asked of offsets
    predicted = np.array([p.half_width for p in design.precision.parameters])
    return {
        "use": float(np.max(half / allowed)),
        "over_predicted": np.round(half / predicted, 3).tolist(),
        "inside": int(np.sum(np.abs(value - truth) <= half)),
    }


def repeat(design: excite.Design, name: str, count: int, *options: Any) -> list[dict[str, Any]]:
    """Repetitions, each on disk as soon as it is done."""
    parts = json.loads(PARTS.read_text()) if PARTS.exists() else {}
    done = parts.get(name, [])
    for seed in range(len(done) + 1, count + 1):
        done.append(repetition(design, seed, *options))
        PARTS.write_text(json.dumps({**parts, name: done}))
        print(f"{name}: {len(done)} of {count}", end="\r", flush=True)
    return done


def about_zero(name: str, noise: float) -> list[list[object]]:
    """Parameters that count with their size, and runs of a 10 s design for 5 %, by what counts as about zero."""
    _, task = robot_and_task(name)
    task = task.changed(precision=SHARE, noise=(noise,), starts=2, executor="serial")
    task = task.changed(criterion="max-deviation", scale="precision")
    rows: list[list[object]] = []
    kept = half_widths.ABOUT_ZERO
    run = excite.design_trajectory(task).run_information
    value = np.abs(prior_of(run.target.model, run.target.base, None).base_values(np.eye(run.target.base.rank)))
    for threshold in THRESHOLDS:
        half_widths.ABOUT_ZERO = threshold
        scale = half_widths.precision_scales(run.precision, run.target)
        sized = int(np.sum(np.isfinite(scale) & (scale != value)))
        run = replace(run)  # with what is allowed now
        worst = run.target.base.names[int(np.argmax(run.deviation / run.allowed))]
        chosen = f"**{threshold:g}**" if threshold == kept else f"{threshold:g}"
        rows.append([name, chosen, f"{sized} of {np.sum(np.isfinite(scale))}", worst, run.fewest_runs()])
    half_widths.ABOUT_ZERO = kept
    return rows


def line(what: str, runs: int, done: list[dict[str, Any]], count: int) -> list[object]:
    """One line of the first table."""
    use = np.array([each["use"] for each in done])
    ratio = np.median([each["over_predicted"] for each in done], axis=0)
    inside = sum(each["inside"] for each in done) / (len(done) * count)
    met = f"{100 * np.mean(use <= 1.0):.0f} %"
    spread = f"{ratio.min():.2f} to {ratio.max():.2f}"
    return [what, runs, len(done), met, f"{np.median(use):.3f}", spread, f"{100 * inside:.1f} %"]


HEAD = (
    "experiment", "runs", "repetitions", "every half-width as narrow as allowed", "widest / allowed, median",
    "half-width / predicted, medians of parameters", "truth in the interval",
)  # fmt: skip
ZERO = ("robot", "about zero below", "counted with their size", "worst parameter", "runs of 10 s for 5 %")
LIMITATIONS = (
    f"{ROBOT}, {100 * SHARE:g} % of every described value, white torque noise of {NOISE:g} Nm at 100 Hz, positions "
    "exact, friction as described, or presliding over a break-away distance; identified with plain defaults",
    "one motion of one robot; a robot that sticks over more than 1e-3 rad was not tried",
    "with a log for each run the intervals allow for the scatter between few logs, so that the same runs do not do: "
    "record all runs in one log, or ask for more",
    "what is about zero: one design of two starts each, noise of 1 Nm (irp6) or 0.1 Nm (panda, ur10e), and no claim "
    "that other robots are alike",
)


def main() -> None:
    """The repetitions, then the thresholds."""
    before = record.load()
    if "--resume" not in sys.argv:
        PARTS.unlink(missing_ok=True)
    design = excite.design_for_precision(ROBOT, SHARE, noise=NOISE, search=SERIAL, report=print)
    forecast, count = design.precision, design.base.rank
    runs = forecast.runs
    experiments: dict[str, tuple[int, int, bool, float | None]] = {
        "as designed, Coulomb": (REPETITIONS, runs, False, None),
        **{f"as designed, break-away {d:g} rad": (REPETITIONS, runs, False, d) for d in BREAKAWAYS},
        "one run fewer, Coulomb": (OF_FEWER, runs - 1, False, None),
        f"one run fewer, break-away {BREAKAWAYS[-1]:g} rad": (OF_FEWER, runs - 1, False, BREAKAWAYS[-1]),
        "as designed, Coulomb, a log for each run": (OF_LOGS, runs, True, None),
    }
    rows, content = [], {}
    for name, (many, runs, *how) in experiments.items():
        done = repeat(design, name, many, runs, *how)
        rows.append(line(name, runs, done, count))
        content[name] = done
    zero = [row for name, noise in ROBOTS.items() for row in about_zero(name, noise)]
    found = f"{forecast.runs} runs of {forecast.seconds:g} s: {forecast.robot_seconds:g} s of robot time"
    text = f"{found}\n\n{record.table(HEAD, rows)}\n\n{record.table(ZERO, zero)}"
    print(text)
    result = {"precision": content_of(forecast)[0], "repetitions": content, "about_zero": zero}
    record.save("precision", before, result, text, LIMITATIONS)
    PARTS.unlink()


if __name__ == "__main__":
    main()
