"""Actuators of a compiled MuJoCo model as its joints feel them: largest torque, reflected inertia and damping."""

from __future__ import annotations

from typing import Any

import numpy as np

from regressors.robot.inertia import Array


def joint_actuators(model: Any) -> list[list[int]]:
    """Numbers of the actuators that act on a joint directly, for every joint."""
    import mujoco

    direct = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    of_joint: list[list[int]] = [[] for _ in range(model.njnt)]
    if len(model.actuator_gear) == len(model.actuator_trntype):  # actuators of several outputs count otherwise
        for actuator, kind in enumerate(model.actuator_trntype.tolist()):
            if kind in direct:
                of_joint[int(model.actuator_trnid[actuator, 0])].append(actuator)
    return of_joint


def torque_limit(model: Any, joint: int, actuators: list[int]) -> float:
    """Largest torque or force of a joint to both sides [Nm or N]; infinite where the model states none.

    It is the smaller one of ``actuatorfrcrange`` and of what the actuators give together: ``|gear|`` times the limits
    of their force, or of the control of a plain motor. Of an uneven range the smaller side counts; a range to one side
    only is not taken for a limit.
    """
    of_joint = _reach(model.jnt_actfrcrange[joint]) if model.jnt_actfrclimited[joint] else np.inf
    given = sum(abs(float(model.actuator_gear[k, 0])) * _force(model, k) for k in actuators) if actuators else np.inf
    return min(of_joint, given)


def reflected(model: Any, values: str, actuators: list[int]) -> float:
    """Inertia or damping of the actuators as their joint feels it, ``sum gear^2 x value``."""
    own = getattr(model, values, None)
    return 0.0 if own is None else float(sum(model.actuator_gear[k, 0] ** 2 * own[k] for k in actuators))


def _force(model: Any, actuator: int) -> float:
    import mujoco

    force = _reach(model.actuator_forcerange[actuator]) if model.actuator_forcelimited[actuator] else np.inf
    plain = (
        int(model.actuator_gaintype[actuator]) == mujoco.mjtGain.mjGAIN_FIXED
        and int(model.actuator_biastype[actuator]) == mujoco.mjtBias.mjBIAS_NONE
        and int(model.actuator_dyntype[actuator]) == mujoco.mjtDyn.mjDYN_NONE
    )
    if plain and model.actuator_ctrllimited[actuator]:
        force = min(force, abs(float(model.actuator_gainprm[actuator, 0])) * _reach(model.actuator_ctrlrange[actuator]))
    return force


def _reach(bounds: Array) -> float:
    lower, upper = (float(bound) for bound in bounds)
    return min(-lower, upper) if lower < 0.0 < upper else np.inf
