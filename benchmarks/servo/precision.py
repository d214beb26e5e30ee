"""Whether `--precision` of servos keeps its promise, with MuJoCo as the plant.

``python benchmarks/servo/precision.py [--seeds 300-319] [--logs FOLDER]``: six servos of random parameters, as in
``coverage.py``. The runs that a design states are played, the servos identified from that one log, and their intervals
compared with what was allowed: after a first log of random motion (``servos``), and of usual servos of the stated
torques and speeds. FOLDER holds logs of a real SO-101, as for ``real_arm.py``: rehearsals of their commands are
compared with them.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from coverage import MIDDLE, URDF
from plant import ENCODER, RATE, motion, plant, play, random_truth
from real_arm import unpacked

import excite
from excite.identification.procedure import read_logs
from excite.identification.servos import identify_servos
from excite.logs.log import held_values
from excite.study.servo_precision import played
from regressors.models.servo_response import QUANTITIES, SYMBOLS
from regressors.readers.library import load_robot

ASKED = excite.PrecisionTarget(None, parameters={"K": 0.1, "D": 0.15})
JOINTS = ("1", "2", "3", "4")  # those whose scale the known masses show
LEADS = {"after a first log": True, "usual servos, error of the encoder": False}


def run(seed: int) -> list[dict[str, Any]]:
    """Half-widths over what was allowed, in both cases."""
    robot, rng, runs = load_robot("so101"), np.random.default_rng(seed), []
    truth, urdf = random_truth(rng, robot.n), Path(str(distribution("example-robot-data").locate_file(URDF)))
    model = plant(urdf, robot.joint_names, truth)
    first = play(model, robot.joint_names, truth, motion(rng, robot.n, 60.0, MIDDLE), f"{seed} first")
    known = identify_servos("so101", first)
    for name, lead in LEADS.items():
        begin = time.process_time()
        options = {"servos": known} if lead else {"noise": (ENCODER / np.sqrt(12),)}
        design = excite.design_for_precision("so101", ASKED, model="servo", joints=JOINTS, starts=4, **options)
        spent, forecast = time.process_time() - begin, design.precision
        assert forecast is not None
        rows = round(forecast.seconds * RATE)
        command = np.tile(design.sequence.at(np.arange(rows) / RATE)[0].q, (forecast.runs, 1))
        result = identify_servos("so101", play(model, robot.joint_names, truth, command, f"{seed} {name}"))
        width = {
            f"{quantity.name} {joint}": result.half_width[j, k]
            for j, joint in enumerate(robot.joint_names)
            for k, quantity in enumerate(QUANTITIES)
        }
        uses = {p.name: float(width[p.name] / p.allowed) for p in forecast.parameters if p.allowed is not None}
        runs.append(
            {"seed": seed, "case": name, "runs": forecast.runs, "seconds": forecast.robot_seconds, "cpu": spent,
             "met": forecast.met, "uses": uses}
        )  # fmt: skip
    return runs


def rows_of(runs: list[dict[str, Any]]) -> list[list[str]]:
    """One row a case."""
    rows = []
    for name in LEADS:
        some = [each for each in runs if each["case"] == name]
        worst = np.array([max(each["uses"].values()) for each in some])
        single = np.concatenate([list(each["uses"].values()) for each in some])
        promised = [each["met"] for each in some]
        rows.append(
            [name, f"{sum(promised)} of {len(some)}", f"{np.count_nonzero(worst[promised] <= 1.0)} of {sum(promised)}",
             f"{100 * np.mean(single <= 1.0):.1f}", f"{np.median(worst):.2f} (to {worst.max():.2f})",
             f"{np.median([each['seconds'] for each in some]):.0f}", f"{np.median([each['cpu'] for each in some]):.0f}"]
        )  # fmt: skip
    return rows


REAL = ("multisine", "step_response", "velocity_ramp", "chirp_sweep")
COMPARED = ("D", "J", "d")  # what logs of the real arm show of every joint: over the stiffness, and the delay


def of_real(folder: Path, target: Path) -> list[list[str]]:
    """Intervals that a rehearsal of the commands of real logs foretells, over those of the logs."""
    robot, rows = load_robot("so101"), []
    for names in (REAL[:2], REAL[2:]):
        paths = [unpacked(folder, name, target) for name in names]
        result = identify_servos("so101", paths)
        error, logs = np.array([fit.position_error for fit in result.fits]), []
        for k, log in enumerate(read_logs(paths, robot, None, (), lambda _: None)):
            command = held_values(log.time, log.command, np.arange(0.0, log.duration, 1 / RATE) + log.time[0])
            logs.append(played(result, command, error, k))
        foretold = identify_servos(robot, logs)
        cells = []
        for symbol in COMPARED:
            k = SYMBOLS.index(symbol)
            ours, real = ((r.half_width if symbol == "d" else r.ratio_half_width)[:5, k] for r in (foretold, result))
            cells.append(f"{np.median(ours / real):.2f} ({(ours / real).min():.2f} to {(ours / real).max():.2f})")
        rows.append([", ".join(names), *cells])
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="300-319", metavar="FIRST-LAST")
    parser.add_argument("--logs", type=Path, metavar="FOLDER", help="unpacked logs of the real SO-101")
    given = parser.parse_args()
    first, last = map(int, given.seeds.split("-"))
    before, runs = record.load(), []
    head = ["case", "promised", "kept", "intervals within [%]", "widest over allowed", "robot time [s]", "CPU [s]"]
    with ProcessPoolExecutor(2) as pool:
        for some in pool.map(run, range(first, last + 1)):
            runs += some
            print(*rows_of(runs), sep="\n", flush=True)
    text = (
        "Asked for: stiffness within 10 %, damping 15 %, of four joints that gravity or fast motion loads. Kept is a "
        "promise where every interval is as narrow as allowed, a share of the value that the promise was made "
        f"with:\n\n{record.table(head, rows_of(runs))}"
    )
    if given.logs is not None:
        sys.argv[-1] = "FOLDER"  # in the command that the results state
        head = ["logs of the real SO-101", "damping over stiffness", "inertia over stiffness", "delay"]
        with tempfile.TemporaryDirectory() as target:
            real = record.table(head, of_real(given.logs, Path(target)))
        text += (
            "\n\nHalf of the intervals of a rehearsal with the servos and errors of real logs, over those of the "
            f"logs, medians of the arm's five joints (and range):\n\n{real}"
        )
    limitations = [
        "Simulated servos, with the limitations of servo_coverage; errors of real servos are larger and last longer.",
        "Usual servos are those of the stated torques and speeds; the plant's differ from these by up to 1.5 times "
        "each way.",
    ]
    record.save("servo_precision", before, {"runs": runs}, text, limitations)


if __name__ == "__main__":
    main()
