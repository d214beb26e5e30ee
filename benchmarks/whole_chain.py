"""From a URDF to a verdict by plain defaults, for public arms on which no default was set.

A design of two starts is played twice by a simulated robot whose bodies differ from the description by up to 15 % each,
with Coulomb and viscous friction and white noise in proportion to the torques of each joint; the first log is
identified, the second verified. The robot is right, so that no verdict may be against it.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from dataclasses import replace
from importlib.metadata import distribution
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}

import numpy as np
import record

import excite
from excite.identification.result import reference_of
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves

_ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
ARMS = {
    "UR3": ("ur_description/urdf/ur3_robot.urdf", None, "wrist_3_link"),
    "Kinova Jaco": ("kinova_description/robots/kinova.urdf", None, "j2s6s200_link_6"),
    "xArm 7": ("xarm_description/urdf/xarm7.urdf", None, "link7"),
    "Baxter, left": ("baxter_description/urdf/baxter.urdf", "left_arm_mount", "left_hand_link"),
    "Z1": ("z1_description/urdf/z1.urdf", "link00", "link06"),
    "TIAGo with torso": ("tiago_description/robots/tiago.urdf", None, "arm_7_link"),
    "TIAGo Pro, right": ("tiago_pro_description/robots/tiago_pro.urdf", "torso_lift_link", "arm_right_tool_link"),
    "PR2 with torso": ("pr2_description/urdf/pr2.urdf", None, "r_wrist_roll_link"),
    "TALOS, right": ("talos_data/robots/talos_full_v2.urdf", "torso_2_link", "arm_right_7_link"),
    "iCub, left": ("icub_description/robots/icub.urdf", "chest", "l_hand"),
    "Romeo, right": ("romeo_description/urdf/romeo.urdf", None, "r_wrist"),
    "Centauro": ("centauro_description/urdf/centauro.urdf", "torso_2", "arm1_6"),
    "G1, left with waist": ("g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf", None, "left_wrist_yaw_link"),
    "Allegro finger": ("allegro_hand_description/urdf/allegro_left_hand.urdf", None, "link_3.0"),
    "Solo 12 leg": ("solo_description/robots/solo12.urdf", None, "HR_LOWER_LEG"),
    "Alexander leg": ("alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf", None, "RIGHT_FOOT"),
    "SO-100": ("so_arm_description/urdf/so100.urdf", None, "jaw"),
}
ACCELERATION, RATE = 6.0, 200.0  # [rad/s^2 or m/s^2], [Hz]
COULOMB, VISCOUS, NOISE = 0.3, 0.2, 0.03  # of the standard deviation of each torque without friction; per rad/s


def outcome(name: str, seed: int) -> dict[str, Any]:
    """Design, two simulated logs, identification and verification of one arm."""
    path, base, tip = ARMS[name]
    file = str(distribution("example-robot-data").locate_file(f"{_ROBOTS}/{path}"))
    chain = {"base_link": base, "tip": tip}
    task = excite.Task(file, **chain, acceleration=ACCELERATION, starts=2, seed=seed, executor="serial")
    design = excite.design_trajectory(task)
    rng = np.random.default_rng(seed)
    links = tuple(replace(link, theta=np.asarray(link.theta) * rng.uniform(0.85, 1.15)) for link in design.robot.links)
    played = replace(design, robot=design.robot.replace(links=links))
    size = np.std(excite.simulate(played, rate=RATE).run.effort, axis=0)
    curves = {
        joint: CoulombViscous(COULOMB * each, VISCOUS * each)
        for joint, each in zip(design.robot.joint_names, size.tolist(), strict=True)
    }
    how = {"friction": FrictionCurves(curves), "rate": RATE, "torque_noise": tuple((NOISE * size).tolist())}
    first, second = (excite.simulate(played, seed=k, **how).log for k in (1, 2))
    began = time.process_time()
    result = excite.identify(file, first, design=design, **chain)
    took = time.process_time() - began
    check = excite.verify(result, second)
    truth = reference_of(result.target, [first]).values
    estimate, half = result.estimate.values, result.estimate.half_width
    known = np.isfinite(estimate) & np.isfinite(half)
    return {
        "condition": design.condition_number,
        "parameters": truth.size,
        "known": int(known.sum()),
        "inside": int(np.sum(np.abs(estimate - truth)[known] <= half[known])),
        "error": check.relative_error,
        "refused": [*map(str, result.doubts)],
        "against": [*check.verdict.against],
        "cpu": took,
    }


LIMITATIONS = (
    "one seed; rigid links, friction of two terms and white noise as the model has them, and positions without noise: "
    "what goes wrong here is the choice of settings, not the model",
    "`not known` are parameters that the log does not show by itself; the interval of a parameter at a bound of "
    "possible bodies ignores the bound",
    "meshes and limits of example-robot-data; 6 rad/s^2 or m/s^2 each",
)


def main() -> None:
    """Arms one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", nargs="+", default=list(ARMS), metavar="NAME")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    before, found = record.load(), dict[str, dict[str, Any]]()
    for name in given.arms:
        found[name] = outcome(name, given.seed)
        print(name, json.dumps(found[name]), flush=True)
    rows = [
        [
            name,
            f"{x['condition']:.4g}",
            x["parameters"],
            x["parameters"] - x["known"],
            f"{100 * x['inside'] / x['known']:.1f} %",
            f"{100 * x['error']:.2f} %",
            "; ".join([*x["refused"], *x["against"]]) or "holds",
            f"{x['cpu']:.1f}",
        ]
        for name, x in found.items()
    ]
    head = "arm", "cond(W)", "parameters", "not known", "in their 99 % intervals", "unseen error", "verdict", "CPU s"
    right = sum(not x["refused"] and not x["against"] for x in found.values())
    text = f"{right} of {len(found)} right robots hold.\n\n{record.table(head, rows)}"
    record.save("whole_chain", before, {"seed": given.seed, "arms": found}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
