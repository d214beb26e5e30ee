"""Identified servos as drives and limits that files can hold, and comments that tell all of them.

Simulators know a constant friction ``F``. It stands for all that resists a slow motion: the constant part, the share of
a typical load, and the torque that the dead band withholds,

    ``F = Fc + mu tau + K delta``

where tau is the root mean square of the torque of gravity over poses within the limits of the joints. Where friction
cannot depend on the speed, 3/4 of Fs is in it too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from excite.export.models.exported_model import PACKAGE
from excite.export.models.identified_model import DrivenRobot, ModelDrive
from excite.identification.result_json import RESULT
from excite.identification.servo_result import SERVOS, ServoResult, load_servos
from excite.storage.manifest import sha256_of
from regressors.models.servo_response import QUANTITIES, SYMBOLS, arm_torques
from regressors.robot.gears import ConstantRatio
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class ServoRobot(DrivenRobot):
    """A robot with identified servos, its bodies as described."""

    result: ServoResult
    resisting: Array  # (n,) F without a part of Fs [Nm or N]
    origin: str

    @property
    def notes(self) -> tuple[str, ...]:
        """What the logs do not show."""
        known = zip(self.robot.joint_names, self.result.known, strict=True)
        rows = {name: " ".join(np.array(SYMBOLS)[~shown]) for name, shown in known if not shown.all()}
        unknown = "; ".join(f"{name}: {symbols}" for name, symbols in rows.items())
        words = "the logs do not show these, which are written as what predicts best together with the rest"
        return (f"{words}: {unknown}",) if unknown else ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """What a file that is written from the description does not hold."""
        bodies = ", ".join(branch.name for branch in self.robot.branches)
        words = "the bodies beside the chain are not written; give a file of your own as `robot_file`"
        return (f"{words}: {bodies}",) if bodies else ()

    @property
    def comment(self) -> tuple[str, ...]:
        """Where the servos come from, and every quantity with the half of its 99 % interval."""
        rows = zip(self.result.stated.items(), self.result.known, strict=True)
        servos = [f"{name}: {', '.join(map(_cell, quantities.values(), known))}" for (name, quantities), known in rows]
        legend = ", ".join(f"{quantity.symbol} {quantity.name}" for quantity in QUANTITIES)
        return (self.origin, f"{legend}; ? is not known to half of its value", *servos)


def _cell(quantity: dict[str, Any], known: bool) -> str:
    text = f"{quantity['symbol']} {quantity['value']:.4g} +- {quantity['half_width']:.2g} {quantity['unit']}"
    return text if known else f"{text} ?"


def servos_in(given: object) -> ServoRobot | None:
    """The robot of servos, or of those in a folder or a file; None where there are none."""
    sha256 = None
    if isinstance(given, str | Path):
        path = Path(given)
        file = path if path.suffix == ".json" or (path / RESULT).exists() else path / SERVOS
        if file.name != SERVOS or not file.is_file():
            return None
        given, sha256 = load_servos(file), sha256_of(file)
    return servo_robot(given, sha256) if isinstance(given, ServoResult) else None


def servo_robot(result: ServoResult, sha256: str | None) -> ServoRobot:
    """Robot with the drives and limits that servos make of it."""
    robot, K, D, J = result.robot, *map(result.of, "KDJ")
    resisting = result.of("Fc") + result.of("mu") * gravity_load(robot) + K * result.of("delta")
    friction, rows = resisting + _STRIBECK * result.of("Fs"), np.eye(robot.n)
    drives = [
        ModelDrive(k + 1, name, rows[k], ConstantRatio(), True, float(J[k]), float(friction[k]), float(D[k]))
        for k, name in enumerate(robot.joint_names)
    ]
    torque, speed = result.torque_limit, np.minimum(result.speed_limit, robot.limits.velocity)
    limits = replace(robot.limits, torque=np.where(np.isfinite(torque), torque, robot.limits.torque), velocity=speed)
    program = f"{PACKAGE} {version(PACKAGE)}"
    source = "servos that were not saved" if sha256 is None else f"servos.json with SHA-256 {sha256}"
    return ServoRobot(
        robot=robot.replace(limits=limits),
        described=robot,
        composites={},
        carriers=(),
        drives=tuple(drives),
        program=program,
        result=result,
        resisting=resisting,
        origin=f"identified servos of robot {robot.name}, written by {program} from {source}",
    )


FRICTION = (
    "friction that does not depend on the speed is Fc, K delta (what the dead band withholds), and mu (the load share) "
    "times the root mean square of gravity's torque over poses"
)
_STRIBECK = 0.75  # of Fs, from the two logs that benchmarks/servo/export.py identifies from
_POSES = 1000
_FREE = np.pi  # of joints without limits [rad or m]


def gravity_load(robot: Robot) -> Array:
    """Root mean square of the torque of gravity at each joint over poses within its limits, shape (n,) [Nm or N]."""
    lower, upper = (np.clip(bound, -_FREE, _FREE) for bound in (robot.limits.lower, robot.limits.upper))
    q = np.random.default_rng(0).uniform(lower, upper, (_POSES, robot.n))
    load, _ = arm_torques(robot)(q, 0.0 * q, 0.0 * q)
    return np.asarray(np.sqrt(np.mean(load**2, axis=0)))
