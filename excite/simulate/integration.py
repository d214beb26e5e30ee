"""Integration of a controlled robot by the classical Runge-Kutta method of order 4, in chunks of samples.

The control law is evaluated inside every stage, as by a continuous controller: the torque logged at an instant is the
one that acts at that instant, together with the acceleration that it causes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from excite.simulate.controlled import ControlledRobot
from excite.simulate.reference import Reference
from excite.simulate.steps import Steps
from regressors.errors import InputError
from regressors.samples import Array, Samples

Progress = Callable[[int, int], None]
_CHUNK = 1000


class LostMotionError(RuntimeError):
    """The simulated motion ran away: nothing was wrong with the input, but the controller does not hold the robot."""


@dataclass(frozen=True, eq=False)
class Course:
    """What happened at N instants of n joints.

    Parameters
    ----------
    samples : Samples
        True motion; jerk is not known (NaN).
    effort, command : ndarray, shape (N, n)
        Joint torques that acted, and those that the controller asked for [Nm or N].
    work, loss : ndarray, shape (N,)
        Work of the joint torques, and of it what friction took, from the start on [J].
    energy : ndarray, shape (N,)
        Kinetic and potential [J].
    """

    samples: Samples
    effort: Array
    command: Array
    work: Array
    loss: Array
    energy: Array

    def after(self, first: int) -> Course:
        """The course from one of its samples on, as if it began there."""
        samples = Samples(
            self.samples.time[: self.samples.time.size - first],
            *(x[first:] for x in (self.samples.q, self.samples.dq, self.samples.ddq, self.samples.dddq)),
        )
        work, loss = (x[first:] - x[first] for x in (self.work, self.loss))
        return Course(samples, self.effort[first:], self.command[first:], work, loss, self.energy[first:])


def rk4_step(rate: Callable[[ca.MX, ca.MX], ca.MX], x: ca.MX, inputs: ca.MX, h: float, substeps: int) -> ca.MX:
    """State after ``substeps`` steps of the classical Runge-Kutta method.

    Parameters
    ----------
    rate : callable
        ``dx/dt`` of a state and of one column of the inputs.
    x : MX
        State.
    inputs : MX, 2 substeps + 1 columns
        At steps and half steps.
    h : float
        Length of a substep [s].
    substeps : int
    """
    for k in range(substeps):
        start, middle, end = (inputs[:, 2 * k + j] for j in range(3))
        k1 = rate(x, start)
        k2 = rate(x + h / 2 * k1, middle)
        k3 = rate(x + h / 2 * k2, middle)
        k4 = rate(x + h * k3, end)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def course(
    robot: ControlledRobot, reference: Reference, rate: float, steps: Steps, progress: Progress | None = None
) -> Course:
    """Motion of a controlled robot that starts as the reference does.

    Parameters
    ----------
    robot : ControlledRobot
    reference : Reference
    rate : float
        Samples per second [Hz].
    steps : Steps
    progress : callable, optional
        Called with the number of samples done and of all, after each chunk.

    Raises
    ------
    InputError
        The mass matrix is not positive definite somewhere.
    LostMotionError
        The motion runs away.
    """
    n, s = robot.plant.robot.n, steps.substeps
    h = 1.0 / (rate * s)
    symbols, expressions = robot.instant(steps.width)
    instant = ca.Function("instant", symbols, expressions)
    x, r = ca.MX.sym("x", 2 * n + 2), ca.MX.sym("r", 3 * n, 2 * s + 1)
    advanced = rk4_step(lambda state, wanted: instant(state, wanted)[0], x, r, h, s)
    step = ca.Function("step", [x, r], [advanced, *instant(x, r[:, 0])[1:]])
    count = round(reference.duration * rate)
    first = reference.samples(np.zeros(1))
    state = np.concatenate([first.q[0], first.dq[0], np.zeros(2)])
    parts: list[Array] = []
    for begin in range(0, count + 1, _CHUNK):
        length = min(_CHUNK, count + 1 - begin)
        found = step.mapaccum("chunk", length)(state, _wanted(reference, begin, length, h, s))
        after, *rest = (np.array(block) for block in found)
        before = np.column_stack([state, after[:, :-1]])
        parts.append(np.vstack([before, *rest]).T)
        state = after[:, -1]
        _check_progress(parts[-1], begin / rate, rate)
        if progress is not None:
            progress(min(begin + length, count), count)
    return _course(robot, np.vstack(parts), rate)


def _wanted(reference: Reference, begin: int, length: int, h: float, s: int) -> Array:
    """Reference of a chunk: of each sample 2 s + 1 columns, at its steps and half steps."""
    half = np.arange(2 * s * length + 1) + 2 * s * begin
    found = reference.samples(np.minimum(half * (h / 2), reference.duration))
    table = np.hstack([found.q, found.dq, found.ddq])
    columns = np.arange(length)[:, None] * 2 * s + np.arange(2 * s + 1)
    return np.asarray(table[columns.reshape(-1)].T)


def _check_progress(part: Array, start: float, rate: float) -> None:
    lost = ~np.all(np.isfinite(part), axis=1)
    if np.any(part[:, -1] <= 0) and not np.any(lost[: int(np.argmax(part[:, -1] <= 0))]):
        when = start + float(np.argmax(part[:, -1] <= 0)) / rate
        raise InputError(
            f"the mass matrix is not positive definite at {when:.4g} s: the inertial parameters of the robot's links "
            "are not those of real bodies"
        )
    if np.any(lost):
        when = start + float(np.argmax(lost)) / rate
        raise LostMotionError(f"the simulated motion runs away at {when:.4g} s; the controller does not hold the robot")


def _course(robot: ControlledRobot, table: Array, rate: float) -> Course:
    n = robot.plant.robot.n
    q, dq, energies, effort, command, ddq, _ = np.split(table, np.cumsum([n, n, 2, n, n, n]), axis=1)
    symbols = ca.SX.sym("q", n), ca.SX.sym("dq", n)
    energy = ca.Function("energy", list(symbols), [robot.plant.energy(*symbols)])
    stored = np.array(energy.map(table.shape[0])(q.T, dq.T)).reshape(-1)
    samples = Samples(np.arange(table.shape[0]) / rate, q, dq, ddq, np.full_like(q, np.nan))
    return Course(samples, effort, command, energies[:, 0], energies[:, 1], stored)
