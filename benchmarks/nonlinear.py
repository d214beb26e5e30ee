"""What limits of torques, of the tool and of collisions cost: whole searches, and start by start with and without."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import record
from judge import Motion, judgement, torque_limits, torques_and_tool
from measure import HERE, script
from problems import HARMONICS, PERIOD, PROBLEMS, RATE

if TYPE_CHECKING:
    from excite.design.problem import Problem

PROBLEM, STARTS, SEED, DENSE = "P1", 12, 0, 10_000.0
WIDE = {"tool_box": [[-0.6, 0.6], [-0.6, 0.6], [0.1, None]], "tool_speed": 1.5}
NARROW = {"tool_box": [[-0.3, 0.5], [-0.4, 0.4], [0.3, 0.9]], "tool_speed": 0.8}
WORLD = HERE / "iiwa7_world.yaml"


def _tuples(value: Any) -> Any:
    """Lists of JSON as tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


CASES: dict[str, dict[str, Any]] = {
    "linear only": {},
    "torques to 70 %": {"torque_margin": 0.3},
    "and a wide box, 1.5 m/s": {"torque_margin": 0.3, **WIDE},
    "torques to 40 %, a narrow box, 0.8 m/s": {"torque_margin": 0.6, **NARROW},
}

SEEDS, STARTS_OF_SEED = (0, 1), 6
TOOL = {"tool_box": ((-1.0, 1.0), (-1.0, 1.0), (0.1, None)), "tool_speed": 1.0}
#: Per robot, the problem without limits of these kinds first; tasks as Python states them.
OF_STARTS: dict[str, dict[str, dict[str, Any]]] = {
    "P1": {
        "-": {},
        "torques to 70 %": {"torque_margin": 0.3},
        "torques to 40 %": {"torque_margin": 0.6},
        "wide box, 1.5 m/s": {name: _tuples(value) for name, value in WIDE.items()},
        "narrow box, 0.8 m/s": {name: _tuples(value) for name, value in NARROW.items()},
    },
    "P2": {
        "-": {},
        "torques to 70 %": {"torque_margin": 0.3},
        "torques to 40 %": {"torque_margin": 0.6},
        "box, 1 m/s": TOOL,
    },
    "iiwa7": {"-": {}, "itself, table, 4 walls": {"world": WORLD}},
}


def uses(trajectory: dict[str, Any], task: dict[str, Any]) -> dict[str, float]:
    """How much of each limit a motion uses at 10 kHz: of the bound of torques and speed, of half the box's side."""
    problem, motion = PROBLEMS[PROBLEM], Motion.of(trajectory)
    time = np.linspace(0.0, motion.period, round(motion.period * DENSE) + 1)
    torque, place, speed = torques_and_tool(problem, *(motion.values(time, derivative) for derivative in range(3)))
    found = {}
    if "torque_margin" in task:
        limit = (1 - task["torque_margin"]) * torque_limits(problem)
        found["torque"] = float((np.abs(torque) / limit).max())
    if "tool_speed" in task:
        found["speed"] = float(speed.max()) / task["tool_speed"]
    for axis, (lower, upper) in zip("xyz", task.get("tool_box", ()), strict=False):
        values = place[:, "xyz".index(axis)]
        half = 0.5 * (upper - lower) if upper is not None else lower
        low = 1.0 - (values.min() - lower) / half
        found[axis] = float(max(low, 1.0 - (upper - values.max()) / half) if upper is not None else low)
    return found


def case(name: str) -> dict[str, Any]:
    """One multi-start, judged."""
    wanted = {"mode": "search", "problem": PROBLEM, "convention": "gautier", "starts": STARTS, "seed": SEED}
    run = script("ours.py", {**wanted, "task": CASES[name]})
    judged, found = judgement(PROBLEM, run.result["trajectory"]), uses(run.result["trajectory"], CASES[name])
    return {
        "case": name,
        "task": CASES[name],
        "condition_number": judged["condition_numbers"]["gautier"],
        "values": run.result["values"],
        "cpu_seconds": run.cpu,
        "wall_seconds": run.wall,
        "certified": run.result["certified"],
        "linear_limits_kept": judged["feasible"],
        "uses": found,
        "kept": judged["feasible"] and all(use <= 1.0 for use in found.values()),
        "trajectory": run.result["trajectory"],
    }


def row(found: dict[str, Any], plain: dict[str, Any]) -> list[object]:
    """One line of the table."""
    return [
        found["case"],
        f"**{found['condition_number']:.2f}**",
        f"{np.median(found['values']):.2f}",
        f"{max(found['values']):.2f}",
        f"{found['cpu_seconds']:.1f}",
        f"{found['cpu_seconds'] / plain['cpu_seconds']:.1f}",
        f"{found['wall_seconds']:.1f}",
        "yes" if found["certified"] and found["kept"] else "NO",
        ", ".join(f"{name} {100 * use:.1f}" for name, use in found["uses"].items()) or "-",
    ]


