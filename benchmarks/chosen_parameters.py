"""What designs for chosen parameters, for predicted torques and for plausible robots bring over the plain criteria."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import criteria
import numpy as np
import record
from problems import FREE_SPACE, HARMONICS, PERIOD, RATE

if TYPE_CHECKING:
    from excite.design.formulation import Formulation
    from excite.tasks.stored_files import TaskMotion
    from regressors.samples import Array

STARTS, SEED = 4, 0
ROBOTS, SHARE = 200, 0.2
INTERESTS = {"irp6": ("friction", "gravity", "inertia"), "P1": ("gravity", "inertia", "I7zz")}
PLAIN = ("condition", "logdet", "trace")
TORQUES = ("torques within the limits", "torques of the task")
#: Poses of the moving joints between which the task goes in 2 s [rad].
TASKS = {
    "irp6": ((-0.4, -0.2, -0.2), (0.4, 0.3, 0.3)),
    "P1": ((-0.5, -0.5, 0, -2, 0, 1, 0), (0.5, 0.3, 0.3, -1.2, 0.3, 1.8, 0.5)),
}
LIMITS: dict[str, dict[str, Any]] = {
    "reserve 0": {"torque_margin": 0.0},
    "reserve 0.1": {"torque_margin": 0.1},
    "reserve 0.3": {"torque_margin": 0.3},
    "uncertainty 0.1": {"torque_uncertainty": 0.1},
    "uncertainty 0.2": {"torque_uncertainty": 0.2},
}


def task_motion(name: str) -> TaskMotion:
    """There by a quintic from rest to rest, at 100 instants."""
    from excite.tasks.stored_files import TaskMotion

    begin, end = (np.array(pose, dtype=float) for pose in TASKS[name])
    duration = 2.0
    s = (np.linspace(0, 1, 100))[:, None]
    q = begin + (end - begin) * s**3 * (10 - 15 * s + 6 * s**2)
    dq = (end - begin) * 30 * s**2 * (1 - s) ** 2 / duration
    ddq = (end - begin) * 60 * s * (1 - s) * (1 - 2 * s) / duration**2
    joints = criteria.SETTINGS[name].robot().joint_names[: len(begin)]
    return TaskMotion("task", joints, q, dq, ddq)


def goals(name: str) -> dict[str, dict[str, Any]]:
    """Names in the table, and the options of ``excite design`` that make the criterion."""
    torque = {"criterion": "torque-deviation"}
    chosen = {f"trace of {one}": {"criterion": "trace", "interest": (one,)} for one in INTERESTS[name]}
    of_torques = {TORQUES[0]: torque, TORQUES[1]: {**torque, "task_motion": task_motion(name)}}
    return {**{one: {"criterion": one} for one in PLAIN}, **chosen, **of_torques}


def problem_of(name: str, options: dict[str, Any]) -> Formulation:
    """The design problem of one goal."""
    from excite.design.formulation import formulate
    from excite.tasks.task import Task

    setting = criteria.SETTINGS[name]
    common = {"noise": setting.noise, "weighted": True, "period": PERIOD, "harmonics": HARMONICS, "rate": RATE}
    common |= FREE_SPACE
    return formulate(setting.robot(), Task(**setting.options, **common, seed=SEED, **options))


def best(made: Formulation) -> tuple[Array, float]:
    """Coefficients of the best start that keeps every limit, and the processor time of a start."""
    from excite.design.starts import optimise_starts
    from excite.registry import instance

    method = instance("solver", "sqp")
    found = [optimise_starts(made.problem, method, SEED, [index], None)[0] for index in range(STARTS)]
    return min(found, key=lambda start: start.value).coefficients, sum(start.cpu for start in found) / STARTS


def of_goals(name: str) -> dict[str, Any]:
    """Every criterion of every design, over that of the design for the condition number."""
    made = {goal: problem_of(name, options) for goal, options in goals(name).items()}
    designs = {goal: best(one) for goal, one in made.items()}
    values = {
        goal: {other: one.problem.exact_value(x) for other, one in made.items()} for goal, (x, _) in designs.items()
    }
    cpu = {goal: seconds for goal, (_, seconds) in designs.items()}
    return {"title": criteria.SETTINGS[name].title, "values": values, "cpu_seconds_per_start": cpu}


def torques_of_robots(design: Any, share: float) -> int:
    """How many robots of a box break a torque limit at an instant of the motion: each parameter off by a share."""
    from regressors.models.differential import DifferentialModel
    from regressors.models.nominal import standard_values, stated_deviations
    from regressors.robot.columns import Terms

    robot, rng = design.moving, np.random.default_rng(SEED)
    model = DifferentialModel(robot, Terms(coulomb=False))
    definition, names = model.definition()
    Y = model.instants(design.trajectory.sampled(RATE)) @ definition
    known, off = standard_values(robot), stated_deviations(robot, share)
    nominal, deviation = (np.array([values.get(n, 0.0) for n in names]) for values in (known, off))
    u = nominal[:, None] + deviation[:, None] * rng.choice([-1.0, 1.0], (nominal.size, ROBOTS))
    torque = np.abs(Y @ u).reshape(-1, robot.n, ROBOTS).max(axis=0)
    return int(np.any(torque > robot.limits.torque[:, None], axis=0).sum())


def of_limits() -> list[dict[str, Any]]:
    """Condition numbers of a Panda with 5 kg in the hand under several reserves, and robots that break its limits."""
    import excite

    arm = {"payload": (5.0, 0.0, 0.0, 0.15), "acceleration": (20.0,), "jerk": (1e4,)}  # torques are what limits it
    common = {**arm, "friction": False, "rotor": False, "starts": STARTS, "rounds": 0}
    rows = []
    for name, options in LIMITS.items():
        design = excite.design_trajectory(excite.Task("panda", seed=SEED, executor="serial", **common, **options))
        broken = {str(share): torques_of_robots(design, share) for share in (0.1, 0.2)}
        rows.append({"limit": name, "condition_number": design.condition_number, "broken": broken})
    return rows


def of_plausible_robots() -> dict[str, dict[str, float]]:
    """Relative criteria of the IRp-6 of the described robot and of the worst of plausible ones, by design."""
    options = {"criterion": "max-deviation", "prior": SHARE, "scale": "value"}
    goals = {"described robot": options, "worst of 20 robots": {**options, "plausible_robots": 20}}
    made = {goal: problem_of("irp6", one) for goal, one in goals.items()}
    designs = {goal: best(one)[0] for goal, one in made.items()}
    return {goal: {other: one.problem.exact_value(x) for other, one in made.items()} for goal, x in designs.items()}


def tables(studies: dict[str, Any], limits: list[dict[str, Any]], robots: dict[str, dict[str, float]]) -> str:
    """As Markdown."""
    parts = []
    for study in studies.values():
        values, names = study["values"], list(study["values"])
        reference = values["condition"]
        least = {name: min(row[name] for row in values.values()) for name in names}
        rows = [
            [goal, *(_bold(f"{row[other] / reference[other]:.2f}", row[other] == least[other]) for other in names)]
            for goal, row in values.items()
        ]
        parts.append(f"{study['title']}\n\n{record.table(['designed for', *names], rows)}")
    rows = [[r["limit"], f"{r['condition_number']:.4g}", *r["broken"].values()] for r in limits]
    head = ["torque limits", "cond(W)", "of 200 robots beyond a limit, off by 10 %", "off by 20 %"]
    parts.append(f"Panda with 5 kg in the hand, accelerations up to 20 rad/s^2\n\n{record.table(head, rows)}")
    rows = [[goal, *(f"{value:.4g}" for value in row.values())] for goal, row in robots.items()]
    head = ["designed for", *(f"largest relative deviation, {name}" for name in robots)]
    parts.append(f"IRp-6, the description's values known to 20 %\n\n{record.table(head, rows)}")
    return "\n\n".join(parts)


def _bold(text: str, lowest: bool) -> str:
    return f"**{text}**" if lowest else text


LIMITATIONS = (
    f"{PERIOD:g} s, Fourier series of {HARMONICS} harmonics, left-to-right base, rows divided by the assumed noise of "
    f"the joints (as in criteria.md); best of {STARTS} starts, seed {SEED}: some per cent are luck of the search, and "
    "so is a value on the diagonal above the smallest of its column",
    "first tables: each criterion over its value for the design of the condition number (of weighted rows), smaller is "
    "better; trace of a group: root of the sum of the variances of its parameters, the others estimated too; torques: "
    "root of the mean variance of predicted torques, over 500 states within the limits, or over a quintic of 2 s "
    "between two poses; a sum of variances in SI units is ruled by the parameters of large numbers",
    f"robots beyond a limit: of {ROBOTS} with every inertial parameter off by the whole share, up or down at random, "
    "corners of the box, so that many of them are no possible bodies; at 100 Hz, without friction",
    "relative deviations: per instant, as criteria are; for the prior and the noise stated",
)


def main() -> None:
    """All tables."""
    before = record.load()
    studies = {name: of_goals(name) for name in INTERESTS}
    limits, robots = of_limits(), of_plausible_robots()
    content = {"starts": STARTS, "seed": SEED, "studies": studies, "limits": limits, "plausible_robots": robots}
    record.save("chosen_parameters", before, content, tables(studies, limits, robots), LIMITATIONS)


if __name__ == "__main__":
    main()
