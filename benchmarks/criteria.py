"""What designing for one criterion costs in the others: every criterion of every design, on the IRp-6 and on P1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import record
from problems import FREE_SPACE, HARMONICS, PERIOD, PROBLEMS, RATE

if TYPE_CHECKING:
    from excite.design.formulation import Formulation
    from regressors.robot.robot import Robot
    from regressors.samples import Array

STARTS, SEED = 8, 0
PRIOR = 0.2

#: Names in the tables, and the options of ``excite design`` that make the criterion.
GOALS: dict[str, dict[str, Any]] = {
    "condition": {},
    "frobenius": {"criterion": "frobenius"},
    "sigma-min": {"criterion": "sigma-min"},
    "logdet": {"criterion": "logdet"},
    "trace": {"criterion": "trace"},
    "condition, weighted": {"weighted": True},
    "trace, weighted": {"criterion": "trace", "weighted": True},
    "sigma-min, prior": {"criterion": "sigma-min", "prior": PRIOR, "scale": "prior"},
    "trace, of values": {"criterion": "trace", "weighted": True, "scale": "value"},
}


@dataclass(frozen=True)
class Setting:
    """One robot with the noise of its joints.

    Parameters
    ----------
    title : str
    noise : tuple of float
        Per joint [Nm].
    options : dict
        Of ``excite design``, for every goal alike.
    """

    title: str
    noise: tuple[float, ...]
    options: dict[str, Any]

    def robot(self) -> Robot:
        """The robot with the limits of the problem."""
        from regressors.readers.library import load_robot

        name = self.options["robot"]
        return PROBLEMS[name].robot() if name in PROBLEMS else load_robot(name)


SETTINGS = {
    "irp6": Setting("IRp-6, axes 1-3, 13 parameters with friction", (2.0, 8.0, 4.0), {"robot": "irp6"}),
    "P1": Setting(
        "P1, Panda, 43 inertial parameters",
        (1.0, 1.0, 1.0, 1.0, 0.2, 0.2, 0.2),
        {"robot": "P1", "friction": False, "rotor": False},
    ),
}


def problem_of(setting: Setting, goal: str) -> Formulation:
    """The design problem of one goal."""
    from excite.design.formulation import formulate
    from excite.tasks.task import Task

    common = {"noise": setting.noise, "period": PERIOD, "harmonics": HARMONICS, "rate": RATE, "seed": SEED} | FREE_SPACE
    return formulate(setting.robot(), Task(**setting.options, **common, **GOALS[goal]))


def designed(made: Formulation) -> dict[str, Any]:
    """Best of all starts, one after the other in this process, and what they took."""
    from excite.design.optimisation import limits_of
    from excite.design.starts import optimise_starts
    from excite.registry import instance

    problem, method = made.problem, instance("solver", "sqp")
    found = [optimise_starts(problem, method, SEED, [index], None)[0] for index in range(STARTS)]
    best = min(found, key=lambda start: start.value)
    motion = problem.information.trajectory(best.coefficients)
    return {
        "x": best.coefficients,
        "cpu_seconds_per_start": sum(start.cpu for start in found) / STARTS,
        "feasible": all(use.holds for use in limits_of(made, motion)),
        "values_of_starts": [start.value for start in found],
        "trajectory": problem.family.to_dict(motion.x),
    }


def study(setting: Setting) -> dict[str, Any]:
    """Designs for all goals, and the value of every criterion for each of them."""
    made = {goal: problem_of(setting, goal) for goal in GOALS}
    designs = {goal: designed(one) for goal, one in made.items()}
    points: dict[str, Array] = {goal: design.pop("x") for goal, design in designs.items()}
    values = {goal: {other: one.problem.exact_value(points[goal]) for other, one in made.items()} for goal in GOALS}
    return {"title": setting.title, "noise": setting.noise, "designs": designs, "values": values}


def tables(found: dict[str, Any]) -> str:
    """Every value, and how much larger it is than the smallest of its column."""
    values = found["values"]
    smallest = {goal: min(row[goal] for row in values.values()) for goal in GOALS}
    rows = []
    for goal, row in values.items():
        design, lost = found["designs"][goal], [row[other] / smallest[other] for other in GOALS]
        cells = [
            f"**{_cell(row, other, smallest)}**" if goal == other else _cell(row, other, smallest) for other in GOALS
        ]
        mean, most = float(np.exp(np.mean(np.log(lost)))), max(lost)
        cells += [f"{mean:.2f}", f"{most:.2f}", "yes" if design["feasible"] else "NO"]
        rows.append([goal, *cells, f"{design['cpu_seconds_per_start']:.2f}"])
    head = ["designed for", *GOALS, "mean", "most", "limits hold", "CPU s a start"]
    noise = ", ".join(f"{s:g}" for s in found["noise"])
    return f"{found['title']}; noise {noise} Nm\n\n{record.table(head, rows)}"


def _cell(row: dict[str, float], goal: str, smallest: dict[str, float]) -> str:
    return f"{row[goal]:.4g} ({row[goal] / smallest[goal]:.2f})"


LIMITATIONS = (
    f"{PERIOD:g} s, Fourier series of {HARMONICS} harmonics at rest at both ends, left-to-right base; best of {STARTS} "
    f"starts, seed {SEED}: with more starts the smallest of a column may be a little lower, and may then stand on the "
    "diagonal where it does not",
    "in parentheses: the value over the smallest of its column; mean (geometric) and most: of these in the row",
    "all criteria are smaller where they are better, and per "
    f"instant (M = W'W / N at {RATE:g} Hz): condition numbers; sigma-min: 1 / sqrt(smallest eigenvalue of M); logdet: "
    "det(M)^(-1/2b), the mean half-axis of the confidence ellipsoid; trace: sqrt(tr M^-1)",
    "weighted: rows divided by the noise that stands above the table, which is assumed; prior: the description's "
    f"values known to {100 * PRIOR:g} %, parameters measured by these deviations; of values: weighted, parameters "
    "measured by the description's values",
    "processor time is that of the starts alone, one process, one thread; time on a shared machine varies by some ten "
    "per cent",
)


def main() -> None:
    """Both robots."""
    before = record.load()
    found = {name: study(setting) for name, setting in SETTINGS.items()}
    text = "\n\n".join(tables(one) for one in found.values())
    record.save(
        "criteria", before, {"starts": STARTS, "seed": SEED, "goals": GOALS, "studies": found}, text, LIMITATIONS
    )


if __name__ == "__main__":
    main()
