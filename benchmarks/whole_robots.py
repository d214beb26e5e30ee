"""Mechanisms with closed loops, and robots on a six-axis sensor: intervals, and torques that results predict.

``python benchmarks/whole_robots.py [--seeds 20]``: a four-bar, a parallelogram, a delta and a quadruped on four ideal
feet in MuJoCo, identified by the energy model, by the projected differential one, and by one that is told the torques
of the closures at every joint, as no robot measures them. Then robots whose wrench below the base Pinocchio computes,
identified without torques. Plain defaults, noise of the torques and of the wrench; each result predicts the torques of
another motion.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "builders"))

import numpy as np
import record
from linkages import FOUR_BAR, PARALLELOGRAM, linkage, played, written
from mechanisms import delta, played as mechanism_played, quadruped
from pinocchio_chains import ground_wrenches, joint_torques
from public_arms import TREES

import excite
from excite.information.prior import prior_of
from excite.tasks.task import Task
from regressors.models.base import base_parameters
from regressors.models.differential import DifferentialModel
from regressors.models.partial import of_loops
from regressors.readers.library import load_robot
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

NOISE = 0.05  # of the torques of linkages, which reach 3 to 6 Nm [Nm]
WRENCH = np.repeat([1.0, 0.2], 3)  # deviation of its noise [N, Nm]
BIAS = 0.01  # deviation of its bias, of the root mean square force and moment
LINKAGES = {"four-bar": (FOUR_BAR, "", 0.2, 2.2), "parallelogram": (PARALLELOGRAM, 'range="-0.8 1.8"', 0.5, 1.1)}
PERIOD = 12.0  # of the motions of delta and quadruped [s]
TOLD = "told the closure"
RIGID = Terms(rotor=False, coulomb=False, viscous=False)


def inside(result: Any) -> dict[str, bool]:
    """Whether the interval of each parameter that shows holds the described value, or zero where none is described."""
    target, base = result.target, result.target.base
    truth = dict(zip(base.names, prior_of(target.model, base, None).base_values(np.eye(base.rank)), strict=True))
    estimate = result.estimate
    off = np.abs(estimate.values - np.nan_to_num([truth.get(name, 0.0) for name in estimate.names]))
    held = dict(zip(estimate.names, (off <= estimate.half_width).tolist(), strict=True))
    return {name: holds for name, holds in held.items() if name not in estimate.unseen}


def off_by(found: Array, true: Array) -> float:
    """Relative error."""
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def told(robot: Robot, log: dict[str, Array], beside: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """The log of the tree that is left when the loops are cut, with what the closures do at every joint."""
    positions, efforts = {"time": log["time"]}, {}
    for joint in robot.joint_names:
        positions[f"{joint}.position"] = (log | beside)[f"{joint}.position"]
        own = NOISE * rng.normal(size=log["time"].size)
        efforts[f"{joint}.effort"] = beside[f"{joint}.closure"] + log.get(f"{joint}.effort", own)
    return positions | efforts


def drive_torques(robot: Robot, result: Any, samples: Samples) -> Array:
    """Torques by a result, ``N' tau`` of all joints that it has equations of, shape (N, k)."""
    target, motion = result.target_of_instants, of_loops(robot)
    rows = target.model.instants(samples)[:, target.base.index] @ np.nan_to_num(result.coefficients)
    rows = rows.reshape(samples.time.size, -1)
    return np.asarray(rows if rows.shape[1] == len(motion.labels) else motion.torques(samples.q, rows))


def _of_linkage(name: str, noise: float, seed: int) -> tuple[dict[str, Array], dict[str, Array]]:
    """A log of a linkage, and what its closure does."""
    lengths, limits, middle, swing = LINKAGES[name]
    text = linkage(name, lengths, limits=limits)
    log = played(lengths, text, noise, seed, middle=middle, swing=swing)
    beside = {column: values for column, values in log.items() if column.endswith("closure")}
    return {column: values for column, values in log.items() if column not in beside}, beside


def loops(seeds: int) -> list[dict[str, Any]]:
    """Every robot with closed loops by every model."""
    runs = []
    texts = {name: linkage(name, lengths, limits=limits) for name, (lengths, limits, *_) in LINKAGES.items()}
    for name, text in {**texts, "delta": delta(), "quadruped": quadruped()}.items():
        with tempfile.TemporaryDirectory() as folder:
            robot = load_robot(written(Path(folder), name, text))
        play = _of_linkage if name in LINKAGES else partial(mechanism_played, period=PERIOD)
        tree = robot.replace(closures=(), passive=())
        along = excite.identify(Task(robot), play(name, 0.0, 977)[0], choose=False).prepared[0]  # its motion, filtered
        true = of_loops(robot).torques(along.samples.q, along.measured)
        for seed in range(seeds):
            log, beside = play(name, NOISE, seed)
            given = {
                "energy": (Task(robot, model="energy"), log),
                "differential": (Task(robot), log),
                TOLD: (Task(tree), told(robot, log, beside, np.random.default_rng([seed, 1]))),
            }
            for model, (task, measured) in given.items():
                begin = time.process_time()
                result = excite.identify(task, measured)
                spent = time.process_time() - begin
                error = off_by(drive_torques(robot, result, along.samples), true)
                runs.append({"robot": name, "model": model, "inside": inside(result), "error": error, "cpu": spent})
            print(name, seed, *(f"{run['error']:.2%}" for run in runs[-3:]), flush=True)
    return runs


