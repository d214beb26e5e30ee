"""Payloads of 1 to 5 kg in simulation: error of mass and centre, and how often the 99 % intervals hold the truth.

One motion of 5 s for each robot, designed by the tool; one run without and one with each load, simulated with encoders
and friction; 1,000 repetitions over the loads, each with other gains of the drives (1 %, standard deviation) and other
torque noise (1 % of the limit). Finished cases are kept in `results/` and not run again; `--fresh` runs all.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from threadpoolctl import threadpool_limits

import excite
from excite.identification.equations import right_sides
from excite.identification.preparation import drives_of_torques
from excite.payload.held_body import Frame, HeldBody
from excite.payload.known_gains import stated_gains
from excite.payload.load_estimate import LoadEquations, estimate_load
from excite.payload.load_rows import LogChoice, bare_task, loaded_parts, paired_equations, without_load
from excite.payload.payload_result import PayloadResult
from excite.tasks.payload import Payload
from excite.tasks.robot_of_task import robot_and_task
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.robot import Drive, Limits, Transmission

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"
REPEATS = 1000  # of each robot and rate, over its loads
EACH = 5  # intervals of every fifth repetition, since they take ten times as long as the estimate
NOISE, GAINS = 0.01, 0.01
ENCODER = 2.0**17
ROTOR = 0.005  # kg m^2 at the joint, per Nm of its torque limit
ROBOTS = {
    "ur10e": ((1.0, 2.0, 3.0, 4.0, 5.0), (0.0, -1.2, 1.6, -1.2, -1.57, 0.0)),
    "panda": ((1.0, 2.0, 3.0), (0.0, -0.4, 0.0, -2.0, 0.0, 1.8, 0.785)),
}
CASES = tuple((robot, rate) for rate in (2000.0, 500.0) for robot in ROBOTS)
CENTRE, RADII = (0.02, 0.03, 0.08), np.diag([0.003, 0.004, 0.002])


def load_of(mass: float) -> np.ndarray:
    """A body of some mass beside the last link's axis."""
    return from_centre_of_mass(mass, CENTRE, mass * RADII)


def robot_with_rotors(name: str) -> Any:
    """The built-in robot with rotors, which its description does not state, without which friction would stop it."""
    robot = excite.load_robot(name)
    limits = zip(robot.joint_names, robot.limits.torque, strict=True)
    drives = tuple(Drive(joint, rotor_inertia=ROTOR * limit) for joint, limit in limits)
    return robot.replace(transmission=Transmission(np.eye(robot.n), drives, Limits.none(robot.n)))


def friction_of(robot: Any) -> FrictionCurves:
    """Coulomb friction of 2 % of the torque limit, and as much viscous friction at 2 rad/s."""
    limits = zip(robot.joint_names, robot.limits.torque, strict=True)
    return FrictionCurves({name: CoulombViscous(0.02 * limit, 0.01 * limit, 0.0) for name, limit in limits})


def case(name: str, rate: float) -> dict[str, Any]:
    """All repetitions of a robot."""
    loads, pose = ROBOTS[name]
    began = time.process_time()
    truth = robot_with_rotors(name)
    motion = excite.design_payload_motion(truth, 0.2, pose=pose)
    designed = time.process_time() - began
    robot, task = robot_and_task(truth, None, None, None, True, False)
    task = bare_task(robot, task)
    friction = friction_of(robot)
    settings = {"rate": rate, "encoder": (ENCODER,), "friction": friction}
    bare_log = excite.simulate(motion.design, **settings).measured
    sigma = NOISE * robot.limits.torque
    rows: list[dict[str, Any]] = []
    with threadpool_limits(1):
        for number, mass in enumerate(loads):
            loaded_log = excite.simulate(motion.design, load=Payload(load_of(mass)), **settings).measured
            parts = (len(loads) - number + REPEATS - 1) // len(loads)
            rows += repetitions(robot, task, bare_log, loaded_log, mass, sigma, parts, seed=number)
    return {
        "robot": name,
        "rate": rate,
        "design_cpu_seconds": designed,
        "cpu_seconds": time.process_time() - began,
        "loads": {f"{mass:g}": summary([row for row in rows if row["mass"] == mass]) for mass in loads},
        "all": summary(rows),
    }


def repetitions(
    robot: Any, task: Any, bare: Any, loaded: Any, mass: float, sigma: np.ndarray, count: int, seed: int
) -> list[dict[str, Any]]:
    """Errors of some repetitions with one load."""
    choice = LogChoice()
    logs = [replace(log, sha256=f"{k}") for k, log in enumerate((bare, loaded))]
    rng = np.random.default_rng([seed, robot.n, round(bare.rate)])
    first = replace(logs[0], effort=logs[0].effort + sigma * rng.normal(size=logs[0].effort.shape))
    model = without_load(robot, task, [first], choice.recipe(logs, "all"), lambda _: None)
    part, (held,) = model.prepared[0], loaded_parts(model, [logs[1]], "all")
    gains = stated_gains(drives_of_torques(model.target.robot, each=False)[0], 0.0, GAINS)
    equations = paired_equations(model, [held], model.recipe, gains)
    exact = [_torques(logs[0], part), held.measured]
    rows = []
    for number in range(count):
        factor = 1.0 + GAINS * rng.normal(size=robot.n)
        measured = [tau / factor + sigma * rng.normal(size=tau.shape) for tau in exact]
        y = [
            right_sides(model.target, p, model.recipe, m[None]).ravel()
            for p, m in zip((replace(part, standing=()), held), measured, strict=True)
        ]
        rows.append(outcome(robot, equations, np.concatenate(y), mass, intervals=number % EACH == 0))
    return rows


