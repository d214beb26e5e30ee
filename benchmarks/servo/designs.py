"""What motions show of servos, with MuJoCo as the plant: random ones, sweeps made by hand, and designs.

``python benchmarks/servo/designs.py [--seeds 200-205]``: each seed is six servos of random parameters, as in
``coverage.py``, that are identified from a log of 69 s of each motion, at 50 Hz in steps of an encoder.
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import distribution
from itertools import repeat
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from coverage import MIDDLE, URDF, values_of
from plant import RATE, motion, plant, play, random_truth

import excite
from excite.identification.servos import identify_servos
from excite.tasks.installation import Installation
from excite.verification.verify_servos import verify_servos
from regressors.models.servo_response import QUANTITIES, SYMBOLS
from regressors.readers.library import load_robot
from regressors.samples import Array

DURATION, UNSEEN = 69.0, 30.0  # [s]
HELD = (0.2, 0.0, -0.05, 0.1)  # mass [kg] and its place in the frame of the moving jaw [m]
COMPARED = ("K", "D", "J", "Fc", "b", "d", "L")  # what the plant has


def sweeps(n: int) -> Array:
    """A chirp, slow reversals and steps, as the logs of a real SO-101 have them: 0.15 rad about one pose."""
    time = np.arange(round(DURATION / 3 * RATE)) / RATE
    length, phase = DURATION / 3, np.linspace(0.0, np.pi, n, endpoint=False)
    chirp = np.sin(2 * np.pi * (0.1 * time + 1.95 * time**2 / length)[:, None] + phase)  # 0.1 to 4 Hz
    slow = np.sin(2 * np.pi * np.linspace(0.05, 0.15, n) * time[:, None] + phase)
    rng = np.random.default_rng(0)
    steps = np.repeat(rng.uniform(-1.0, 1.0, (round(length), n)), round(RATE), axis=0)
    return np.asarray(MIDDLE + 0.15 * np.concatenate([chirp, slow, steps]))


MASS = {"joints": ("1", "2", "3", "4", "5"), "payload": HELD}
DESIGNS: dict[str, dict[str, Any]] = {
    "design of the condition number": {"criterion": "condition", "harmonics": 5, "stops": False},
    "default without stops": {"stops": False},
    "default": {},
    "default at the stated speed": {"velocity_scaling": 1.0},
    "default with a mass in hand": MASS,
    "default at the stated speed with a mass in hand": {"velocity_scaling": 1.0, **MASS},
}


def designed(**options: Any) -> Array:
    """A design of all joints or of some, played for as long as the other motions last."""
    design = excite.design_trajectory("so101", model="servo", seed=0, starts=8, **options)
    assert design.feasible, design.broken
    motion = design.sequence.at(np.arange(round(design.sequence.duration * RATE)) / RATE)
    return np.resize(motion[0].q, (round(DURATION * RATE), design.robot.n))


def run(seed: int, commands: dict[str, Array]) -> list[dict[str, object]]:
    """Intervals and errors of one set of servos, from each motion."""
    robot, rng = load_robot("so101"), np.random.default_rng(seed)
    truth, urdf = random_truth(rng, robot.n), Path(str(distribution("example-robot-data").locate_file(URDF)))
    commands = {"random": motion(rng, robot.n, DURATION, MIDDLE), **commands}
    unseen, runs, true = motion(rng, robot.n, UNSEEN, MIDDLE), [], values_of(truth)
    size = np.where(true == 0, 1.0, np.abs(true))
    for name, command in commands.items():
        held = DESIGNS.get(name, {}).get("payload", ())
        model = plant(urdf, robot.joint_names, truth, held)
        log, other = (
            play(model, robot.joint_names, truth, each, f"{seed} {name} {len(each)}") for each in (command, unseen)
        )
        result = identify_servos("so101", log, installation=Installation(payload=held or None))
        runs.append(
            {
                "seed": seed,
                "motion": name,
                "known": (result.half_width <= 0.5 * np.abs(true)).tolist(),
                "inside": (np.abs(result.values - true) <= result.half_width).tolist(),
                "half_width": (result.half_width / size).tolist(),
                "error": (np.abs(result.values - true) / size).tolist(),
                "unseen": [fit.position_error for fit in verify_servos(result, other).fits],
            }
        )
    return runs


def shown(values: Array) -> str:
    """A median in per cent; a dash for what is unknown in most cases."""
    middle = 100 * float(np.median(values))
    return f"{middle:.2g}" if middle < 1e4 else "-"


def rows_of(runs: list[dict[str, object]]) -> tuple[list[list[str]], list[list[str]]]:
    """Of each motion: medians of half widths and errors of each quantity, and the stiffness of each joint."""
    by_quantity, by_joint = [], []
    for name in dict.fromkeys(str(each["motion"]) for each in runs):
        some = [each for each in runs if each["motion"] == name]
        known, inside, half, error = (
            np.array([each[part] for each in some]) for part in ("known", "inside", "half_width", "error")
        )
        places = [SYMBOLS.index(symbol) for symbol in COMPARED]
        cells = [f"{shown(half[..., k])} ({shown(error[..., k])})" for k in places]
        unseen = 1e3 * np.median([each["unseen"] for each in some])
        of_all = [f"{100 * part[..., places].mean():.0f}" for part in (known, inside)]
        by_quantity.append([name, *of_all, *cells, f"{unseen:.2g}"])
        by_joint.append([name, *(shown(half[:, j, 0]) for j in range(half.shape[1]))])
    return by_quantity, by_joint


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="200-205", metavar="FIRST-LAST")
    first, last = map(int, parser.parse_args().seeds.split("-"))
    before, runs, robot = record.load(), [], load_robot("so101")
    commands = {"sweeps by hand": sweeps(robot.n), **{name: designed(**options) for name, options in DESIGNS.items()}}
    with ProcessPoolExecutor(2) as pool:
        for some in pool.map(run, range(first, last + 1), repeat(commands)):
            runs += some
            print(*rows_of(some)[0], sep="\n", flush=True)
    by_quantity, by_joint = rows_of(runs)
    names = [next(q.name for q in QUANTITIES if q.symbol == symbol) for symbol in COMPARED]
    head = ["motion of 69 s", "known [%]", "inside [%]", *names, "unseen motion [mrad]"]
    texts = [
        "Half of the 99 % intervals, and errors in brackets, in per cent of the truth, medians of all joints and of "
        f"{last - first + 1} sets of servos; known is what has half an interval of at most half the truth:",
        record.table(head, by_quantity),
        "Half of the intervals of the stiffness of each joint [%], medians:",
        record.table(["motion", *robot.joint_names], by_joint),
    ]
    record.save(
        "servo_designs",
        before,
        {"runs": runs},
        "\n\n".join(texts),
        [
            "Simulated servos, with the limitations of servo_coverage.",
            "Designs are the best of 8 starts; the stated speed is 4.7 rad/s, of which the default uses 0.4. One run "
            "of the default lasts 68.6 s, with the slow part and that with stops; without them it is repeated.",
            "The mass in hand is a point that the hand holds rigidly. The gripper does not move in these designs; the "
            "unseen motion moves it, and asks for more torque than some servos have with the mass.",
        ],
    )


if __name__ == "__main__":
    main()
