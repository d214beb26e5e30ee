"""Robots on a moving base: intervals, and torques that results predict.

``python benchmarks/on_moving_bases.py [--seeds 20]``: a Go2 that hangs on a spring, whose wrench is measured or not,
and one that falls freely, played by MuJoCo; the pose of the base, its IMU, joints and torques with noise, plain
defaults. Each result predicts the torques of another motion.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}

import record
from whole_robots import inside, shares  # which finds the builders of the tests

# ruff: isort: split
import numpy as np
from moving_bases import mapping, played
from public_arms import robots_folder

import excite

SECONDS = 8.0
CASES = {  # hung, and what its mapping has
    "hangs: pose, IMU, wrench": (True, {}),
    "hangs: pose, wrench": (True, {"imu": False}),
    "hangs: pose, IMU": (True, {"wrench": False}),
    "falls: pose, IMU": (False, {"wrench": False}),
    "falls: pose, IMU, free": (False, {"free": True}),
}


def runs_of(case: str, seeds: int) -> list[dict[str, Any]]:
    """Every log of a case."""
    hung, given = CASES[case]
    robots = robots_folder()
    assert robots is not None
    file = robots / "go2_description/urdf/go2.urdf"
    exact = played(file, hung=hung, seed=977, seconds=SECONDS, noise=0.0)
    layout = mapping(exact, **given)
    runs = []
    for seed in range(seeds):
        log = played(file, hung=hung, seed=seed, seconds=SECONDS)
        begin = time.process_time()
        result = excite.identify(str(file), log, mapping=layout)
        spent = time.process_time() - begin
        error = excite.verify(result, exact, mapping=layout).corrected_total.relative
        runs.append({"case": case, "inside": inside(result), "error": error, "cpu": spent})
        print(case, seed, f"{runs[-1]['error']:.2%}", f"{spent:.0f} s", flush=True)
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    seeds, before = parser.parse_args().seeds, record.load()
    runs = {case: runs_of(case, seeds) for case in CASES}
    rows = [[case, *shares(some), f"{np.median([run['cpu'] for run in some]):.1f}"] for case, some in runs.items()]
    head = ["parameters that show", "inside [%]", "worst parameter [%]", "torque error [%]", "identify [CPU s]"]
    text = (
        f"A Go2: intervals of 99 % that hold the truth over {seeds} logs, and the median error of torques, and of the "
        f"wrench where it is measured, along another motion without noise.\n\n{record.table(['base', *head], rows)}"
    )
    record.save("moving_bases", before, {"runs": [run for some in runs.values() for run in some]}, text, LIMITATIONS)


LIMITATIONS = (
    f"Simulated, {SECONDS:g} s at 250 Hz: noise of the pose of 0.2 mm and 2e-4, of the IMU of 2e-3 rad/s and 0.02 "
    "m/s^2, with biases of 0.01 rad/s and 0.05 m/s^2, of positions of 2e-5 rad, of torques of 2 %, of the wrench of "
    "0.5 %; no friction, one description, and clocks and places of the sensors are exact.",
    "Where no wrench is measured, the equations of the joints alone are used, and the base's own parameters hide; with "
    "`free` in the mapping those of the base are used beside them.",
    "Wrenches weigh more than torques in the errors of the first two cases.",
)


if __name__ == "__main__":
    main()