def problem_of(robot: str, limits: dict[str, Any]) -> Problem:
    """The design problem, in this process, with its limits compiled."""
    from constraints.world_file import read_world
    from excite.design.formulation import formulate
    from excite.tasks.task import Task
    from regressors.readers.library import built_in

    limits = {"torque_margin": "none", **limits}
    if "world" in limits:
        limits["world"] = read_world(limits["world"])
    own = {"acceleration": (10.0,), "base": "orthonormal"} if robot == "iiwa7" else {}
    motion = {"period": PERIOD, "harmonics": HARMONICS, "rate": RATE, "friction": False, "rotor": False}
    task = Task(robot, executor="serial", **motion, **own, **limits)
    problem = formulate(PROBLEMS[robot].robot() if robot in PROBLEMS else built_in(robot), task).problem
    problem.gradient(problem.point(problem.rest, 1.0))
    for limit in problem.limits.nonlinear_in_x:
        limit.holds(problem.rest)
        for part in getattr(limit.function.constraint, "parts", (limit.function.constraint,)):
            part.jacobian(*np.zeros((3, part.joints, 4)))
    return problem


def of_starts(robot: str) -> list[dict[str, Any]]:
    """The same starts with each of the limits, one after the other in this process."""
    from excite.design.starts import optimise_starts
    from excite.registry import instance

    problems = {name: problem_of(robot, limits) for name, limits in OF_STARTS[robot].items()}
    found: dict[str, list[Any]] = {name: [] for name in problems}
    for seed in SEEDS:
        for index in range(STARTS_OF_SEED):
            for name, problem in problems.items():
                found[name].append(optimise_starts(problem, instance("solver", "sqp"), seed, [index], None)[0])
    plain = [result.cpu for result in found["-"]]
    return [
        {
            "robot": robot,
            "limits": name,
            "values": [result.value for result in results],
            "cpu_seconds": [result.cpu for result in results],
            "iterations": [len(result.history) for result in results],
            "times_without": sum(result.cpu for result in results) / sum(plain),
            "median_times_without": float(np.median([r.cpu / cpu for r, cpu in zip(results, plain, strict=True)])),
        }
        for name, results in found.items()
    ]


def row_of_starts(found: dict[str, Any]) -> list[object]:
    """One line of the table of starts."""
    values = found["values"]
    return [
        found["robot"],
        found["limits"],
        f"{np.mean(found['cpu_seconds']):.2f}",
        f"**{found['times_without']:.2f}**",
        f"{found['median_times_without']:.2f}",
        f"{np.mean(found['iterations']):.0f}",
        *(f"{value:.2f}" for value in (min(values), np.median(values), max(values))),
    ]


HEAD_OF_STARTS = (
    "robot",
    "limits",
    "CPU s a start",
    "times without",
    "median of pairs",
    "iterations",
    "best",
    "median",
    "worst",
)

HEAD = (
    "limits",
    "cond(W)",
    "median start",
    "worst start",
    "CPU s",
    "times linear",
    "wall s",
    "kept",
    "% of each, judged by Pinocchio",
)

LIMITATIONS = (
    f"of starts: {len(SEEDS)} seeds of {STARTS_OF_SEED} starts each, the same starts with and without the limits, by "
    "turns in one process, set-up apart; iiwa7 in orthonormal columns, accelerations to 10 rad/s^2; "
    "iterations: those of the run that is finished, without the other runs of the race",
    "torque limits of the URDF, 87 Nm (joints 1-4) and 12 Nm; the tool is the frame of link 7; boxes: x and y +-0.6 m, "
    "z 0.1 m or more; narrow: x -0.3 to 0.5, y +-0.4, z 0.3 to 0.9 m",
    "one seed; CPU and wall time are those of the whole process with its workers, set-up and certificate included, on "
    "a shared machine where they vary by some ten per cent",
    "kept: the project's certificate over continuous time, the judge's exact extrema of linear limits, and the other "
    "limits at 10 kHz by Pinocchio; the last column is the latter (of half a box's side, of the bound where it has one "
    "side)",
)


def main() -> None:
    """All cases."""
    before = record.load()
    cases = []
    for name in CASES:
        cases.append(case(name))
        print(record.table(HEAD, [row(cases[-1], cases[0])]), flush=True)
    starts = [found for robot in OF_STARTS for found in of_starts(robot)]
    content = {"problem": PROBLEM, "starts": STARTS, "seed": SEED, "cases": cases, "of_starts": starts}
    whole = record.table(HEAD, [row(found, cases[0]) for found in cases])
    each = record.table(HEAD_OF_STARTS, [row_of_starts(found) for found in starts])
    record.save("nonlinear", before, content, f"{whole}\n\nStart by start:\n\n{each}", LIMITATIONS)


if __name__ == "__main__":
    main()
