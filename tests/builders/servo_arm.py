"""A small arm of servos in MuJoCo: two joints that gravity loads, and a light roll that nothing does."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from commands import module_of
from recordings import ROOT

from excite.identification.servo_result import ServoResult
from excite.identification.servos import identify_servos
from excite.logs.log import Log
from regressors.models.servo_response import SYMBOLS
from regressors.readers.urdf import read_urdf
from regressors.robot.robot import Robot
from regressors.samples import Array

JOINTS = ("lift", "elbow", "roll")
_LINK = """<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="{2}"/>
<inertia ixx="{3}" ixy="0" ixz="0" iyy="{3}" iyz="0" izz="{3}"/></inertial></link>
<joint name="{4}" type="revolute"><parent link="{5}"/><child link="{0}"/><origin xyz="{6} 0 0"/><axis xyz="{7}"/>
<limit lower="-2" upper="2" velocity="5" effort="10"/></joint>
"""
URDF = (
    '<robot name="small"><link name="base"/>'
    + _LINK.format("upper", 0.1, 0.4, 4e-4, "lift", "base", 0.0, "0 1 0")
    + _LINK.format("lower", 0.1, 0.3, 3e-4, "elbow", "upper", 0.2, "0 1 0")
    + _LINK.format("hand", 0.02, 0.02, 1e-6, "roll", "lower", 0.2, "1 0 0")
    + "</robot>"
)


@cache
def plant() -> Any:
    """The module of the benchmark that has servos in MuJoCo."""
    return module_of(ROOT / "benchmarks" / "servo" / "plant.py")


@cache
def small_arm() -> Robot:
    """The arm as its URDF describes it."""
    with tempfile.TemporaryDirectory() as folder:
        (path := Path(folder) / "small.urdf").write_text(URDF, encoding="utf-8")
        return read_urdf(path)


UNREACHED = (8.0, 8.0, 8.0)  # limits of the motors' torques [Nm]


@cache
def truth(limits: tuple[float, ...] = UNREACHED) -> Any:
    """What its servos are."""
    K, D, J = np.array([15.0, 12.0, 10.0]), np.array([0.6, 0.5, 0.4]), np.array([0.010, 0.008, 0.006])
    Fc, b = np.array([0.12, 0.10, 0.08]), np.array([0.005, -0.008, 0.002])
    return plant().Truth(K, D, J, Fc, np.array(limits), b, 0.022)


@cache
def servo_log(
    seed: int, duration: float = 60.0, limits: tuple[float, ...] = UNREACHED, held: tuple[float, ...] = ()
) -> Log:
    """What is measured of a motion of its own, at 50 Hz, in steps of the encoder, with a mass in hand or without."""
    return played(plant().motion(np.random.default_rng(seed), 3, duration, np.zeros(3)), f"log-{seed}", limits, held)


def played(
    command: Array,
    source: str,
    limits: tuple[float, ...] = UNREACHED,
    held: tuple[float, ...] = (),
    **options: float,
) -> Log:
    """What is measured of commands (N, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        (path := Path(folder) / "small.urdf").write_text(URDF, encoding="utf-8")
        model = plant().plant(path, JOINTS, truth(limits), held)
    log: Log = plant().play(model, JOINTS, truth(limits), command, source, **options)
    return log


@cache
def true_servos(**changed: float) -> ServoResult:
    """The servos as they are, or with other values for all joints, as if they had been identified."""
    t, values = truth(), np.zeros((3, len(SYMBOLS)))
    known = {"K": t.K, "D": t.D, "J": t.J, "Fc": t.Fc, "b": -t.b, "d": t.d, "L": t.L}
    for symbol, value in {**known, **changed}.items():
        values[:, SYMBOLS.index(symbol)] = value
    return ServoResult(small_arm(), values, 0 * values, (), (), 0)


@cache
def identified_servos() -> ServoResult:
    """The servos that a log of a minute shows; takes some 15 s."""
    return identify_servos(small_arm(), servo_log(0))
