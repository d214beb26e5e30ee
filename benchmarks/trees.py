"""Designs of robots with several limbs that stand free: what balance costs, and what happens without it.

``python benchmarks/trees.py [--seeds 3]``: a quadruped on a narrow stand, a torso with two arms on wheels, and one on
two feet, once more with its waist and a hand, 24 joints. Each is designed with the limits of its joints and torques,
the floor, and its limbs apart from each other and from the body, once with its support polygon and once without.
Pinocchio says how far inside the polygon the zero-moment point stays at 2000 instants, and Coal how far apart the
nearest bodies are at 200. Mass and centre of what stands still are those of the URDF.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from dataclasses import dataclass
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
sys.path.append(os.path.join(os.path.dirname(__file__), "..", "tests", "builders"))

import numpy as np
import pinocchio as pin
import record
from coal_distances import clearance
from pinocchio_chains import chain_model, ground_wrenches
from public_arms import robots_folder

import excite
from constraints.balance import Balance
from excite.design.design import Design
from regressors.readers.library import load_robot
from regressors.robot.robot import Robot
from regressors.samples import Array

NEAREST = 4  # pairs of bodies that Coal judges
PART = record.HERE / "results" / "trees.part"  # finished runs, so that the same command after a kill goes on


@dataclass(frozen=True)
class Tree:
    """A robot, what it stands on in the frame of its base, and the options of its design."""

    name: str
    file: str
    base: str | None
    tips: tuple[str, ...]
    polygon: tuple[tuple[float, float], ...]  # x, y of its corners, counterclockwise [m]
    ground: float  # height of the ground [m]
    pedestal: float  # mass of the stand below it, beside that of the URDF [kg]
    options: dict[str, Any]


TREES = (
    Tree(
        "Go2 on a stand", "go2_description/urdf/go2.urdf", None, ("FL_calf", "FR_calf", "RL_calf", "RR_calf"),
        ((0.1, 0.08), (-0.1, 0.08), (-0.1, -0.08), (0.1, -0.08)), -0.5, 4.0,
        {"acceleration": (80.0,), "period": 2.0, "starts": 3},
    ),
    Tree(
        "TIAGo, two arms", "tiago_description/robots/tiago_dual.urdf", "torso_lift_link",
        ("arm_left_7_link", "arm_right_7_link"),
        ((0.216, 0.102), (0.062, 0.202), (-0.127, 0.102), (-0.127, -0.102), (0.062, -0.202), (0.216, -0.102)),
        -0.889, 0.0,
        {"acceleration": (10.0,), "period": 10.0, "starts": 1},
    ),
    Tree(
        "G1 on its feet, two arms", "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf", "torso_link",
        ("left_wrist_yaw_link", "right_wrist_yaw_link"),
        ((0.124, 0.149), (-0.046, 0.144), (-0.046, -0.144), (0.124, -0.149)), -0.836, 0.0,
        {"acceleration": (20.0,), "period": 4.0, "starts": 1},
    ),
    Tree(  # 24 joints, plain defaults: how long the search takes is the program's choice
        "G1 on its feet, waist, arms and a hand", "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf", "pelvis",
        ("right_hand_index_1_link", "right_hand_middle_1_link", "right_hand_thumb_2_link", "left_wrist_yaw_link"),
        ((0.12, 0.149), (-0.05, 0.144), (-0.05, -0.144), (0.12, -0.149)), -0.792, 0.0, {},
    ),
)  # fmt: skip


def standing(tree: Tree, path: str, robot: Robot) -> Balance:
    """The polygon, with mass and centre of all that no moving joint carries, in the pose zero."""
    model, own = pin.buildModelFromUrdf(path), chain_model(robot)
    data, carried = model.createData(), own.createData()
    pin.centerOfMass(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    pin.centerOfMass(own, carried, np.zeros(own.nq))
    base = data.oMf[model.getFrameId(tree.base)] if tree.base else pin.SE3.Identity()
    fixed = model.inertias[0]  # to the root, which Pinocchio does not count
    parts = [(data.mass[0], base.actInv(data.com[0])), (fixed.mass, base.actInv(fixed.lever))]
    parts += [(-carried.mass[0], carried.com[0]), (tree.pedestal, np.array([0.0, 0.0, tree.ground]))]
    mass = sum(m for m, _ in parts)
    x, y, z = sum(m * c for m, c in parts) / mass
    return Balance([(*corner, tree.ground) for corner in tree.polygon], mass, (x, y, z))


def inside(balance: Balance, robot: Robot, samples: Any) -> float:
    """Least distance of the zero-moment point from the edges, negative outside, by Pinocchio [m]."""
    ground, weight = np.array([0.0, 0.0, balance.polygon[0][2]]), -balance.stand_mass * robot.gravity
    w = ground_wrenches(robot, samples, origin=ground)
    w += np.concatenate([weight, np.cross(balance.stand_centre - ground, weight)])
    point, corners = np.column_stack([-w[:, 4], w[:, 3]]) / w[:, 2:3], np.array(balance.polygon)[:, :2]
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    return float(np.min(np.sum((point[:, None] - corners) * normals, axis=2)))


def nearest(design: Design) -> float:
    """Least distance by Coal of the pairs of bodies that come nearest, as the certificate has it [m]."""
    pairs = sorted((use for use in design.limits if use.quantity == "distance"), key=lambda use: use.extreme)[:NEAREST]
    poses: Array = design.trajectory.samples(np.linspace(0.0, design.trajectory.duration, 200)).q
    return min(clearance(design.moving, design.shape, use.label, q) for use in pairs for q in poses)


def run(tree: Tree, seed: int) -> list[dict[str, Any]]:
    """A seed with the support polygon, and without."""
    path = str(robots_folder() / tree.file)
    robot = load_robot(path, tree.base, tree.tips)
    balance, runs = standing(tree, path, robot), []
    for support in (balance, None):
        task = excite.Task(path, base_link=tree.base, tip=tree.tips, floor=tree.ground, seed=seed, support=support)
        cpu = time.process_time()
        design = excite.design_trajectory(task.changed(**tree.options, executor="serial"))
        cpu = time.process_time() - cpu
        times = np.linspace(0.0, design.trajectory.duration, 2000)
        content = {
            "robot": tree.name, "joints": robot.n, "seed": seed, "support": support is not None, "cpu": cpu,
            "search": design.provenance["cpu_seconds"], "parameters": design.base.rank, "feasible": design.feasible,
            "limits": len(design.limits), "condition_number": design.condition_number,
            "first": min(start.history[0] for start in design.starts),
            "log_det_per_sample": design.criteria["log_det_per_sample"],
            "inside": inside(balance, design.moving, design.trajectory.samples(times)), "apart": nearest(design),
        }  # fmt: skip
        runs.append(content)
    with PART.open("a", encoding="utf-8") as stream:
        stream.writelines(f"{json.dumps(each)}\n" for each in runs)
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    seeds, before = parser.parse_args().seeds, record.load()
    runs = [json.loads(line) for line in PART.read_text(encoding="utf-8").splitlines()] if PART.exists() else []
    done = {(each["robot"], each["seed"]) for each in runs}  # by an earlier call, which was interrupted
    for tree in TREES:
        for seed in range(seeds):
            runs += [] if (tree.name, seed) in done else run(tree, seed)
    rows = []
    for tree in TREES:
        for support in (True, False):
            some = [each for each in runs if (each["robot"], each["support"]) == (tree.name, support)]
            median = {key: float(np.median([each[key] for each in some])) for key in some[0] if key != "robot"}
            kept = sum(each["feasible"] for each in some)
            rows.append(
                [
                    tree.name, "yes" if support else "no", f"{median['parameters']:.0f}", f"{median['first']:.4g}",
                    f"{median['condition_number']:.4g}", f"{median['log_det_per_sample']:.3g}",
                    f"{kept} of {len(some)}, {median['limits']:.0f} each",
                    f"{1000 * min(each['inside'] for each in some):.1f}",
                    f"{1000 * min(each['apart'] for each in some):.1f}",
                    f"{median['search']:.1f}", f"{median['cpu']:.1f}",
                ]
            )  # fmt: skip
    head = ["robot", "`--support`", "parameters", "first guess", "cond(W)", "log det M"]
    head += ["certified", "inside [mm]", "apart [mm]", "search [CPU s]", "all [CPU s]"]
    text = (
        f"Medians of {seeds} seeds; the least of them for the zero-moment point (negative: the robot tips over) and "
        f"for the distance between bodies.\n\n{record.table(head, rows)}"
    )
    record.save("trees", before, {"runs": runs}, text, LIMITATIONS)
    PART.unlink()


LIMITATIONS = (
    "No rival: FloBaRoID, which designs motions of trees, is not on PyPI, and its own set-up was not tried. `first "
    "guess` is the best of the motions that the same searches began with.",
    "Wheels and feet are taken as points of a rigid ground; the stand of the quadruped is invented, 4 kg on a foot of "
    "20 cm by 16 cm, half a metre below it. Accelerations are chosen, since the files state none; the last robot has "
    "plain defaults, without such limits.",
    "CPU times are of `excite.design_trajectory`; with start-up and figures, the command takes some 6 s more for 24 "
    "joints. From minute to minute, the same work took up to 1.3 times as long on this machine.",
    "Mass and centre of what stands still are of the URDF in the pose zero, with heads and legs as they hang there.",
    "Coal judges the four pairs of bodies that the certificate has nearest, by the capsules of the design.",
)


if __name__ == "__main__":
    main()
