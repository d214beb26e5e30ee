"""Servos of a real SO-101, exported to MuJoCo: how well the arm follows the commands of unseen logs there.

``python benchmarks/servo/export.py FOLDER``: FOLDER as of ``real_arm.py``.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
from pathlib import Path

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import mujoco
import numpy as np
import record
from plant import replay
from real_arm import ARM, TRAINING, UNSEEN, unpacked

import excite
from excite.identification.procedure import log_of
from excite.identification.servo_result import ServoResult
from excite.identification.servos import identify_servos, servo_motion
from excite.verification.verify_servos import verify_servos
from regressors.samples import Array


def errors(file: Path, result: ServoResult, log: Path) -> dict[str, Array]:
    """Root mean square errors of the motion of each joint [rad]: predicted, and in MuJoCo."""
    motion = servo_motion(log_of(log, result.robot, None, ()), result.robot)
    whole = mujoco.MjModel.from_xml_path(str(file))
    plain = mujoco.MjModel.from_xml_string(re.sub(r"<dcmotor [^>]*>", "", file.read_text(encoding="utf-8")))
    plain.dof_frictionloss += 0.75 * result.of("Fs")  # as the file says; the joints are all of the model
    found = {"excite verify": np.array([fit.position_error for fit in verify_servos(result, log).fits])}
    for name, model in {"MJCF": whole, "MJCF without dcmotor": plain}.items():
        path = replay(model, motion.log, motion.samples.dq[0])
        found[name] = np.sqrt(np.mean((path - motion.log.q) ** 2, axis=0))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    folder, before, rows, runs = parser.parse_args().folder, record.load(), [], {}
    sys.argv[1] = "FOLDER"  # in the command that the results state
    with tempfile.TemporaryDirectory() as target:
        logs = {name: unpacked(folder, name, Path(target)) for name in (*TRAINING, *UNSEEN)}
        result = identify_servos("so101", [logs[name] for name in TRAINING])
        file = Path(target) / "so101.xml"
        excite.export_model(result, "mjcf", file)
        for name in UNSEEN:
            runs[name] = errors(file, result, logs[name])
            for what, error in runs[name].items():
                excess = 100.0 * (error[:ARM].mean() / runs[name]["excite verify"][:ARM].mean() - 1.0)
                rows.append([name, what, *(f"{1e3 * x:.1f}" for x in (*error, error[:ARM].mean())), f"{excess:+.0f}"])
                print(*rows[-1], flush=True)
    head = ["unseen log", "simulated by", *result.robot.joint_names, "mean of the arm", "more [%]"]
    text = f"Errors of the motion under the commands of a log, root mean square [mrad]:\n\n{record.table(head, rows)}"
    limitations = (
        "One arm. What stands for the dead band and the load share in the MJCF was chosen on the two logs of the "
        "identification.",
        "Without dcmotor, as MuJoCo before 3.12 and MJX need it, 3/4 of the Stribeck friction is in the constant one.",
    )
    content = {name: {what: error.tolist() for what, error in each.items()} for name, each in runs.items()}
    record.save("servo_export", before, {"runs": content}, text, limitations)


if __name__ == "__main__":
    main()
