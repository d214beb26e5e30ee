"""Verdicts on results whose truth is known: right ones, wrong ones of every kind, and what each command ends with.

Of four robots one motion is identified and another verified. A wrong result has to be refused by ``identify`` or by
``verify`` (exit status 1); a right one by neither.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import record

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.identification.identify import identify
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.logs.log import Log
from excite.simulation.sensors import sensor_of
from excite.simulation.simulate import simulate
from excite.tasks.payload import Payload
from excite.tasks.task import Task
from excite.verification.verify import verify
from regressors.errors import InputError
from regressors.models.nominal import parameter_values, standard_values
from regressors.readers.library import built_in
from regressors.robot.robot import Robot

ROBOTS = ("irp6", "ur10e", "panda", "iiwa7")
NOISE = 0.02  # of the root mean square of each torque, of a robot as it is; ten times as much on a noisy one
LOADS = {"irp6": 10.0, "ur10e": 4.0, "panda": 1.5, "iiwa7": 2.5}  # [kg]
SMALL = (0.1, 0.0, 0.0, 0.1, 0.0, 0.02)  # inertia of a load about the flange [kg m^2]
RATE = 250.0  # of the logs [Hz]
COULOMB, VISCOUS = 0.03, 0.02  # of the torque limits; s/rad of them

Change = Callable[[Log], Log]


@dataclass(frozen=True)
class Case:
    """How the logs and the identification of one case depart from the robot."""

    kind: str
    name: str
    training: Change = lambda log: log
    other: Change = lambda log: log
    noise: float = 1.0
    locked: bool = False
    loaded: bool = False
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def wrong(self) -> bool:
        """Whether the result has to be refused."""
        return self.kind != "right"


def torques(factors: dict[int, float]) -> Change:
    """Torques of some joints times a factor; joint -1 stands for the last."""

    def changed(log: Log) -> Log:
        effort = np.array(log.effort)
        for joint, factor in factors.items():
            effort[:, joint] *= factor
        return replace(log, effort=effort)

    return changed


def swapped(channel: str) -> Change:
    """Columns of the second and third joint in each other's place."""

    def changed(log: Log) -> Log:
        values = np.array(getattr(log, channel))
        values[:, [1, 2]] = values[:, [2, 1]]
        return replace(log, **{channel: values}, dq=None)

    return changed


def all_torques(factor: float) -> Change:
    """All torques times a factor."""
    return lambda log: replace(log, effort=factor * np.array(log.effort))


PHYSICAL = (("recipe", Recipe(estimator="physical")), ("choose", False))
WEIGHTED = (("recipe", Recipe(estimator="weighted")), ("choose", False))
CASES = (
    Case("right", "plain defaults"),
    Case("right", "without noise", noise=0.0),
    Case("right", "noisy", noise=10.0),
    Case("right", "weighted least squares", options=WEIGHTED),
    Case("right", "possible bodies", options=PHYSICAL),
    Case("wrong in torque", "second joint times 0.7", torques({1: 0.7})),
    Case("wrong in torque", "last joint times 1.5", torques({-1: 1.5})),
    Case("wrong in torque", "an untold load", loaded=True),
    Case("wrong in torque", "all torques times 1.2", all_torques(1.2)),
    Case("impossible", "all signs in both logs", all_torques(-1.0), all_torques(-1.0)),
    Case("impossible", "sign of the second joint in both logs", torques({1: -1.0}), torques({1: -1.0})),
    Case("unseen", "last three joints at rest, weighted", locked=True, options=WEIGHTED),
    Case("unseen", "last three joints at rest, plain defaults", locked=True),
    Case("spoilt", "torques of two joints swapped", swapped("effort")),
    Case("spoilt", "positions of two joints swapped", swapped("q")),
)


@cache
def motion(robot: str, seed: int, locked: bool = False) -> Design:
    """A cheap design within the robot's limits, of 10 s or 8 s."""
    drives = tuple(map(str, range(1, built_in(robot).n - 2))) if locked else None
    own = {} if drives is None else {"drives": drives}
    return design_trajectory(Task(robot, period=10.0 - 2 * seed, starts=1, seed=seed, executor="serial", **own))


