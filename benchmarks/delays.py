"""Delays of the torques that ``identify`` finds with plain defaults, beside those that simulated logs have.

``python benchmarks/delays.py`` simulates logs of three robots at four rates whose torques are late by a fraction of a
sample to 50 ms: all of them, those of single joints, or those of single logs. The motion is a Fourier series, so that
the torque that is recorded at t is computed at ``t - delay`` itself; nothing is shifted, interpolated or filtered.
``--robots`` runs fewer, ``--seed`` others. A run that was stopped goes on where it was, but with ``--again``. Seeds are
fixed; thresholds were set on others, below 1000.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parent / "spoilt_logs"))
sys.path.insert(0, str(Path(__file__).resolve().parent / "coverage"))

import numpy as np
import record
from noise import NOISES
from spoilt import true_robot
from threadpoolctl import threadpool_limits

import excite
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion
from excite.identification.equations import measured_regressor
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, target_of
from excite.logs.log import Log
from excite.registry import CHOSEN
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.models.nominal import parameter_values, standard_values
from regressors.readers.library import load_robot
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.samples import Array

HERE = Path(__file__).resolve().parent
RATES = {"irp6": (100.0, 125.0, 200.0, 500.0), "panda": (100.0,), "ur10e": (100.0, 125.0)}
FASTEST, EACH = "irp6", ("irp6", "ur10e")  # robots with most logs, and with delays of single joints and logs
SHARES = (0.0, 0.3, 1.25)  # delays, of a sample
TIMES = (0.005, -0.005, 0.010, -0.020, 0.020, 0.040)  # delays [s]
LEVEL, ENCODER = 0.02, 1e-5  # noise, of each joint's root mean square; step of the positions [rad]
NOISE_KINDS = ("white", "autoregressive")
FIRST = 1000  # seed
PRESLIDING, FINE = (1e-3, 2e-3, 4e-3), 10  # distances [rad], and instants per sample that they are followed on
OF_EACH = 1.5e-3, 6e-3  # range of the distances, where each drive has its own [rad]
ONE_LATE = (0.010, -0.005, 0.020)  # delay of a single joint [s]
OF_LOGS = ((0.0, 0.012), (0.004, 0.004, 0.020), (0.006, 0.006))  # delays of several logs [s]
LEAD = 1.0  # time that is not recorded then, since friction is to have a direction at the first row [s]
PERIOD, HARMONICS = 10.0, 5
UNSEEN = 1000  # added to the seed of a log's motion


@dataclass(frozen=True)
class Case:
    """A log, or several, of a robot, and by how much torques are late in each [s], for all joints or for each."""

    robot: str
    rate: float
    noise: str
    delays: tuple[float | tuple[float, ...], ...]
    seed: int
    # distance over which friction changes its direction, or each drive's; 0 for the sign of the velocity [rad]
    breakaway: float | tuple[float, ...] = 0.0

    @property
    def name(self) -> str:
        """Key of its result."""
        late = "; ".join(", ".join(f"{1e3 * d:.4g}" for d in np.atleast_1d(delay)) for delay in self.delays)
        over = ", ".join(f"{1e3 * one:g}" for one in np.atleast_1d(self.breakaway).tolist())
        own = " of each drive" if isinstance(self.breakaway, tuple) else ""
        kind = f"{self.noise}, presliding{own} over {over} mrad" if self.breakaway else self.noise
        return f"{self.robot}, {self.rate:g} Hz, {kind}, {late} ms, {self.seed}"


def common_cases(robots: Sequence[str], first: int) -> list[Case]:
    """Logs all of whose torques are late: every other delay of the fastest robot, fewer of the others, and none."""
    cases = []
    for robot, (k, rate) in [(name, each) for name in robots for each in enumerate(RATES[name])]:
        delays = [*(share / rate for share in SHARES), *TIMES]
        used = sorted({0.0, *(delays[k % 2 :: 2] if robot == FASTEST else delays[3 + k : 4 + k])})
        cases += [
            Case(robot, rate, noise, (delay,), first + j % 3)
            for j, delay in enumerate(used)
            for noise in (NOISE_KINDS if not delay and robot == FASTEST else NOISE_KINDS[(j + k) % 2 :][:1])
        ]
        cases += [
            Case(robot, rate, NOISE_KINDS[(j + k) % 2], (delay,), first + 3 + j, PRESLIDING[(j + k) % 3])
            for j in range(3 if robot == FASTEST else 1)
            for delay in (0.0, (0.01, 1.25 / rate, 0.03)[(j + k) % 3])
        ]
        drives = len(friction_rows(_target(robot, first + 9 + k).robot))
        cases += [
            Case(robot, rate, NOISE_KINDS[j % 2], (delay,), first + 9 + k, _distances(drives, first + 9 + k))
            for j, delay in enumerate((0.0, (0.01, 1.25 / rate, 0.03)[k % 3]))
        ]
    return cases


def _distances(drives: int, seed: int) -> tuple[float, ...]:
    """Presliding of each drive, spread evenly over a factor of four."""
    size = np.random.default_rng(seed).uniform(*np.log(OF_EACH), drives)
    return tuple(np.round(np.exp(size), 5).tolist())


def cases_of_each(robots: Sequence[str], first: int) -> list[Case]:
    """Logs in which one joint is late, or each by its own delay, and several logs with delays of their own."""
    cases = []
    for robot, (k, rate) in [(name, each) for name in robots if name in EACH for each in enumerate(RATES[name])]:
        n, rng = _target(robot, first).robot.n, np.random.default_rng(first + k)
        one = tuple(ONE_LATE[k % 3] if j == k % n else 0.0 for j in range(n))
        every = tuple(np.round(rng.uniform(0.0, 0.02, n), 4).tolist())
        delays = [(one,), (every,), *([OF_LOGS[k % 3]] if robot == FASTEST or not k else [])]
        cases += [
            Case(robot, rate, NOISE_KINDS[(j + k) % 2], late, first + 6 + j, (0.0, PRESLIDING[1])[(j + k) % 2])
            for j, late in enumerate(delays)
        ]
    return cases


@cache
def _target(robot: str, seed: int) -> IdentificationTarget:
    """The robot itself, with the friction and rotors of its drives."""
    described = true_robot(robot, seed)
    return target_of(described, Task(robot).changed(robot=described))


@cache
def _motion(robot: str, seed: int) -> Trajectory:
    problem = formulate(load_robot(robot), Task(robot, harmonics=HARMONICS, period=PERIOD)).problem
    return Trajectory(problem.family, random_motion(problem, np.random.default_rng(seed)))


def simulated(case: Case, number: int, *, unseen: bool = False) -> tuple[Log, Array]:
    """One log of a case, and its torques without noise, shape (N, n)."""
    seed = case.seed + 10 * number + (UNSEEN if unseen else 0)
    target, motion = _target(case.robot, case.seed), _motion(case.robot, seed)
    every, skipped = (FINE, round(LEAD * case.rate)) if case.breakaway else (1, 0)
    path = np.arange(round(PERIOD * case.rate) * every + 1) / case.rate / every
    instants = path[skipped * every :: every]
    beta = parameter_values(target.model, target.base, standard_values(target.robot))
    late = np.broadcast_to(case.delays[number], target.robot.n)
    exact = np.empty((instants.size, target.robot.n))
    for delay in np.unique(late):
        torques = measured_regressor(target, motion.samples(path - delay), case.breakaway) @ beta
        exact[:, late == delay] = torques.reshape(path.size, -1)[skipped * every :: every, late == delay]
    rng = np.random.default_rng([seed, round(case.rate), len(case.noise)])
    noise = NOISES[case.noise](rng, (1, *exact.shape), case.rate)[0]
    effort = exact + LEVEL * np.sqrt(np.mean(exact**2, axis=0)) * noise
    q = ENCODER * np.round(motion.samples(instants).q / ENCODER)
    label = f"{case.name}, log {number + 1}{', unseen' if unseen else ''}"
    return Log(label, label, target.robot.joint_names, instants, q, None, effort), exact


def run(case: Case) -> dict[str, Any]:
    """What plain defaults find, and the errors of unseen torques, with what is found and with the true delays."""
    logs = [simulated(case, number)[0] for number in range(len(case.delays))]
    began = time.process_time()
    found = excite.identify(case.robot, logs)
    cpu = time.process_time() - began
    choice = next((one for one in found.choices if one.name == "delay"), None)
    first, further = case.delays[0], {}
    if isinstance(first, float):
        further = {log.source: late - first for log, late in zip(logs, case.delays, strict=True) if late != first}
    known = excite.identify(case.robot, logs, recipe=Recipe(delay=first, log_delays=further), choose=_BUT_DELAY)
    intervals = [] if choice is None else list(choice.intervals or ([choice.interval] if choice.interval else []))
    return {
        "true": list(first if isinstance(first, tuple) else case.delays),
        "found": np.atleast_1d(0.0 if choice is None else choice.value).tolist(),
        "intervals": intervals,
        "errors": [unseen_error(case, one) for one in (found, known)],
        "cpu": round(cpu, 1),
    }


_BUT_DELAY = tuple(name for name in CHOSEN if name != "delay")


def unseen_error(case: Case, result: excite.Identification) -> float:
    """Relative error of torques of another motion, which have no noise."""
    log, exact = simulated(case, 0, unseen=True)
    judged = excite.verify(result, log)
    true = np.column_stack([np.interp(judged.time, log.time, column) for column in exact.T])
    return float(np.linalg.norm(judged.predicted - true) / np.linalg.norm(true))


def text_of(results: dict[str, dict[str, Any]]) -> str:
    """What holds; and one line per delay, per robot and rate, and per case with several delays."""
    several = {name: one for name, one in results.items() if len(one["true"]) > 1}
    common = {name: one for name, one in results.items() if name not in several}
    by_delay: dict[str, list[dict[str, Any]]] = {}
    by_robot: dict[str, list[dict[str, Any]]] = {}
    for name, one in common.items():
        robot, rate, *_ = name.split(", ")
        share = one["true"][0] * float(rate.split()[0])
        shares = [s for s in SHARES if abs(share - s) < 1e-9]
        words = f"{shares[0]:g} samples" if shares else f"{1e3 * one['true'][0]:g} ms"
        words = "none" if shares == [0.0] else words
        kind = next((f", {kind}" for kind in KINDS[1:] if f"{kind} over" in name), "")
        by_delay.setdefault(f"{words}{kind}", []).append(one)
        by_robot.setdefault(f"{robot}, {rate}", []).append(one)
    return (
        f"{''.join(_counted(kind, _of_kind(kind, common)) for kind in KINDS)}"
        f"{_counted_of_each('joints', [one for name, one in several.items() if '; ' not in name])}"
        f"{_counted_of_each('logs', [one for name, one in several.items() if '; ' in name])}\n"
        f"{_lines('true delay', by_delay)}\n\n{_lines('robot, rate', by_robot)}\n\n{_lines_of_each(several)}"
    )


KINDS = ("Coulomb friction", "presliding", "presliding of each drive")


def _of_kind(kind: str, lines: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    return [one for name, one in lines.items() if (f"{kind} over" in name if kind != KINDS[0] else " over" not in name)]


def _counted(friction: str, logs: list[dict[str, Any]]) -> str:
    late, none = ([one for one in logs if any(one["true"]) == is_late] for is_late in (True, False))
    found = [one for one in late if any(one["found"])]
    false = sum(any(one["found"]) for one in none)
    return (
        f"With {friction}, {len(found)} of {len(late)} delays are found, of which {sum(map(_holds, found))} are in the "
        f"stated interval; {false} of {len(none)} logs without delay are given one.\n"
    )


def _counted_of_each(what: str, cases: list[dict[str, Any]]) -> str:
    """How many cases with different delays are told apart, and how many delays are in their intervals."""
    unlike = [one for one in cases if len(set(one["true"])) > 1]
    apart = [one for one in unlike if len(one["found"]) > 1]
    inside = [low <= x <= high for one in apart for x, (low, high) in zip(one["true"], one["intervals"], strict=True)]
    false = sum(len(one["found"]) > 1 for one in cases if one not in unlike)
    other = [(x, one["intervals"][0]) for one in unlike if len(one["intervals"]) == 1 for x in one["true"]]
    held = sum(low <= x <= high for x, (low, high) in other)
    return (
        f"Of {len(unlike)} cases whose {what} have different delays, {len(apart)} are given delays of their own, of "
        f"which {sum(inside)} of {len(inside)} are in the stated intervals; the one interval of the others holds "
        f"{held} of {len(other)}; "
        f"{false} of {len(cases) - len(unlike)} with one delay are.\n"
    )


def _holds(one: dict[str, Any]) -> bool:
    return len(one["intervals"]) == 1 and bool(one["intervals"][0][0] <= one["true"][0] <= one["intervals"][0][1])


def _lines(what: str, groups: dict[str, list[dict[str, Any]]]) -> str:
    rows = []
    for name, own in groups.items():
        error = np.array([np.abs(np.array(one["found"]) - one["true"][0]).max() for one in own])
        stated = [one for one in own if one["intervals"] and any(one["found"])]
        half = [np.ptp(one["intervals"], axis=1).max() / 2 for one in stated]
        ratio = [one["errors"][0] / one["errors"][1] for one in own]
        rows.append(
            [
                name,
                len(own),
                sum(any(one["found"]) for one in own),
                f"{1e3 * np.median(error):.2g}, {1e3 * error.max():.2g}",
                f"{sum(map(_holds, stated))} of {len(stated)}",
                f"{1e3 * np.median(half):.2g}" if half else "",
                f"{np.median(ratio):.2f}, {max(ratio):.2f}",
                f"{sum(one['cpu'] for one in own) / len(own):.1f}",
            ]
        )
    head = [
        what, "logs", "delay found", "error of the delay, median and largest [ms]", "in the stated interval",
        "half width, median [ms]", "unseen error over that with the true delay, median and largest", "CPU s",
    ]  # fmt: skip
    return record.table(head, rows)


def _lines_of_each(cases: dict[str, dict[str, Any]]) -> str:
    rows = []
    for name, one in cases.items():
        ends = [f"{1e3 * low:.1f} to {1e3 * high:.1f}" for low, high in one["intervals"]]
        found = ", ".join(f"{1e3 * late:.3g}" for late in one["found"])
        rows.append([name, found, ", ".join(ends), f"{one['errors'][0] / one['errors'][1]:.2f}", f"{one['cpu']:.1f}"])
    head = [
        "true delays of the joints, or of the logs",
        "found [ms]",
        "intervals [ms]",
        "unseen error, as above",
        "CPU s",
    ]
    return record.table(head, rows)


LIMITATIONS = (
    "The positions have no delay of their own and the robots are rigid; Coulomb friction has the exact sign of the "
    "velocity, or the presliding of Dahl's model over the distance that is said, and bodies differ from the "
    "description by up to 15 %. Presliding of another form, such as a linear stretch before break-away, is not in it.",
    f"Noise is {100 * LEVEL:g} % of each joint's rms, white or autoregressive (0.9 from sample to sample); positions "
    f"have steps of {ENCODER:g} rad; one Fourier motion of {PERIOD:g} s each.",
    "Thresholds were set on seeds below 1000; these logs have others.",
    "The unseen error is that of torques without noise, of another motion with the same delay.",
)


def main() -> None:
    """Run what is not stored, and write the tables."""
    before = record.load()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", default=",".join(RATES))
    parser.add_argument("--seed", type=int, default=FIRST, help="of the first log; others are printed only")
    parser.add_argument("--again", action="store_true", help="run again what is stored")
    a = parser.parse_args()
    file = HERE / "results" / ("delays_lines.json" if a.seed == FIRST else f"delays_{a.seed}.part")
    lines: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.exists() and not a.again else {}
    with threadpool_limits(1):
        robots = a.robots.split(",")
        for case in (*common_cases(robots, a.seed), *cases_of_each(robots, a.seed)):
            if case.name not in lines:
                lines[case.name] = run(case)
                print(case.name, lines[case.name], flush=True)
                file.write_text(json.dumps(lines) + "\n", encoding="utf-8")
    if a.seed != FIRST:
        print(text_of(lines))
    else:
        file.unlink()
        record.save("delays", before, {"logs": lines}, text_of(lines), LIMITATIONS)


if __name__ == "__main__":
    main()
