"""Equations of the logs under trial settings, on the same instants for all of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.pieces import LogPiece
from excite.identification.choices.time_blocks import time_blocks
from excite.identification.equations import DirectedFriction, friction_drives
from excite.identification.friction_directions import drive_directions, drive_rows
from excite.identification.known_friction import without_friction
from excite.identification.known_instants import nearest
from excite.identification.preparation import PreparedLog, UsableRows, usable_rows, with_motion
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from excite.logs.saturation import within
from excite.signals.delay import DelayedMotion
from regressors.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

_MOST = 128_000_000  # [bytes]
_LOGS = 8  # whose motion is kept as splines


@dataclass(frozen=True, eq=False)
class TrialRows:
    """Equations of one log under one delay."""

    target: IdentificationTarget  # with a model of single instants
    part: PreparedLog
    delay: float  # of the measurements after the motion, beyond that of the part [s]
    time: Array  # (N,) trial instants [s]
    rows: Index  # (N,) of the part at these instants
    motion: Samples  # the whole delayed motion
    W: Array  # (N, r, b) fast along N. Its columns of directed friction are written by `regressor`
    directed: DirectedFriction | None  # None where the model has no friction torque at every instant

    @classmethod
    def of(
        cls, target: IdentificationTarget, part: PreparedLog, delay: float, time: Array, motion: Samples
    ) -> TrialRows:
        """Compute the equations; arguments as of the class."""
        rows = nearest(part.samples.time, time)
        samples = motion.rows(rows)
        W = target.model.entries(samples, target.base.index).transpose(2, 0, 1)
        directed = None if target.model.coulomb_friction() is None else friction_drives(target, samples)
        return cls(target, part, delay, time, rows, motion, W, directed)

    def regressor(self, recipe: Recipe) -> Array:
        """W with friction that has the recipe's directions, shape (N, r, b); valid until the next call."""
        if self.directed is not None and self.directed.columns:
            remembers = np.any(recipe.breakaway or 0.0)
            motion = self.motion if remembers else self.motion.rows(self.rows)
            direction = drive_directions(self.target.robot, motion, recipe.sign_width, recipe.breakaway)
            if direction is None:
                direction = np.sign(motion.dq @ drive_rows(self.target.robot).T)
            self.directed.put(self.W, direction[self.rows] if remembers else direction)
        return self.W


class RecentRows:
    """The equations that were last used, as many as 128 MB hold."""

    def __init__(self) -> None:
        self._kept: deque[TrialRows] = deque()
        self._motions: deque[DelayedMotion] = deque(maxlen=_LOGS)

    def of(self, target: IdentificationTarget, part: PreparedLog, delay: float, time: Array) -> TrialRows:
        """Equations of the last ones, or new ones; arguments as of `TrialRows`."""
        for known in self._kept:
            if known.target is target and known.part is part and known.delay == delay and known.time is time:
                return known
        new = TrialRows.of(target, part, delay, time, self._motion(part).by(delay))
        self._kept.append(new)
        while len(self._kept) > 1 and sum(known.W.nbytes for known in self._kept) > _MOST:
            self._kept.popleft()
        return new

    def _motion(self, part: PreparedLog) -> DelayedMotion:
        """A log's motion, to be delayed."""
        for motion in self._motions:
            if motion.samples is part.samples:
                return motion
        self._motions.append(DelayedMotion(part.samples))
        return self._motions[-1]


Mask = NDArray[np.bool_]
_INSTANTS = 6000  # of all logs together


@dataclass(frozen=True, eq=False)
class Trial:
    """Logs, and the instants of each on which all settings are tried."""

    robot: Robot  # the whole robot
    logs: tuple[Log, ...]
    instants: tuple[Array, ...]  # of each log [s]
    blocks: tuple[Index, ...]  # block of each instant
    friction: FrictionCurves | None = None  # known friction, which is subtracted
    rows: tuple[Mask, ...] | None = None  # (M, r) rows of each log's instants that count; all if not given

    _usable: dict[tuple[object, ...], list[UsableRows]] = field(default_factory=dict, repr=False)
    _recent: RecentRows = field(default_factory=RecentRows, repr=False)

    def prepared(self, target: IdentificationTarget, recipe: Recipe) -> list[PreparedLog]:
        """The logs under a recipe; what no filter changes is done once."""
        key = target.robot.joint_names, target.model.channel, recipe.rows, recipe.torque_factors
        if key not in self._usable:
            self._usable[key] = [usable_rows(log, self.robot, target, recipe) for log in self.logs]
        return [with_motion(rows, target, recipe) for rows in self._usable[key]]

    def statistics(
        self,
        target: IdentificationTarget,
        parts: Sequence[PreparedLog],
        recipe: Recipe,
        delay: float = 0.0,
        kept: Sequence[Mask] | None = None,
    ) -> BlockStatistics:
        """Sums of products of every block."""  # kept (N, r)
        equations = self.equations(target, parts, recipe, delay)
        if kept is not None:
            rows = [nearest(part.samples.time, time) for part, time in zip(parts, self.instants, strict=True)]
            masks = [mask[row] for mask, row in zip(kept, rows, strict=True)]
            equations = _masked(equations, masks)
        if self.rows is not None:
            equations = _masked(equations, self.rows)
        return BlockStatistics.of([W for W, _ in equations], [y for _, y in equations], self.blocks)

    def equations(
        self, target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe, delay: float = 0.0
    ) -> list[tuple[Array, Array]]:
        """W, shape (N, r, b), and y, shape (N, r), of each log at its trial instants; valid until the next call."""
        return [
            self._equations(target, part, recipe, time, delay) for part, time in zip(parts, self.instants, strict=True)
        ]

    def _equations(
        self, target: IdentificationTarget, part: PreparedLog, recipe: Recipe, time: Array, delay: float
    ) -> tuple[Array, Array]:
        trial = self._recent.of(target, part, delay, time)
        rows = trial.rows
        measured = part.measured
        if self.friction is not None:
            measured = without_friction(replace(part, samples=trial.motion), target, self.friction, recipe).measured
        y = target.model.right_side(trial.motion.rows(rows), measured[rows]).reshape(rows.size, -1)
        return trial.regressor(recipe), y


def _masked(equations: Sequence[tuple[Array, Array]], masks: Sequence[Mask]) -> list[tuple[Array, Array]]:
    return [(W * m[:, :, None], y * m) for (W, y), m in zip(equations, masks, strict=True)]


def trial_of(
    robot: Robot, pieces: Sequence[LogPiece], parts: Sequence[PreparedLog], friction: FrictionCurves | None = None
) -> Trial:
    """Logs and trial instants: evenly spaced ones of prepared logs, without those that make no equations."""
    total = sum(part.samples.time.size for part in parts)
    every = max(1, -(-total // _INSTANTS))
    kept = [part.samples.time[::every] for part in parts]
    instants = [time[~within(time, piece.left_out)] for time, piece in zip(kept, pieces, strict=True)]
    logs = tuple(piece.log for piece in pieces)
    return Trial(robot, logs, tuple(instants), tuple(time_blocks(instants)), friction)
