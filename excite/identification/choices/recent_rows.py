"""Equations of a log at trial instants, kept as long as only friction's direction differs between candidates."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from excite.identification.friction_directions import drive_directions, drive_rows
from excite.identification.known_instants import nearest
from excite.identification.measured_regressor import DirectedFriction, friction_drives
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.signals.delay import DelayedMotion
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
