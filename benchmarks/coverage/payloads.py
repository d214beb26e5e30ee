"""Coverage of payloads: a Panda by Pinocchio holds a load off its axis, gains and an offset drift between the logs.

The pair of logs is of the motion of `design_payload_motion`, 5 s at 200 Hz; noise is 0.3 % of each torque's rms.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import record
from experiments import OWN, POSES
from pinocchio_chains import joint_torques

from excite.logs.log import Log
from excite.payload.held_body import HeldBody
from excite.payload.identify_payload import identify_payload
from excite.payload.payload_motion import design_payload_motion
from regressors.readers.library import built_in
from regressors.robot.inertia import from_centre_of_mass
from regressors.samples import Array, Samples

LEVEL, RATE, PERIOD = 0.003, 200.0, 5.0
MASS, ALONG, RADII = 1.5, 0.06, np.diag([0.003, 0.004, 0.002])  # [kg, m, m^2]
DRIFT, OFFSET = 0.007, 0.1  # of each gain, relative, and of the second torque [Nm]
LISTED = ("m", "cx", "cy", "cz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
PAYLOADS = {
    "payload, centre 1 cm off the axis": (0.01, 0.0),
    "payload, centre 6 cm off the axis": (0.06, 0.0),
    "payload, 1 cm off the axis, gains and an offset drift": (0.01, 1.0),
    "payload, 6 cm off the axis, gains and an offset drift": (0.06, 1.0),
}


@cache
def motion() -> Samples:
    """The motion that both logs play."""
    motion = design_payload_motion(built_in("panda"), pose=POSES["panda"], period=PERIOD, starts=2)
    return motion.design.trajectory.samples(np.arange(round(PERIOD * RATE) + 1) / RATE)


def payloads(name: str, count: int, seed: int) -> dict[str, Any]:
    """Coverage of mass, centre and inertia, and how often a result is doubted."""
    off, drifts = PAYLOADS[name]
    robot, samples, (coulomb, viscous) = built_in("panda"), motion(), OWN["panda"]
    load = from_centre_of_mass(MASS, (off, 0.0, ALONG), MASS * RADII)
    truth, friction = HeldBody.of(load).listed, coulomb * np.sign(samples.dq) + viscous * samples.dq
    exact = [joint_torques(robot, samples, carried) + friction for carried in (None, load)]
    began, cpu = time.monotonic(), time.process_time()
    inside, doubted = [], 0
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        bare, held = (_log(samples, tau, rng, drifts * number, f"{number} {k}") for number, tau in enumerate(exact))
        result = identify_payload(robot, held, without=bare)
        low, high = result.intervals.T
        inside.append((low <= truth) & (truth <= high))
        doubted += bool(result.doubts)
    return {
        "quantities": list(LISTED),
        "coverage": np.mean(inside, axis=0).tolist(),
        "doubted": doubted / count,
        "wall": round(time.monotonic() - began, 1),
        "cpu": round(time.process_time() - cpu, 1),
    }


def _log(samples: Samples, exact: Array, rng: np.random.Generator, drift: float, name: str) -> Log:
    """A log with noise, and with drifts where it is the second one."""
    measured = exact * (1 + drift * DRIFT * rng.normal(size=exact.shape[1]))
    measured[:, 1] += drift * OFFSET
    measured += LEVEL * np.sqrt(np.mean(exact**2, axis=0)) * rng.normal(size=exact.shape)
    log = Log("panda.csv", name, built_in("panda").joint_names, samples.time, samples.q, None, measured)
    return replace(log, source=f"log {name}")


def payload_text(results: list[dict[str, Any]]) -> str:
    """One line per case."""
    head = ["payload", "repetitions", "coverage, mean", "worst", "doubted", "CPU s", "wall s"]
    rows = []
    for r in results:
        worst = int(np.argmin(r["coverage"]))
        rows.append(
            [
                r["name"],
                r["repetitions"],
                f"{100 * np.mean(r['coverage']):.1f} %",
                f"**{100 * r['coverage'][worst]:.1f} %** {r['quantities'][worst]}",
                f"{100 * r['doubted']:.0f} %",
                f"{r['cpu']:.0f}",
                f"{r['wall']:.0f}",
            ]
        )
    return record.table(head, rows)
