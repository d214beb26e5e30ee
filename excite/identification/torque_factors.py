"""Factors on the measured torques of the drives, where their gains are not the stated ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from excite.identification.recipe import Factors
from regressors.errors import InputError, UnknownName
from regressors.friction.friction_drives import drives_with_friction, torques_at_drives
from regressors.robot.robot import Robot
from regressors.samples import Array

if TYPE_CHECKING:
    from excite.logs.log import Log


def drives_of_torques(robot: Robot, *, each: bool) -> tuple[tuple[str, ...], Array]:
    """Drives whose torques are measured, and the matrix D from joint torques to theirs."""
    names = tuple(name for name, _ in drives_with_friction(robot))
    if len(names) == robot.n:
        return names, torques_at_drives(robot)
    if each:
        raise InputError(
            f"the torques of {robot.n} joints do not determine the gains of {len(names)} drives ({', '.join(names)}); "
            "give `gains='common'`"
        )
    return robot.joint_names, np.eye(robot.n)


def corrected(log: Log, robot: Robot, factors: Factors | Mapping[str, float] | None) -> Log:
    """A log of the moving joints whose torques are in corrected gains."""
    if not factors:
        return log
    if log.effort is None:
        raise InputError(f"{log.source}: `torque_factors` are for joint torques, which it does not have")
    return replace(log, effort=log.effort @ correction(robot, dict(factors)).T)


def correction(robot: Robot, factors: Mapping[str, float]) -> Array:
    """``D^-1 diag(g) D``, which corrects joint torques, shape (n, n)."""
    known = {*(name for name, _ in drives_with_friction(robot)), *robot.joint_names}
    for name in factors:
        if name not in known:
            raise UnknownName("drive", name, sorted(known))
    names, D = drives_of_torques(robot, each=len(set(factors.values())) > 1)
    g = np.array([factors.get(name, 1.0) for name in names])
    return np.asarray(np.linalg.solve(D, g[:, None] * D))


def corrections(robot: Robot, torque: Array, factors: Mapping[str, float], *, common: bool) -> Array:
    """Change of corrected joint torques with the factors, shape (k, N, n); k is 1 for a common factor."""
    # torque (N, n)
    if common:
        return np.asarray(torque / next(iter(factors.values())))[None]
    names, D = drives_of_torques(robot, each=True)
    at_drives = torque @ D.T
    parts = [np.outer(at_drives[:, k] / factors[name], np.linalg.inv(D)[:, k]) for k, name in enumerate(names)]
    return np.array(parts)
