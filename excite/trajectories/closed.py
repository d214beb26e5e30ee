"""Motions of robots with closed loops: those of a family for the independent joints, which the others follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from constraints.certificate import Extrema, LimitUse
from constraints.closed_loops import LoopProof
from constraints.linear import Constraint, LinearConstraint
from excite.trajectories.family import Family, JointMotion, Trajectory, stored_trajectory
from regressors.errors import InputError
from regressors.models.partial import ClosedMotion, PartialMotion, of_loops
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class ClosedTrajectory(Trajectory):
    """One motion of a family for the independent joints; its samples are those of all joints."""

    motion: ClosedMotion

    @cached_property
    def independent(self) -> Trajectory:
        """Motion of the independent joints."""
        return Trajectory(self.family, self.x)

    def joints(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """The independent joints."""
        return self.motion.labels

    def samples(self, time: Array) -> Samples:
        """Motion of all joints at given instants [s].

        Raises
        ------
        InputError
            The loops do not close at all of them.
        """
        free, loops = self.independent.samples(time), self.motion.loops
        q, left = loops.solved(free.q)
        loops.check(time, q, left, loops.robot.name)
        rates = np.zeros((3, *q.shape))
        rates[:, :, list(loops.independent)] = free.dq, free.ddq, free.dddq
        return loops.rates(Samples(time, q, *rates))

    def extrema(self, constraint: Constraint) -> Extrema:
        """Exact extrema over continuous time of functions of the independent joints."""
        if not isinstance(constraint, LinearConstraint):
            raise TypeError(f"no exact extrema for {type(constraint).__name__}")
        if constraint.matrix[:, list(self.motion.loops.dependent)].any():
            raise TypeError("no exact extrema of dependent joints")
        functions = self.motion.functions(constraint.matrix, constraint.offset)
        return self.family.combined_extrema(self.x, *functions, constraint.derivative)

    @cached_property
    def _proof(self) -> LoopProof:
        try:
            return LoopProof.of(self.motion, self.samples, self.duration, self.independent.jerk)
        except InputError:  # the loops do not close somewhere
            return LoopProof.none(self.motion.loops)

    @property
    def jerk(self) -> Array:
        """Bounds of every joint's |jerk|, shape (n,); infinite where the loops may be singular."""
        return self._proof.jerk

    @property
    def proven(self) -> tuple[LimitUse, ...]:
        """The distance from singular configurations."""
        return (self._proof.use,)

    def carried(self, matrix: Array, offset: Array) -> Trajectory:
        """The motion itself: all joints move, and no other robot has them."""
        return self


def joint_trajectory(family: Family, x: Array, motion: PartialMotion) -> Trajectory:
    """Motion of every joint, from that of the moving coordinates."""
    if isinstance(motion, ClosedMotion):
        return ClosedTrajectory(family, x, motion)
    return Trajectory(family, x).carried(motion.matrix, motion.offset)


def stored_motion(series: Mapping[str, Any], robot: Robot, family: Family | None = None) -> Trajectory:
    """Motion of all joints of a robot from the entries of a design's file."""
    if not robot.closures:
        return stored_trajectory(series, robot.n, family)
    motion = of_loops(robot)
    free = stored_trajectory(series, len(motion.labels), family)
    return ClosedTrajectory(free.family, free.x, motion)


def joint_motion(family: Family, time: Array, motion: PartialMotion) -> JointMotion:
    """Motion of all joints at fixed instants as a function of the x of the moving coordinates."""
    if not isinstance(motion, ClosedMotion):
        return family.joints(time, motion)
    free, loops = family.joints(time, motion.independent), motion.loops

    def pullback(x: Array, slopes: Sequence[Array]) -> Array:
        s, v, a = free.values(x)
        return free.pullback(x, loops.pullback(loops.moved([s, v, a])[0], [v, a], slopes))

    return JointMotion(lambda x: loops.moved(free.values(x)), pullback)
