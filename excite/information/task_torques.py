"""Torques that a robot's work needs, as rows in base columns: of a stated motion, or of states within the limits."""

from __future__ import annotations

import numpy as np

from excite.information.target import IdentificationTarget, model_of
from excite.information.weighting import weighting_of
from excite.tasks.stored_files import UnopenedFile
from excite.tasks.task import Task
from excite.tasks.task_motion import TaskMotion
from regressors.errors import InputError
from regressors.models.base import random_states
from regressors.samples import Array, Samples

STATES, SEED = 500, 0  # where no motion is stated


def task_torques(target: IdentificationTarget, task: Task) -> Array:
    """Regressor of the torques to be predicted, in the criterion's columns, shape (K, b).

    Torques are those of the moving coordinates, divided by their noise where the criterion's rows are. Without a stated
    motion they are those of `STATES` independent states, uniform within the limits of position, velocity and
    acceleration, with the seed `SEED`. Joints that the moving robot does not have count as at rest.
    """
    model = model_of(target.robot, task).instantaneous().restricted(target.motion, task.model.equations)
    states = _states(target, task)
    Y = model.instants(states)[:, [model.names.index(name) for name in target.base.names]]
    weighting = weighting_of(target, task)
    if target.model.window is None:
        Y = weighting.rows(Y)
    return np.asarray(Y @ weighting.transform)


def _states(target: IdentificationTarget, task: Task) -> Samples:
    motion, names = task.objective.task_motion, target.robot.joint_names
    if motion is None:
        return target.motion.states(random_states(target.robot, STATES, SEED))
    if isinstance(motion, UnopenedFile):
        raise motion.missing()
    assert isinstance(motion, TaskMotion), "the formulation reads files"
    missing = [name for name in names if name not in motion.joints]
    if missing:
        raise InputError(
            f"task_motion {motion.name} has the joints {', '.join(motion.joints)}; the design needs also "
            f"{', '.join(missing)}"
        )
    order = [motion.joints.index(name) for name in names]
    zero = np.zeros((len(motion.q), len(names)))
    time = np.arange(len(motion.q), dtype=float)
    return Samples(time, motion.q[:, order], motion.dq[:, order], motion.ddq[:, order], zero)