def _torques(log: Any, part: Any) -> np.ndarray:
    """Noise-free torques at the instants of a prepared motion."""
    return np.column_stack([np.interp(part.samples.time, log.time, tau) for tau in log.effort.T])


def measured(equations: LoadEquations, y: np.ndarray) -> LoadEquations:
    """The same equations with another measurement."""
    return replace(equations, observations=replace(equations.observations, y=y))


def outcome(robot: Any, equations: LoadEquations, y: np.ndarray, mass: float, *, intervals: bool) -> dict[str, Any]:
    """Errors, and whether the intervals hold the truth."""
    if not intervals:
        body = HeldBody.of(estimate_load(measured(equations, y)).phi)
        return {"mass": mass, **errors(body, mass)}
    estimate = estimate_load(measured(equations, y))
    place = Frame("frame of the last link", np.eye(3), np.zeros(3))
    result = PayloadResult(robot, place, estimate, "joint torques", None)
    truth = HeldBody.of(load_of(mass)).listed
    low, high = result.intervals.T
    return {
        "mass": mass,
        **errors(result.body, mass),
        "inside": ((low <= truth) & (truth <= high)).tolist(),
        "half": float((high[0] - low[0]) / 2 / mass),
    }


def errors(body: HeldBody, mass: float) -> dict[str, float]:
    """Relative error of the mass, and distance of the centre from the true one [m]."""
    return {"mass_error": body.mass / mass - 1.0, "centre_error": float(np.linalg.norm(body.centre - np.array(CENTRE)))}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares within 2 % and 5 mm, the 99th percentiles, and coverage."""
    mass = np.abs([row["mass_error"] for row in rows])
    centre = np.array([row["centre_error"] for row in rows])
    stated = [row for row in rows if "inside" in row]
    inside = np.array([row["inside"] for row in stated])
    return {
        "repeats": len(rows),
        "mass_within_2_percent": float(np.mean(mass <= 0.02)),
        "centre_within_5_mm": float(np.mean(centre <= 0.005)),
        "mass_error_99": float(np.quantile(mass, 0.99)),
        "centre_error_99": float(np.quantile(centre, 0.99)),
        "coverage_mass": float(inside[:, 0].mean()),
        "coverage_centre": inside[:, 1:4].mean(axis=0).tolist(),
        "coverage_inertia": inside[:, 4:].mean(axis=0).tolist(),
        "intervals": len(stated),
        "half_width_mass": float(np.median([row["half"] for row in stated])),
    }


def text(cases: list[dict[str, Any]]) -> str:
    """A table of the cases."""
    names = (
        "robot", "rate [Hz]", "load [kg]", "repeats", "mass within 2 %", "centre within 5 mm", "99th percentile: mass",
        "centre", "intervals", "of them hold the mass", "centre x, y, z", "inertia (least)",
    )  # fmt: skip
    head = f"| {' | '.join(names)} |"
    lines = ["# Payloads in simulation", "", __doc__ or "", "", head, "|" + "---|" * 12]
    for each in cases:
        for load, s in [*each["loads"].items(), ("all", each["all"])]:
            centre = ", ".join(f"{100 * x:.1f}" for x in s["coverage_centre"])
            lines.append(
                f"| {each['robot']} | {each['rate']:g} | {load} | {s['repeats']} "
                f"| {100 * s['mass_within_2_percent']:.1f} % "
                f"| {100 * s['centre_within_5_mm']:.1f} % | {100 * s['mass_error_99']:.2f} % "
                f"| {1e3 * s['centre_error_99']:.2f} mm | {s['intervals']} "
                f"| {100 * s['coverage_mass']:.1f} % | {centre} % "
                f"| {100 * min(s['coverage_inertia']):.1f} % |"
            )
    spent = "; ".join(
        f"{c['robot']} at {c['rate']:g} Hz: {c['cpu_seconds']:.0f} s CPU, "
        f"of them {c['design_cpu_seconds']:.1f} s for the design"
        for c in cases
    )
    return "\n".join([*lines, "", spent, ""])


def main() -> None:
    """Run the cases that are not finished, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fresh", action="store_true", help="run finished cases again")
    fresh = parser.parse_args().fresh
    RESULTS.mkdir(exist_ok=True)
    cases = []
    for name, rate in CASES:
        file = RESULTS / f"{name}-{rate:g}.json"
        if fresh or not file.exists():
            file.write_text(json.dumps(case(name, rate), indent=1) + "\n", encoding="utf-8")
        cases.append(json.loads(file.read_text(encoding="utf-8")))
        (RESULTS / "simulated.md").write_text(text(cases), encoding="utf-8")
    print(text(cases))


if __name__ == "__main__":
    main()
