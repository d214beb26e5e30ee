"""Logs of commanded and measured positions, cut into windows that begin as measured.

Derivatives are those of cubics through the rows about each. A window lies within a log without a gap, and has the
commands of the longest delay before it. Values that a fit starts from are those of the linear form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from excite.identification.servo_result import LEAST_MOTION, encoder_step
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.models.servo import UNKNOWNS, ServoModel
from regressors.models.servo_response import LONGEST_DELAY, QUANTITIES, Windows, arm_torques
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

_WINDOW, _SETTLE = 2.0, 1.0  # [s]
_MOST_WINDOWS = 150
_SMOOTHED = 0.12  # over which positions are fitted by cubics for their derivatives [s]
_GAP = 1.5  # median steps


@dataclass(frozen=True, eq=False)
class ServoMotion:
    """A log, with what the described arm needs along the measured motion."""

    log: Log
    samples: Samples  # measured, with smoothed derivatives
    load: Array  # (N, n) torque that gravity and the other joints need [Nm or N]
    inertia: Array  # (N, n) own inertia of the arm at the joint

    @property
    def command(self) -> Array:
        """Commanded positions, shape (N, n)."""
        assert self.log.command is not None
        return self.log.command


def servo_motion(log: Log, robot: Robot) -> ServoMotion:
    """Motion of a log that has commands."""
    log = log.of(robot.joint_names)
    if log.command is None:
        raise InputError(
            f"{log.source} has no commanded positions, which the model servo needs: columns NAME.command, or "
            "`command:` in the mapping"
        )
    step = log.duration / (log.count - 1)
    q, dq, ddq = derivatives(log.q, step)
    samples = Samples(log.time, log.q, dq, ddq, np.zeros_like(q))
    return ServoMotion(log, samples, *arm_torques(robot)(q, dq, ddq))


def derivatives(q: Array, step: float) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations of cubics through the rows about each."""
    rows = max(5, 2 * round(_SMOOTHED / step / 2) + 1)
    if len(q) < rows:
        raise InputError(f"{len(q)} rows without a gap are too few; a servo needs {rows} or more")
    q, dq, ddq = (scipy.signal.savgol_filter(q, rows, 3, order, step, axis=0) for order in range(3))
    return q, dq, ddq


@dataclass(frozen=True, eq=False)
class Places:
    """Where windows are in the logs: of as many rows each."""

    motions: Sequence[ServoMotion]
    log: Index  # (w,) number of the log
    first: Index  # (w,) first row
    count: int  # rows of each
    settle: int  # rows before, in which a simulated motion forgets where it began
    lead: int  # rows before those, of commands

    @property
    def rows(self) -> Index:
        """Rows of every window, shape (w, T)."""
        return self.first[:, None] + np.arange(self.count)

    @property
    def steps(self) -> Array:
        """Mean steps between the rows of each window, shape (w,) [s]."""
        ends = [self.motions[k].log.time[rows[[0, -1]]] for k, rows in zip(self.log, self.rows, strict=True)]
        return np.asarray(np.diff(ends, axis=1)[:, 0] / (self.count - 1))

    def stretches(self, values: Callable[[ServoMotion], Array], before: int) -> Array:
        """Values (N, n) of the windows and of some rows before each, shape (w, before + T, n)."""
        pairs = zip(self.log, self.first, strict=True)
        return np.array([values(self.motions[k])[first - before : first + self.count] for k, first in pairs])


def windows_in(motions: Sequence[ServoMotion]) -> Places:
    """Windows without a gap, of all logs; of many, some that are spread evenly."""
    steps = [float(np.median(np.diff(motion.log.time))) for motion in motions]
    rows, settle = max(3, round(_WINDOW / min(steps))), round(_SETTLE / min(steps))
    lead = int(np.ceil(LONGEST_DELAY / min(steps))) + 1
    before = lead + settle
    places = []
    for number, (motion, step) in enumerate(zip(motions, steps, strict=True)):
        gaps = np.diff(motion.log.time) > _GAP * step
        starts = range(before, motion.log.count - rows + 1, rows)
        places += [(number, first) for first in starts if not gaps[first - before : first + rows - 1].any()]
    if len(places) <= len(QUANTITIES):
        names = ", ".join(motion.log.source for motion in motions)
        raise InputError(
            f"{names}: {len(places)} windows of {_WINDOW:g} s without a gap are too few for the {len(QUANTITIES)} "
            "unknowns of each servo; give longer logs"
        )
    chosen = np.unique(np.linspace(0, len(places) - 1, min(_MOST_WINDOWS, len(places))).round().astype(int))
    log, first = np.array(places)[chosen].T
    return Places(motions, log, first, rows, settle, lead)


