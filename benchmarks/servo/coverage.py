"""How often 99 % intervals of servos hold the truth, with MuJoCo as the plant.

``python benchmarks/servo/coverage.py [--seeds 100-199]``: each seed is six servos of random parameters on the arm of
the SO-101, a delay, encoders of 4096 steps, and a log of 120 s at 50 Hz: of even seeds sums of sines and transitions
between poses, of odd ones steps and transitions between poses that are held for 1 to 4 s.
The factor by which intervals are widened was set on seeds 300 to 307, with sweeps and designs beside this motion.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from contextlib import suppress
from importlib.metadata import distribution
from pathlib import Path

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from plant import Truth, motion, plant, play, random_truth, resting

from excite.identification.servos import identify_servos
from excite.verification.verify_servos import verify_servos
from regressors.models.servo_response import QUANTITIES, RATIOS, SYMBOLS
from regressors.readers.library import load_robot
from regressors.samples import Array

URDF = "cmeel.prefix/share/example-robot-data/robots/so_arm_description/urdf/so101.urdf"
MIDDLE = np.array([0.0, -0.3, 0.3, 0.3, 0.0, 0.3])  # about which the joints move [rad]
DURATION, UNSEEN = 120.0, 30.0  # [s]
MOTIONS = (motion, resting)


def values_of(truth: Truth) -> Array:
    """True values of all quantities, shape (n, p); what the plant does not have is zero."""
    known = {name: getattr(truth, name) for name in ("K", "D", "J", "Fc", "L")}
    known |= {"b": -truth.b, "d": np.full(len(truth.K), truth.d)}
    return np.column_stack([known.get(symbol, np.zeros(len(truth.K))) for symbol in SYMBOLS])


def run(seed: int) -> dict[str, object]:
    """Intervals of one log, and the error of the motion of another."""
    robot, rng = load_robot("so101"), np.random.default_rng(seed)
    truth = random_truth(rng, robot.n)
    urdf = Path(str(distribution("example-robot-data").locate_file(URDF)))
    model = plant(urdf, robot.joint_names, truth)
    log, other = (
        play(model, robot.joint_names, truth, told(rng, robot.n, duration, MIDDLE), f"{seed} {duration:g} s")
        for told, duration in ((MOTIONS[seed % 2], DURATION), (motion, UNSEEN))
    )
    cpu = time.process_time()
    result = identify_servos(robot, log)
    cpu = time.process_time() - cpu
    verification = verify_servos(result, other)
    true = values_of(truth)
    ratio, of_ratio = result.ratios
    error, size = result.values - true, np.where(true == 0, 1.0, np.abs(true))
    return {
        "seed": seed,
        "inside": (np.abs(error) <= result.half_width).tolist(),
        "ratios inside": (np.abs(ratio - true[:, RATIOS] / true[:, :1]) <= of_ratio).tolist(),
        "known ratios": result.known_ratios.tolist(),
        "half_width": (result.half_width / size).tolist(),
        "error": (error / size).tolist(),
        "unseen": [fit.position_error for fit in verification.fits],
        "holds": verification.holds,
        "cpu": cpu,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="100-199", metavar="FIRST-LAST")
    first, last = map(int, parser.parse_args().seeds.split("-"))
    before, runs = record.load(), []
    with suppress(KeyboardInterrupt):  # what is there is kept
        for seed in range(first, last + 1):
            runs.append(run(seed))
            print(seed, f"{np.mean(runs[-1]['inside']):.3f} inside, {runs[-1]['cpu']:.1f} CPU s", flush=True)
    inside, half, error = (np.array([each[name] for each in runs]) for name in ("inside", "half_width", "error"))
    names, rows = load_robot("so101").joint_names, []
    for k, quantity in enumerate(QUANTITIES):
        shown = np.isfinite(half[..., k])
        width = np.median(half[..., k][shown]) if shown.any() else np.nan
        off = np.median(np.abs(error[..., k][shown])) if shown.any() else np.nan
        each = (f"{100 * value:.0f}" for value in inside[..., k].mean(axis=0))
        rows.append(
            [
                quantity.name,
                f"{100 * inside[..., k].mean():.1f}",
                *each,
                f"{100 * shown.mean():.0f}",
                f"{width:.2g}",
                f"{off:.2g}",
            ]
        )
    of_ratios, known = (np.array([each[name] for each in runs]) for name in ("ratios inside", "known ratios"))
    named = [QUANTITIES[k] for k in RATIOS]
    shares = zip(named, of_ratios.mean(axis=(0, 1)), known.mean(axis=(0, 1)), strict=True)
    ratios = [[f"{q.name} over stiffness", f"{100 * held:.1f}", f"{100 * share:.0f}"] for q, held, share in shares]
    by_motion = ", ".join(f"{100 * inside[number::2].mean():.1f} %" for number in range(2))
    unseen, cpu = (np.median([each[name] for each in runs]) for name in ("unseen", "cpu"))
    first_sentence = (
        f"{100 * inside.mean():.1f} % of {inside.size} intervals of 99 % hold the truth, in {len(runs)} logs of "
        f"{DURATION:g} s. {sum(bool(each['holds']) for each in runs)} of {len(runs)} results hold on another log, "
        f"whose motion they predict within {1e3 * unseen:.2g} mrad (median). {cpu:.1f} CPU s each (median)."
    )
    table = record.table(["quantity", "inside [%]", *names, "has an interval [%]", "half width", "error"], rows)
    units = "Half widths and errors are medians, relative to the truth; of what the plant does not have, in SI."
    second = (
        f"Of logs of sines and transitions, and of steps and holds: {by_motion} (the latter are the odd seeds). Ratios "
        "to the stiffness; known is what has half an interval of at most half the value:"
    )
    head = ["ratio", "inside [%]", "known [%]"]
    text = "\n\n".join([first_sentence, table, units, second, record.table(head, ratios)])
    record.save(
        "servo_coverage",
        before,
        {"runs": runs},
        text,
        [
            "Simulated servos without backlash, without friction "
            "that depends on load or speed, and without noise but the encoder's steps."
        ],
    )


if __name__ == "__main__":
    main()
