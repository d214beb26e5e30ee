"""What is in hand before a design: results and designs that a task names, read once, and the noise they measured."""

from __future__ import annotations

from excite.information.earlier_precision import check_earlier, noise_in_hand
from excite.information.target import motion_of, moving_robot
from excite.registry import built_in
from excite.tasks.task import Task
from regressors.robot.robot import Robot


def with_information_in_hand(robot: Robot, task: Task) -> Task:
    """The task with the information itself of the results and designs that it names, so that a design can hold it.

    Where the task states no noise, it is that of the results, else that of the designs.
    """
    if not task.objective.after:
        return task
    earlier = tuple(built_in("reader", "earlier")(each) for each in task.objective.after)
    moving = moving_robot(robot, task)
    check_earlier(earlier, robot, moving, task)
    motion = motion_of(task.limits.applied(robot), moving, task)
    model = task.model.built(moving).restricted(motion, task.model.equations)
    return task.changed(after=earlier, noise=noise_in_hand(earlier, model, task))
