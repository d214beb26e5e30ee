"""Mechanisms with closed loops, and robots on a six-axis sensor: intervals, and torques that results predict.

``python benchmarks/whole_robots.py [--seeds 20]``: four-bar and parallelogram in MuJoCo, driven at the crank and
identified by the energy model, by the projected differential one, and by one that is told the torques of the closure at
every joint, as no robot measures them. Then robots whose wrench below the base Pinocchio computes, identified without
torques. Plain defaults, noise of the torques and of the wrench; each result predicts the torques of another motion.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "builders"))

import numpy as np
import record
from linkages import FOUR_BAR, PARALLELOGRAM, linkage, played, written
from pinocchio_chains import ground_wrenches, joint_torques
from public_arms import TREES

import excite
from excite.information.prior import prior_of
from excite.tasks.task import Task
from regressors.models.base import base_parameters
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot
from regressors.robot.symbolic.loops import loops_of
from regressors.samples import Array, Samples

NOISE = 0.05  # of the torques of linkages, which reach 3 to 6 Nm [Nm]
WRENCH = np.repeat([1.0, 0.2], 3)  # deviation of its noise [N, Nm]
BIAS = 0.01  # deviation of its bias, of the root mean square force and moment
LINKAGES = {"four-bar": (FOUR_BAR, "", 0.2, 2.2), "parallelogram": (PARALLELOGRAM, 'range="-0.8 1.8"', 0.5, 1.1)}
TOLD = "told the closure"
RIGID = Terms(rotor=False, coulomb=False, viscous=False)


def inside(result: Any) -> dict[str, bool]:
    """Whether each interval holds the described value, which was simulated; of what was chosen besides, zero."""
    target, base = result.target, result.target.base
    truth = dict(zip(base.names, prior_of(target.model, base, None).base_values(np.eye(base.rank)), strict=True))
    estimate = result.estimate
    off = np.abs(estimate.values - [truth.get(name, 0.0) for name in estimate.names])
    return dict(zip(estimate.names, (off <= estimate.half_width).tolist(), strict=True))


def off_by(found: Array, true: Array) -> float:
    """Relative error."""
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def told(name: str, log: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """The log of the tree that is left when the loop is cut, with what the closure does at every joint."""
    own = {joint: log[f"{joint}.closure"] + NOISE * rng.normal(size=log["time"].size) for joint in ("q2", "q3")}
    positions = {column: values for column, values in log.items() if not column.endswith(("closure", "effort"))}
    efforts = {"q1.effort": log["q1.effort"] + log["q1.closure"], **{f"{joint}.effort": x for joint, x in own.items()}}
    return positions | efforts


def drive_torque(robot: Robot, result: Any, samples: Samples) -> Array:
    """Torque at the crank by a result, ``N' tau`` of all joints that it has equations of."""
    target = result.target_of_instants
    rows = target.model.instants(samples)[:, target.base.index] @ result.coefficients
    if rows.size == samples.time.size:
        return np.asarray(rows)
    unit = replace(samples, dq=np.ones_like(samples.dq), ddq=0 * samples.ddq)
    return np.asarray(np.sum(rows.reshape(samples.q.shape) * loops_of(robot).rates(unit).dq, axis=1))


def linkages(seeds: int) -> list[dict[str, Any]]:
    """Every linkage by every model."""
    runs = []
    for name, (lengths, limits, middle, swing) in LINKAGES.items():
        text = linkage(name, lengths, limits=limits)
        with tempfile.TemporaryDirectory() as folder:
            robot = load_robot(written(Path(folder), name, text))
        tree = robot.replace(closures=(), passive=())
        other = played(lengths, text, 0.0, 977, middle=middle, swing=swing)
        along = excite.identify(Task(robot), other, choose=False).prepared[0]  # its motion, filtered
        for seed in range(seeds):
            log = played(lengths, text, NOISE, seed, middle=middle, swing=swing)
            given = {
                "energy": (Task(robot, model="energy"), log),
                "differential": (Task(robot), log),
                TOLD: (Task(tree), told(name, log, np.random.default_rng([seed, 1]))),
            }
            for model, (task, measured) in given.items():
                result = excite.identify(task, measured)
                error = off_by(drive_torque(robot, result, along.samples), along.measured[:, 0])
                runs.append({"robot": name, "model": model, "inside": inside(result), "error": error})
        print(name, flush=True)
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
    of_loops, of_wrench = linkages(seeds), on_a_plate(seeds)
    rows = []
    for name in LINKAGES:
        for model in ("energy", "differential", TOLD):
            some = [run for run in of_loops if (run["robot"], run["model"]) == (name, model)]
            rows.append([name, model, *_shares(some)])
    plates = []
    for name in dict.fromkeys(run["robot"] for run in of_wrench):
        some = [run for run in of_wrench if run["robot"] == name]
        spent = (f"{np.median([run[what] for run in some]):.1f}" for what in ("design", "cpu"))
        plates.append([name, *_shares(some), *spent])
    head = ["parameters", "inside [%]", "worst parameter [%]", "torque error [%]"]
    text = (
        f"Intervals of 99 % that hold the truth over {seeds} logs, and the median error of the torques of another "
        f"motion without noise.\n\nClosed loops:\n\n{record.table(['linkage', 'model', *head], rows)}\n\n"
        "A six-axis sensor below the base, no torques of joints:\n\n"
        f"{record.table(['robot', *head, 'design [CPU s]', 'identify [CPU s]'], plates)}"
    )
    record.save("whole_robots", before, {"loops": of_loops, "wrench": of_wrench}, text, LIMITATIONS)


def _shares(runs: list[dict[str, Any]]) -> list[str]:
    held = [each for run in runs for each in run["inside"].items()]
    by_name = {name: [holds for other, holds in held if other == name] for name, _ in held}
    error, mean = np.median([run["error"] for run in runs]), np.mean([holds for _, holds in held])
    worst = 100 * min(np.mean(each) for each in by_name.values() if len(each) == len(runs))  # not what some chose
    return [str(len(runs[0]["inside"])), f"{100 * mean:.1f}", f"{worst:.0f}", f"{100 * error:.2g}"]


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
