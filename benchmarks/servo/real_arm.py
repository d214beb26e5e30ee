"""Servos of a real SO-101 identified from two logs, verified on six others.

``python benchmarks/servo/real_arm.py FOLDER``: FOLDER holds NAME.control.csv.gz and NAME.state_motor.csv.gz of the logs
below, from github.com/isaac-sim2real/sage (Apache-2.0).
"""

from __future__ import annotations

import argparse
import gzip
import os
import sys
import tempfile
import time
from pathlib import Path

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record

from excite.identification.servo_result import MotionFit
from excite.identification.servos import identify_servos
from excite.verification.verify_servos import verify_servos

TRAINING = ("chirp_sweep", "friction_gravity")
UNSEEN = (
    "step_response", "multisine", "velocity_ramp", "static_holding", "hold_under_gravity", "prbs_excitation",
)  # fmt: skip
ARM = 5  # joints before the gripper


def unpacked(folder: Path, name: str, target: Path) -> Path:
    """Folder of one log, as the repository publishes it."""
    place = target / name
    place.mkdir()
    for kind in ("control", "state_motor"):
        (place / f"{kind}.csv").write_bytes(gzip.decompress((folder / f"{name}.{kind}.csv.gz").read_bytes()))
    return place


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    folder, before, rows, runs = parser.parse_args().folder, record.load(), [], []
    sys.argv[1] = "FOLDER"  # in the command that the results state
    with tempfile.TemporaryDirectory() as target:
        logs = {name: unpacked(folder, name, Path(target)) for name in (*TRAINING, *UNSEEN)}
        cpu = time.process_time()
        result = identify_servos("so101", [logs[name] for name in TRAINING])
        cpu = time.process_time() - cpu
        for name in UNSEEN:
            fits = verify_servos(result, logs[name]).fits
            runs.append({"unseen": name, "fits": list(map(vars, fits))})
            rows.append([name, *(_mrad(fit) for fit in fits), *_means(fits[:ARM])])
    names = [fit.joint for fit in fits]
    head = ["unseen log", *names, "mean of the arm", "delayed command", "command"]
    title = (
        f"Errors of the motion predicted from the commands alone, root mean square [mrad], after {cpu:.0f} CPU s of "
        f"identification from {' and '.join(TRAINING)}"
    )
    text = f"{title}:\n\n{record.table(head, rows)}"
    limitations = (
        "One arm with the masses of its URDF. The logs of the identification and hold_under_gravity were looked "
        "at while the model was chosen, the others were not.",
        "In hold_under_gravity, the wrist presses on something from 36 to 47 s, most likely the table: no servo "
        "explains that, and the shoulder sticks elsewhere afterwards.",
        "The delayed command is that with the best delay of each joint in hindsight, up to 0.3 s.",
    )
    content = {"values": result.values.tolist(), "half_width": result.half_width.tolist(), "cpu": cpu, "runs": runs}
    record.save("servo_real", before, content, text, limitations)


def _mrad(fit: MotionFit) -> str:
    return f"{1e3 * fit.position_error:.1f}"


def _means(fits: tuple[MotionFit, ...]) -> list[str]:
    names = ("position_error", "delayed_error", "command_error")
    return [f"{1e3 * np.mean([getattr(fit, name) for fit in fits]):.1f}" for name in names]


if __name__ == "__main__":
    main()
