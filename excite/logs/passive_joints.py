"""Logs of robots with closed loops: joints that were not recorded, and the torques of those that no drive acts on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.logs.log import Log
from regressors.errors import InputError, listed_names
from regressors.robot.robot import Robot
from regressors.robot.symbolic.loops import Loops, loops_of
from regressors.samples import Array, Samples


def with_every_joint(log: Log, robot: Robot) -> Log:
    """The log with the dependent joints that it lacks, from the independent ones; passive joints have no torque."""
    loops, names = loops_of(robot), robot.joint_names
    absent = [name for name in names if name not in log.joints]
    driven = [names[k] for k in sorted({*loops.independent, *loops.driven})]
    if missing := [name for name in driven if name in absent]:
        raise InputError(
            f"{log.source}: no position of {listed_names(missing)}; give those of {listed_names(driven)}, from which "
            "the loops determine all others, or of all joints; or state in the description of the robot which joints "
            "have no drive (`passive`)"
        )
    acting = [name for name in robot.passive if name in log.joints and _acts(log, name)]
    if acting:
        raise InputError(
            f"{log.source}: torques of {listed_names(acting)} are not zero, but no drive acts on passive joints; leave "
            "these columns out, or take these joints from `passive` in the description of the robot"
        )
    if not absent:
        return log
    known = log.of([name for name in names if name not in absent])
    place = [names.index(name) for name in known.joints]
    q, dq = _solved(log, loops)
    q[:, place] = known.q
    effort = None if known.effort is None else np.zeros(q.shape)
    if effort is not None:
        effort[:, place] = known.effort
    note = f"{', '.join(absent)}: not in the log, solved from {', '.join(loops.names)}"
    return replace(
        log,
        joints=names,
        q=q,
        dq=None if known.dq is None else dq,
        effort=effort,
        temperature=None if known.temperature is None else np.tile(known.temperature.mean(axis=1), (robot.n, 1)).T,
        command=None,
        left_out=(*log.left_out, note),
    )


def _acts(log: Log, name: str) -> bool:
    return log.effort is not None and bool(np.any(log.effort[:, log.joints.index(name)]))


def _solved(log: Log, loops: Loops) -> tuple[Array, Array]:
    """Positions and velocities of all joints, as the independent ones move."""
    recorded = log.of(loops.names)
    q, left = loops.reached(recorded.q)
    loops.check(log.time, q, left, log.source)
    dq, still = np.zeros(q.shape), np.zeros(q.shape)
    if recorded.dq is not None:
        dq[:, list(loops.independent)] = recorded.dq
    return q, loops.rates(Samples(log.time, q, dq, still, still)).dq