def on_a_plate(seeds: int) -> list[dict[str, Any]]:
    """Robots whose base stands on a six-axis sensor."""
    runs = []
    for name, tree in {"panda": None, "ur10e": None, "go2": TREES[0]}.items():
        robot = load_robot(name) if tree is None else load_robot(tree.path, tip=tree.tips)
        cpu = time.process_time()
        search = excite.Search(starts=4, executor="serial")
        design = excite.design_trajectory(robot, model="base-wrench", search=search)
        cpu = time.process_time() - cpu
        moving = design.target.robot
        times = np.arange(0.0, design.trajectory.duration, 0.002)
        samples, other = design.trajectory.samples(times), excite.design_trajectory(robot, seed=1, search=search)
        along = other.trajectory.samples(np.linspace(0.0, other.trajectory.duration, 500))
        rigid, true = DifferentialModel(moving, RIGID), joint_torques(moving, along).ravel()
        of_torques, wrench = base_parameters(rigid), ground_wrenches(moving, samples)
        size = np.repeat(np.sqrt(np.sum(np.mean(wrench.reshape(-1, 2, 3) ** 2, axis=0), axis=1)), 3)
        Y = rigid.instants(along)[:, of_torques.index]
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            noisy = wrench + BIAS * size * rng.normal(size=6) + WRENCH * rng.normal(size=wrench.shape)
            log = excite.Log.from_arrays(times, samples.q, dq=samples.dq, wrench=noisy, joints=moving.joint_names)
            begin = time.process_time()
            result = excite.identify(robot, log, design=design)
            values = dict(zip(result.estimate.names, result.estimate.values, strict=True))
            error = off_by(Y @ [values[each] for each in of_torques.names], true)
            spent = time.process_time() - begin
            runs.append({"robot": name, "design": cpu, "cpu": spent, "inside": inside(result), "error": error})
        print(name, flush=True)
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    seeds, before = parser.parse_args().seeds, record.load()
    closed, of_wrench = loops(seeds), on_a_plate(seeds)
    rows = []
    for name, model in dict.fromkeys((run["robot"], run["model"]) for run in closed):
        some = [run for run in closed if (run["robot"], run["model"]) == (name, model)]
        rows.append([name, model, *shares(some), f"{np.median([run['cpu'] for run in some]):.1f}"])
    plates = []
    for name in dict.fromkeys(run["robot"] for run in of_wrench):
        some = [run for run in of_wrench if run["robot"] == name]
        spent = (f"{np.median([run[what] for run in some]):.1f}" for what in ("design", "cpu"))
        plates.append([name, *shares(some), *spent])
    head = ["parameters that show", "inside [%]", "worst parameter [%]", "torque error [%]"]
    text = (
        f"Intervals of 99 % that hold the truth over {seeds} logs, and the median error of the torques of another "
        "motion without noise.\n\nClosed loops:\n\n"
        f"{record.table(['robot', 'model', *head, 'identify [CPU s]'], rows)}\n\n"
        "A six-axis sensor below the base, no torques of joints:\n\n"
        f"{record.table(['robot', *head, 'design [CPU s]', 'identify [CPU s]'], plates)}"
    )
    record.save("whole_robots", before, {"loops": closed, "wrench": of_wrench}, text, LIMITATIONS)


def shares(runs: list[dict[str, Any]]) -> list[str]:
    """Of the intervals of some logs: parameters, mean and least share that hold, and the median error."""
    held = [each for run in runs for each in run["inside"].items()]
    by_name = {name: [holds for other, holds in held if other == name] for name, _ in held}
    error, mean = np.median([run["error"] for run in runs]), np.mean([holds for _, holds in held])
    worst = 100 * min(np.mean(each) for each in by_name.values() if len(each) == len(runs))  # not what some chose
    return [
        f"{np.median([len(run['inside']) for run in runs]):.0f}",
        f"{100 * mean:.1f}",
        f"{worst:.0f}",
        f"{100 * error:.2g}",
    ]


LIMITATIONS = (
    "Simulated: closures without play and friction, passive joints without friction, white noise of torques "
    "(0.05 Nm) and of the wrench (1 N, 0.2 Nm, with a bias of 1 %); positions exact.",
    "A model that is told the torques of the closure has one equation for each joint; no robot measures these.",
    "A larger bias of components that the motion does not tell from masses, such as the vertical force, passes the "
    "intervals of these masses, which allow for 2 %: of Go2, with 3 N and 0.5 Nm, those of two masses in most logs.",
    "The wrench has neither spin of rotors nor the weight of the base. Bodies are those of the descriptions.",
)


if __name__ == "__main__":
    main()
