"""Equations of the logs, or of stretches of long ones, under trial settings, on the same instants for all of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from excite.identification.choices.left_out import BlockStatistics, time_blocks
from excite.identification.equations import DirectedFriction, drive_directions, drive_rows, friction_drives, nearest
from excite.identification.known_friction import without_friction
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from excite.logs.saturation import Spans, within
from excite.logs.signals.resampling import DelayedMotion
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

_LONGEST = 50_000  # rows of a log that are tried
_PIECES = 5


LogPiece = tuple[Log, Spans]  # without faulty rows; first and last instant of what makes no equations [s]


def pieces_of(part: PreparedLog) -> list[LogPiece]:
    """The exciting stretch of a log, or evenly spaced pieces of a very long one."""
    log = part.log
    if log.count <= _LONGEST:
        return [(log, part.left_out)]
    length = _LONGEST // _PIECES
    spacing = (log.count - length) // (_PIECES - 1)
    starts = (k * spacing for k in range(_PIECES))
    return [(log.rows(slice(first, first + length)), part.left_out) for first in starts]


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

    _recent: deque[TrialRows] = field(default_factory=deque, repr=False)  # as many as 128 MB hold
    _motions: deque[DelayedMotion] = field(default_factory=lambda: deque(maxlen=_LOGS), repr=False)

    def prepared(self, target: IdentificationTarget, recipe: Recipe) -> list[PreparedLog]:
        """The logs under a recipe; what no filter changes is done once."""
        return [prepare(log, self.robot, target, recipe) for log in self.logs]

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
        trial = self._rows(target, part, delay, time)
        rows, measured = trial.rows, part.measured
        if self.friction is not None:
            measured = without_friction(replace(part, samples=trial.motion), target, self.friction, recipe).measured
        y = target.model.right_side(trial.motion.rows(rows), measured[rows]).reshape(rows.size, -1)
        return trial.regressor(recipe), y

    def _rows(self, target: IdentificationTarget, part: PreparedLog, delay: float, time: Array) -> TrialRows:
        """Equations of the last ones, or new ones; arguments as of `TrialRows`."""
        for known in self._recent:
            if known.target is target and known.part is part and known.delay == delay and known.time is time:
                return known
        new = TrialRows.of(target, part, delay, time, self._motion(part).by(delay))
        self._recent.append(new)
        while len(self._recent) > 1 and sum(known.W.nbytes for known in self._recent) > _MOST:
            self._recent.popleft()
        return new

    def _motion(self, part: PreparedLog) -> DelayedMotion:
        """A log's motion, to be delayed."""
        for motion in self._motions:
            if motion.samples is part.samples:
                return motion
        self._motions.append(DelayedMotion(part.samples))
        return self._motions[-1]


def _masked(equations: Sequence[tuple[Array, Array]], masks: Sequence[Mask]) -> list[tuple[Array, Array]]:
    return [(W * m[:, :, None], y * m) for (W, y), m in zip(equations, masks, strict=True)]


def trial_of(
    robot: Robot,
    pieces: Sequence[LogPiece],
    target: IdentificationTarget,
    recipe: Recipe,
    friction: FrictionCurves | None = None,
) -> Trial:
    """Logs and trial instants: evenly spaced ones that a recipe leaves, without those that make no equations."""
    empty = Trial(robot, tuple(log for log, _ in pieces), (), (), friction)
    times = [part.samples.time for part in empty.prepared(target, recipe)]
    every = max(1, -(-sum(time.size for time in times) // _INSTANTS))
    kept = [time[::every] for time in times]
    instants = [time[~within(time, left_out)] for time, (_, left_out) in zip(kept, pieces, strict=True)]
    return replace(empty, instants=tuple(instants), blocks=tuple(time_blocks(instants)))
