"""How much estimates from two logs of the same real robot differ, over what their intervals say.

``python benchmarks/coverage/real_logs.py FOLDER`` with the folders ``ur10e`` and ``kr300`` of their public logs in
FOLDER; what is absent is left out. Every pair of exciting motions is identified by the defaults, with rotors and
friction offsets. Nothing was chosen by these numbers.
"""

from __future__ import annotations

import sys
import time
from itertools import combinations
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
import scipy.stats
from threadpoolctl import threadpool_limits

from excite.identification.between_logs import LogScatter
from excite.identification.covariance import robust_covariance
from excite.identification.estimator import CONFIDENCE
from excite.identification.estimators.least_squares import weighted
from excite.identification.identification import Identification
from excite.identification.procedure import estimate_parameters
from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping
from excite.tasks.task import Task
from regressors.readers.library import load_robot
from regressors.robot.robot import Robot

HERE = Path(__file__).resolve().parent
UR10E = {
    "20sec": "ur-20_02_05-20sec_8harm.csv",
    "30sec": "ur-20_02_10-30sec_12harm.csv",
    "40sec": "ur-20_02_12-40sec_12harm.csv",
    "50sec": "ur-20_02_12-50sec_12harm.csv",
}
KR300 = {"A": "A.csv", "B": "B.csv"}
RATIOS = np.array([256.857, 267.429, 252.333, 221.0, 239.619, 154.323])  # of the KR300's gears


def main(folder: Path) -> None:
    """Every pair of both robots."""
    load_before, cases, absent = record.load(), [], []
    for name, make in (("ur10e", ur10e_logs), ("kr300", kr300_logs)):
        if not (folder / name).is_dir():
            absent.append(name)
            continue
        robot, logs = make(folder / name)
        with threadpool_limits(1):
            cases += [pair(name, robot, logs, chosen) for chosen in combinations(logs, 2)]
            if len(logs) > 2:
                cases.append(pair(name, robot, logs, tuple(logs)))
    missing = f"\n\nLeft out, their folders are absent: {', '.join(absent)}." if absent else ""
    record.save("real_logs", load_before, {"cases": cases}, text(cases) + missing, LIMITATIONS, folder=HERE)


def ur10e_logs(folder: Path) -> tuple[Robot, dict[str, Log]]:
    """The exciting motions of the UR10e."""
    mapping = read_mapping(HERE.parent / "identification" / "ur10e.yaml")
    return load_robot("ur10e"), {name: read_log(folder / file, None, mapping) for name, file in UR10E.items()}


def kr300_logs(folder: Path) -> tuple[Robot, dict[str, Log]]:
    """The two recordings of the KR300."""
    robot = load_robot(str(folder / "kr300.urdf"))
    logs = {}
    for name, file in KR300.items():
        table = np.loadtxt(folder / file, delimiter=",", skiprows=1)
        q = np.radians(table[:, 1:7])
        logs[name] = Log(file, f"kr300 {name}", robot.joint_names, table[:, 0], q, None, table[:, 13:19] * RATIOS)
    return robot, logs


def pair(name: str, robot: Robot, logs: dict[str, Log], chosen: tuple[str, ...]) -> dict[str, Any]:
    """Scatter between some logs."""
    wall, cpu = time.monotonic(), time.process_time()
    task = Task(name, joint_rotors=True, offset=True).changed(robot=robot)
    result = estimate_parameters(robot, task, [logs[log] for log in chosen])
    scatter = result.scatter
    assert scatter is not None
    friction, known = scatter.each.friction, np.isfinite(scatter.ratios)
    return {
        "robot": name,
        "logs": list(chosen),
        "parameters": int(known.sum()),
        "rms": scatter.rms,
        "rms_friction": _rms(scatter.ratios[friction & known]),
        "rms_others": _rms(scatter.ratios[~friction & known]),
        "within_percent": 100 * within(scatter),
        "exceeding": list(scatter.exceeding),
        "rms_newey_west": narrower(result),
        "wall": time.monotonic() - wall,
        "cpu": time.process_time() - cpu,
    }


def within(scatter: LogScatter) -> float:
    """Share of the parameters whose estimates agree with their mean within combined 99 % intervals."""
    known = np.isfinite(scatter.ratios)
    limit = scipy.stats.chi2.ppf(CONFIDENCE, scatter.counts[known] - 1)
    return float(np.mean(scatter.ratios[known] * (scatter.counts[known] - 1) < limit))


def narrower(result: Identification) -> float:
    """The same root mean square with covariances by Newey and West alone, as a comparison."""
    values, deviations = [], []
    for k in range(len(result.prepared)):
        rows = result.observations.rows(np.flatnonzero(result.observations.log == k))
        estimate = robust_covariance(weighted(rows), rows, "newey-west")
        values.append(estimate.values)
        deviations.append(estimate.deviation)
    b, s = np.array(values), np.array(deviations)
    mean = np.sum(b / s**2, axis=0) / np.sum(1 / s**2, axis=0)
    ratios = np.sum(((b - mean) / s) ** 2, axis=0) / (len(b) - 1)
    return _rms(ratios[np.isfinite(ratios)])


def _rms(ratios: np.ndarray) -> float:
    return float(np.sqrt(np.mean(ratios)))


def text(cases: list[dict[str, Any]]) -> str:
    """The table."""
    head = [
        "robot", "logs", "parameters", "scatter over stated (rms)", "friction", "others", "within 99 %",
        "Newey and West alone", "significant", "CPU s", "wall s",
    ]  # fmt: skip
    rows = [
        [
            c["robot"],
            " + ".join(c["logs"]),
            c["parameters"],
            f"**{c['rms']:.2f}**",
            f"{c['rms_friction']:.2f}",
            f"{c['rms_others']:.2f}",
            f"{c['within_percent']:.0f} %",
            f"{c['rms_newey_west']:.2f}",
            ", ".join(c["exceeding"]) or "-",
            f"{c['cpu']:.1f}",
            f"{c['wall']:.1f}",
        ]
        for c in cases
    ]
    return record.table(head, rows)


LIMITATIONS = (
    "Two robots, of which one gave four logs on three days and the other two logs of 10 s.",
    "Both logs of a pair are identified with the friction's presliding that fits both together.",
    "Parameters that are not identifiable from a log alone are left out of its pairs.",
    "Scatter over stated is one where the noise of each log explains all; 2 means intervals that are half as wide as "
    "estimates scatter between logs.",
)

if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit("expected one argument: the folder that holds ur10e and kr300")
    folder = Path(sys.argv[1])
    sys.argv[1] = "FOLDER"  # in the command that the results state
    main(folder)
