"""A verification read from its file, with what its figures draw."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from excite.files.curves_file import Arrays
from excite.files.verification_curves import replay_of
from excite.identification.preparation import PreparedLog
from excite.logs.log import Log
from excite.verification.predicted_torques import TorqueError
from excite.verification.simulated_motion import MotionError
from excite.verification.verdict import Tolerances, Verdict
from excite.verification.verification import Verification
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_TORQUES = tuple(TorqueError.__dataclass_fields__)
_MOTIONS = tuple(MotionError.__dataclass_fields__)


def restored_verification(content: Mapping[str, Any], arrays: Arrays, robot: Robot) -> Verification:
    """The verification of a file, at the instants that its curves have.

    Parameters
    ----------
    content : mapping
        Of the file.
    arrays : dict
        See `excite.files.verification_curves`.
    robot : Robot
        Of the result.
    """
    torques = tuple(TorqueError(**_numbers(each, _TORQUES)) for each in content["torques"])
    motions = content["motions"]
    relative = content["relative_error"]
    return Verification(
        robot=robot,
        tolerances=Tolerances(**content["tolerances"]),
        prepared=_prepared(content["log"], arrays),
        equations=tuple((error.name, error.unit) for error in torques),
        time=arrays["time"],
        measured=arrays["measured"].astype(float),
        predicted=arrays["predicted"].astype(float),
        torques=torques,
        relative_error=math.inf if relative is None else relative,
        training_error=content["training_error"],
        replay=replay_of(arrays),
        motions=None if motions is None else tuple(MotionError(**_numbers(each, _MOTIONS)) for each in motions),
        verdict=Verdict(content["holds"], tuple(content["against"]), tuple(content["remarks"])),
        horizon=content.get("horizon"),
    )


def _numbers(each: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    """Entries of these names; what was not finite is infinite again."""
    return {name: math.inf if each[name] is None else each[name] for name in names}


def _prepared(log: Mapping[str, Any], arrays: Arrays) -> PreparedLog:
    """The measured motion at the instants of the simulated one, where there is one."""
    joints = tuple(map(str, arrays["joints"]))
    simulated = "replay_time" in arrays
    time, q = (arrays[n] for n in (("replay_time", "replay_measured") if simulated else ("motion_time", "motion_q")))
    samples = _still(time, q.astype(float))
    recorded = Log(str(log["file"]), str(log["sha256"]), joints, time, samples.q)
    return PreparedLog(recorded, samples, np.zeros((time.size, 0)), tuple(log["notes"]))


def _still(time: Array, q: Array) -> Samples:
    """Positions alone."""
    return Samples(time, q, np.zeros_like(q), np.zeros_like(q), np.zeros_like(q))
