"""Moving drives of a target, and notes on friction parameters that known friction leaves out."""

from __future__ import annotations

import numpy as np

from excite.information.target import IdentificationTarget
from excite.tasks.drive_choice import DriveChoice, numbers_of
from excite.tasks.model_choice import FURTHER_FRICTION, ModelChoice
from regressors.friction.curves import FrictionCurves, drives_with_friction
from regressors.friction.load_share import moving_drive_numbers

_NOTHING = 1e-12  # of a drive's velocity along the motion


def turning_drives(target: IdentificationTarget) -> tuple[str, ...]:
    """Names of the drives that turn in a target's motions."""
    drives = drives_with_friction(target.robot)
    return tuple(name for name, row in drives if np.any(np.abs(row @ target.motion.matrix) > _NOTHING))


def left_out_notes(asked: ModelChoice, target: IdentificationTarget, curves: FrictionCurves) -> tuple[str, ...]:
    """Note on further friction parameters that were asked for, but only of turning drives whose friction is known."""
    numbers = moving_drive_numbers(target.robot)
    turning = {numbers[name] for name in turning_drives(target)}

    def some(chosen: DriveChoice, known: FrictionCurves | None) -> bool:
        left = numbers_of(chosen, target.robot, known)
        return left if isinstance(left, bool) else bool(turning.intersection(left))

    choices = {name.replace("_", " "): getattr(asked, name) for name in FURTHER_FRICTION}
    names = [name for name, chosen in choices.items() if some(chosen, None) and not some(chosen, curves)]
    return (f"{', '.join(names)} columns are left out: friction is known",) if names else ()