@cache
def exact_log(robot: str, seed: int, locked: bool, loaded: bool) -> Log:
    """The motion and the torques that it takes, Coulomb friction being exact.

    The IRp-6, whose drives are described, is simulated under control; of the others the equations are evaluated.
    """
    design, described = motion(robot, seed, locked), built_in(robot)
    load = Payload((LOADS[robot], 0.0, 0.0, 0.08 * LOADS[robot], *SMALL)) if loaded else None
    if described.transmission is not None:
        return simulate(design, rate=200, load=load).log
    task = Task(robot, friction=False)
    bodied = with_bodies(described)
    carrying = bodied if load is None else load.on(bodied, sensor_of(task))
    samples = design.trajectory.samples(np.arange(round((10.0 - 2 * seed) * RATE) + 1) / RATE)
    target = target_of(carrying, task)
    known = parameter_values(target.model, target.base, standard_values(carrying))
    effort = (target.model.instants(samples)[:, target.base.index] @ known).reshape(samples.q.shape)
    effort += described.limits.torque * (COULOMB * np.sign(samples.dq) + VISCOUS * samples.dq)
    name = f"{robot} {seed} {locked} {loaded}"
    return Log(f"{robot}.csv", name, described.joint_names, samples.time, samples.q, None, effort)


def with_bodies(robot: Robot) -> Robot:
    """The robot with a ball of 3 kg, 3 cm off the axis, for each link whose body is not described."""
    ball = np.array([3.0, 0.09, 0.0, 0.0, 0.02, 0.0, 0.0, 0.02, 0.0, 0.02])
    return robot.replace(links=tuple(replace(k, theta=ball) if k.theta is None else k for k in robot.links))


def log_of(robot: str, seed: int, case: Case, locked: bool, loaded: bool) -> Log:
    """What the robot measures: torques with white noise in proportion to those of each joint."""
    log = exact_log(robot, seed, locked, loaded)
    effort, rng = np.array(log.effort), np.random.default_rng(seed)
    effort += case.noise * NOISE * np.sqrt(np.mean(effort**2, axis=0)) * rng.normal(size=effort.shape)
    return replace(log, effort=effort)


def outcome(robot: str, case: Case) -> dict[str, Any]:
    """What both commands say."""
    training = case.training(log_of(robot, 0, case, case.locked, case.loaded))
    other = case.other(log_of(robot, 1, case, False, False))
    said = {"robot": robot, "kind": case.kind, "case": case.name}
    try:
        result = identify(robot, training, **dict(case.options))
    except InputError as refused:  # such as positions beyond the limits of a joint
        return said | {"identify": 2, "verify": None, "verdict": str(refused), "right": case.wrong}
    checked = verify(result, other)
    return said | {
        "identify": int(bool(result.doubts)),
        "verify": int(not checked.holds),
        "error": checked.relative_error,
        "contradicted": list(checked.verdict.contradicted),
        "verdict": checked.verdict.text,
        "right": (not checked.holds) == case.wrong and not (result.doubts and checked.holds),
    }


def outcomes(robots: Sequence[str]) -> Iterator[dict[str, Any]]:
    """All cases of some robots, printed as they come."""
    for robot in robots:
        for case in CASES:
            result = outcome(robot, case)
            print(f"{robot:6} {case.kind:15} {case.name:45} identify {result['identify']} verify {result['verify']} "
                  f"{'' if result['right'] else 'WRONG: ' + result['verdict']}", flush=True)  # fmt: skip
            yield result


def text_of(rows: Sequence[dict[str, Any]]) -> str:
    """Cases by kind: how many are refused by which command, and how many verdicts are right."""
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        own = [row for row in rows if row["kind"] == kind]
        counts = [sum(bool(row[key]) for row in own) for key in ("identify", "verify", "right")]
        lines.append([kind, len(own), *counts])
    columns = ("robot", "kind", "case", "identify", "verify", "verdict")
    failed = [[row[key] for key in columns] for row in rows if not row["right"]]
    head = ["truth", "cases", "refused by `identify`", "refused by `verify`", "verdict right"]
    parts = [record.table(head, lines)]
    if failed:
        parts.append(record.table(["robot", "truth", "case", "identify ends with", "verify", "verdict"], failed))
    return "\n\n".join(parts)


def main() -> None:
    """Run all cases, and write the table."""
    before = record.load()
    rows = list(outcomes(sys.argv[1:] or ROBOTS))
    record.save("verdicts", before, {"cases": rows}, text_of(rows), LIMITATIONS)


LIMITATIONS = (
    "Simulated robots of four descriptions with Coulomb and viscous friction, one training motion and one other motion "
    "each, white noise; one seed.",
    "A verdict is right where `verify` ends with 1 for a wrong result and with 0 for a right one, and where `identify` "
    "does not end with 1 while `verify` ends with 0; or where `identify` refuses the log of a wrong one with 2.",
)

if __name__ == "__main__":
    main()
