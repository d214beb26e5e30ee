"""Families of motions side by side: equal duration, equal limits, equally many free coefficients."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import record
from problems import FREE_SPACE, PROBLEMS, RATE

if TYPE_CHECKING:
    from excite.tasks.task import Task
    from regressors.robot.robot import Robot

STARTS, SEED = 6, 0

FAMILIES: dict[str, dict[str, Any]] = {
    "fourier": {"trajectory": "fourier"},
    "fourier-quintic": {"trajectory": "fourier-quintic"},
    "cosine": {"trajectory": "cosine"},
    "bspline, order 4": {"trajectory": "bspline", "order": 4, "intervals": 3},
    "bspline, order 5": {"trajectory": "bspline", "order": 5, "intervals": 3},
    "bspline, order 6": {"trajectory": "bspline", "order": 6, "intervals": 3},
}
_PI, _HALF = 3.141592653589793, 1.5707963267948966


@dataclass(frozen=True)
class Setting:
    """One robot, its limits, and how rich its motions are.

    Parameters
    ----------
    title : str
    sizes : tuple of int
        Free coefficients per joint.
    options : dict
        Of ``excite design``.
    limits : dict
        That replace those of the robot's description.
    """

    title: str
    sizes: tuple[int, ...]
    options: dict[str, Any]
    limits: dict[str, Any] = field(default_factory=dict)

    def robot(self) -> Robot:
        """The robot."""
        from regressors.readers.library import load_robot

        name = self.options["robot"]
        return PROBLEMS[name].robot() if name in PROBLEMS else load_robot(name)


SETTINGS = {
    "irp6": Setting("IRp-6, axes 1-3, 10 s, 13 parameters with friction", (9, 19), {"robot": "irp6"}),
    "P1": Setting(
        "P1, Panda, 10 s, 43 inertial parameters", (9, 19), {"robot": "P1", "friction": False, "rotor": False}
    ),
    "ur10e": Setting(
        "UR10e, 20 s, 58 parameters with rotors, friction, offsets",
        (19, 29),
        {"robot": "ur10e", "period": 20.0, "joint_rotors": True, "offset": True},
        {
            "position": ((-_PI, _PI), (-_PI, 0.0), (-_HALF, _HALF), (-_PI, 0.0), (-_HALF, _HALF), (-_HALF, _HALF)),
            "velocity": (3.14, 3.14, 3.14, 6.28, 6.28, 6.28),
            "acceleration": (2.5, 2.0, 2.0, 2.5, 2.0, 2.5),
        },
    ),
}


def tasks(setting: Setting) -> Iterator[tuple[str, int, Task]]:
    """Every family with each of the numbers of coefficients."""
    from excite.tasks.limit_choice import LimitChoice
    from excite.tasks.task import Task

    for wanted in setting.sizes:
        for name, options in FAMILIES.items():
            base = {"harmonics": 2, "rate": RATE, "seed": SEED, **setting.options, **options}
            task = Task(**base, limits=LimitChoice(**setting.limits, **FREE_SPACE))
            while task.trajectory.family().size < wanted:
                task = task.changed(trajectory=task.trajectory.finer())
            yield name, wanted, task


def designed(setting: Setting, task: Task) -> dict[str, Any]:
    """Best of all starts, one after the other in this process, judged as `excite design` judges it."""
    from excite.design.formulation import formulate
    from excite.design.optimisation import certify
    from excite.design.starts import optimise_starts
    from excite.registry import instance
    from regressors.errors import InputError

    robot = setting.robot()
    try:
        made = formulate(robot, task)
    except InputError as error:  # such motions do not show every parameter
        return {"refused": str(error)}
    problem, method = made.problem, instance("solver", "sqp")
    found = tuple(optimise_starts(problem, method, SEED, [index], None)[0] for index in range(STARTS))
    design = certify(robot, made, found, {})
    return {
        "coefficients": problem.family.size,
        "described": problem.family.described,
        "criteria": design.criteria,
        "feasible": design.feasible,
        "values_of_starts": [start.value for start in found],
        "cpu_seconds_per_start": sum(start.cpu for start in found) / STARTS,
        "trajectory": problem.family.to_dict(design.trajectory.x),
    }


def row(name: str, found: dict[str, Any]) -> list[object]:
    """One line of a robot's table."""
    if "refused" in found:
        return [name, "-", "does not show all parameters", "-", "-", "-", "-", "-"]
    values, criteria = sorted(found["values_of_starts"]), found["criteria"]
    return [
        name,
        found["described"],
        found["coefficients"],
        f"**{criteria['condition_number']:.4g}**",
        f"{values[len(values) // 2]:.4g}",
        f"{criteria['log_det']:.1f}",
        "yes" if found["feasible"] else "NO",
        f"{found['cpu_seconds_per_start']:.2f}",
    ]


HEAD = (
    "family",
    "made of",
    "coefficients a joint",
    "cond(W)",
    "median start",
    "log det",
    "limits hold",
    "CPU s a start",
)

LIMITATIONS = (
    f"designed for the condition number, left-to-right base; best of {STARTS} starts, seed {SEED}; log det of W'W of "
    f"the same motion at {RATE:g} Hz",
    "all motions rest at both ends (velocity and acceleration zero) within limits that hold over continuous time; the "
    "acceleration of B-splines of order 4 has corners, that of the others has none",
    "as many coefficients are not as many frequencies: n cosines reach n times the fundamental, a Fourier series of as "
    "many coefficients about half of it; what binds the richness in practice (bandwidth, jerk) may judge differently",
    "UR10e: the limits and the 58 columns under which dynamic_calibration published 66.8, with 10 harmonics and a "
    "quintic, accelerations up to 14 % beyond the limit between its grid points",
    "processor time is that of the starts alone, one process, one thread; time on a shared machine varies by some ten "
    "per cent",
)


def main() -> None:
    """Every robot, every family."""
    before = record.load()
    found: dict[str, list[dict[str, Any]]] = {}
    text = []
    for key, setting in SETTINGS.items():
        found[key] = []
        for name, wanted, task in tasks(setting):
            found[key].append({"family": name, "wanted": wanted, **designed(setting, task)})
            print(record.table(HEAD, [row(name, found[key][-1])]), flush=True)
        text.append(f"{setting.title}\n\n{record.table(HEAD, [row(one['family'], one) for one in found[key]])}")
    content = {"starts": STARTS, "seed": SEED, "robots": found}
    record.save("families", before, content, "\n\n".join(text), LIMITATIONS)


if __name__ == "__main__":
    main()