def windows_of(places: Places) -> Windows:
    """The windows of all joints, one joint's after the other's, that begin as measured."""

    def cut(values: Callable[[ServoMotion], Array], before: int = 0) -> Array:
        return np.concatenate(np.moveaxis(places.stretches(values, before), -1, 0))

    measured = cut(lambda m: m.log.q)
    return Windows(
        np.tile(places.steps, places.motions[0].log.q.shape[1]),
        cut(lambda m: m.command, places.lead),
        cut(lambda m: m.load),
        cut(lambda m: m.inertia),
        measured,
        measured[:, 0],
        cut(lambda m: m.samples.dq)[:, 0],
    )


def moves(measured: Array) -> bool:
    """Whether a joint moves by more than some steps of its encoder."""
    return bool(np.ptp(measured) > LEAST_MOTION * encoder_step(measured))


_DELAYS = np.arange(0.0, 0.11, 0.01)  # [s]
_MOVES = 0.2  # of the typical speed, from which on friction has its direction


def start_values(motions: Sequence[ServoMotion], robot: Robot) -> Array:
    """Values from the linear form, by the delay that explains the rows of moving joints best, shape (n, p)."""
    model = ServoModel(robot)
    W = np.concatenate([model.instants(m.samples).reshape(-1, robot.n, UNKNOWNS * robot.n) for m in motions])
    behind = [np.concatenate([_delayed(m, delay) - m.samples.q for m in motions]) for delay in _DELAYS]
    linear, late = np.empty((robot.n, UNKNOWNS)), np.empty(robot.n)
    told = np.zeros(robot.n, dtype=bool)
    for j in range(robot.n):
        block = W[:, j, UNKNOWNS * j : UNKNOWNS * (j + 1)]
        moves = np.abs(block[:, 1]) >= _MOVES * np.sqrt(np.mean(block[:, 1] ** 2))
        fits = [
            scipy.optimize.lsq_linear(block[moves], each[moves, j], ([0.0] * 4 + [-np.inf], np.inf)) for each in behind
        ]
        best = int(np.argmin([fit.cost for fit in fits]))
        linear[j], late[j] = fits[best].x, _DELAYS[best]
        told[j] = linear[j, 0] * np.ptp(block[moves, 0]) > _TELLS * np.std(behind[best][moves, j])
    stiffness = 1.0 / np.maximum(linear[:, 0], 1e-9)
    usual = float(np.median(stiffness[told])) if told.any() else _USUAL
    largest = np.abs(behind[0]).max(axis=0)
    return np.array(
        [
            _of_linear(float(np.clip(K if tells else usual, *_STIFFNESS)), *each)
            for K, tells, *each in zip(stiffness, told, linear, late, largest, strict=True)
        ]
    )


def _delayed(motion: ServoMotion, delay: float) -> Array:
    """Commands that were given some time before each row."""
    time = motion.log.time
    return motion.command[np.maximum(np.searchsorted(time, time - delay, side="right") - 1, 0)]


_STIFFNESS = (1.0, 1e4)  # to start from [Nm/rad]
_USUAL = 20.0  # where no joint's load tells it
_TELLS = 0.5  # of how far the joint stays behind, from which on its load's part tells the stiffness


def _of_linear(K: float, x: Array, delay: float, largest: float) -> Array:
    """Values of all quantities from a stiffness and those of the linear form."""
    given = {"K": K, "D": K * x[1], "J": K * x[2], "Fc": K * x[3], "b": x[4], "d": delay, "L": 2.0 * K * largest}
    return np.array([np.clip(given.get(q.symbol, 0.1 * q.size), q.least, q.most) for q in QUANTITIES])
