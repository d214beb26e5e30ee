"""The motion whose torques a design is to predict, from a design or a file."""

from __future__ import annotations

import numpy as np

from excite.design.designed_motion import DesignedMotion
from excite.registry import built_in
from excite.tasks.stored_files import UnopenedFile
from excite.tasks.task import Task
from excite.tasks.task_motion import TaskMotion

INSTANTS = 200  # at most: enough for means over a motion, and few enough to be kept with a result


def with_task_motion(task: Task) -> Task:
    """The task with the motion itself whose torques it is to predict, so that a result can hold it."""
    given = task.objective.task_motion
    if given is None or isinstance(given, TaskMotion):
        return task
    if isinstance(given, UnopenedFile):
        raise given.missing()
    read = task_motion_of if isinstance(given, DesignedMotion) else built_in("reader", "task motion")
    return task.changed(task_motion=read(given))


def task_motion_of(design: DesignedMotion) -> TaskMotion:
    """The motion of a design at `INSTANTS` instants in equal steps."""
    motion = design.trajectory
    samples = motion.samples((np.arange(INSTANTS) + 0.5) * motion.duration / INSTANTS)
    return TaskMotion(design.name, design.moving.joint_names, samples.q, samples.dq, samples.ddq)
