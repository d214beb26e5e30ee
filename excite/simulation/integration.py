"""Integration of a controlled robot, in chunks of samples.

The control law is evaluated inside every stage, as by a continuous controller: the torque logged at an instant is the
one that acts at that instant, together with the acceleration that it causes.

The method is the classical one of Runge and Kutta, of order 4. Where friction is too steep for it, as that of light
links is, friction is implicit and the rest explicit, of order 2, by ARS(2,2,2) [Ascher, Ruuth, Spiteri 1997].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import casadi as ca
import numpy as np

from excite.design.interruption import deferred_interruption
from excite.errors import LostMotionError
from excite.simulation.control import ControlledRobot, Sticking, leads, unloaded
from excite.simulation.plant import solved
from excite.simulation.settings import Impacts
from excite.tasks.reference import GivenTorque, Reference
from regressors.errors import InputError
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.robot.symbolic.vectorised import in_turn, program
from regressors.samples import Array, Samples

_REACH = 1.5  # of substep times fastest rate; the method is stable up to 2.78
_MOST_SUBSTEPS, _CHEAP_SUBSTEPS = 64, 3
_STICKING_SUBSTEPS = 10  # accepted for a short distance, which falls with their square
_SOFTEST = 1e-3  # of the largest desired velocity: the sign of friction changes within it, where the substep allows
_BREAKAWAY = 1e-5  # rad or m: distance of presliding, where the substep allows
_WIDEST = 100.0  # times as large as it starts
_PROBES = 40
_IMPLICIT_RATE = 2000.0  # [Hz], of implicit friction: its method is of a low order
_TURNS_WITHIN = 5  # substeps: the sign of implicit friction


@dataclass(frozen=True)
class Steps:
    """Integration steps of a motion, and the width of friction's sign change."""

    substeps: int  # of the method per sample
    # velocity over which the sign of friction changes; with presliding, that of its compensation by the controller
    # [rad/s or m/s]
    width: float
    widened: bool = False  # whether the width, or the distance, had to grow for the method to be stable
    sticking: Sticking | None = None  # presliding friction; the sign changes with velocity if not given
    implicit: bool = False  # whether friction is


def steps_for(
    robot: ControlledRobot, reference: Reference, rate: float, width: float | None, breakaway: float | str | None = None
) -> Steps:
    """Stable substeps for a motion, with the width of friction's sign or the presliding distance.

    The rates are the eigenvalues of the controlled robot about the desired motion, and at rest, where friction is
    steepest: ``F / (width M)``, or ``sqrt(2 F / (d M))`` with presliding. The product of substep and fastest rate stays
    below 1.5; friction that three explicit substeps could not follow so closely is implicit.
    """
    probes = reference.samples(np.linspace(0.0, reference.duration, _PROBES))
    softest = _SOFTEST * (float(np.abs(probes.dq).max()) or 1.0)
    lead = None if breakaway is None else leads(robot.plant, (probes.q.min(axis=0) + probes.q.max(axis=0)) / 2)
    jacobian = robot.fastest_rate(lead)

    def needed(size: float, jacobian: ca.Function = jacobian) -> int:
        return max(1, int(np.ceil(_fastest(jacobian, probes, size) / (rate * _REACH))))

    distance = None if breakaway is None or isinstance(breakaway, str) else float(breakaway)
    given = width if breakaway is None else distance
    start = softest if breakaway is None else _BREAKAWAY
    enough = _CHEAP_SUBSTEPS if breakaway is None else _STICKING_SUBSTEPS
    size = start if given is None else given
    substeps = needed(size)
    fine = max(1, int(np.ceil(_IMPLICIT_RATE / rate)))
    passed = max(start, _TURNS_WITHIN * float(np.abs(probes.ddq).max()) / (rate * fine)) if given is None else given
    if lead is None and not robot.plant.friction.loaded and needed(passed) > enough:
        without = needed(size, robot.without_friction().fastest_rate())
        if substeps > without:
            return Steps(max(without, fine), passed, implicit=True)
    while given is None and substeps > enough and size < _WIDEST * start:
        size *= 1.25
        substeps = needed(size)
    if substeps > _MOST_SUBSTEPS:
        raise _too_many(substeps, rate, width, distance)
    widened = given is None and size > start
    if lead is None:
        return Steps(substeps, size, widened)
    return Steps(substeps, softest, widened, Sticking(size, tuple((lead * np.sqrt(size)).tolist())))


def _too_many(substeps: int, rate: float, width: float | None, breakaway: float | None) -> InputError:
    times = substeps / _MOST_SUBSTEPS
    needs = f"needs {substeps} substeps per sample at {rate:g} Hz, more than {_MOST_SUBSTEPS}"
    if breakaway is None and width is None:
        return InputError(f"the controller {needs}; take a lower bandwidth or a higher rate")
    what, enough = f"sign_width {width}", f"a width of about {(width or 0.0) * times:.2g}"
    if breakaway is not None:
        what, enough = f"breakaway {breakaway:g}", f"a distance of about {breakaway * times**2:.2g}"
    return InputError(f"{what}: such an abrupt change of friction {needs}; expected {enough} or more, or a higher rate")


def _fastest(jacobian: ca.Function, probes: Samples, size: float) -> float:
    """Largest eigenvalue magnitude at the probes, moving and at rest [1/s]."""
    states = np.vstack([np.hstack([probes.q, dq]) for dq in (probes.dq, np.zeros_like(probes.dq))])
    reference = np.tile(np.hstack([probes.q, probes.dq, probes.ddq]), (2, 1))
    stacked = np.array(jacobian.map(len(states))(states.T, reference.T, size))
    blocks = stacked.reshape(len(stacked), len(states), -1).transpose(1, 0, 2)
    if not np.all(np.isfinite(blocks)):
        raise InputError("the robot's equations of motion have no solution: its mass matrix is singular")
    return float(np.abs(np.linalg.eigvals(blocks)).max())


Progress = Callable[[int, int], None]
_CHUNK = 1000


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """Simulated motion, torques and energies at N instants of n joints."""

    samples: Samples  # true motion; jerk is not known (NaN)
    effort: Array  # (N, n) joint torques of the drives [Nm or N]
    command: Array  # (N, n) those that the controller commanded
    friction: Array  # (N, n) part of all torques that friction takes [Nm or N]
    work: Array  # (N,) work of the joint torques from the start on [J]
    loss: Array  # (N,) the part of it lost in friction
    energy: Array  # (N,) kinetic and potential energy [J]

    def after(self, first: int) -> SimulatedRun:
        """The run from one of its samples on, as if it began there."""
        s = self.samples
        samples = replace(s.rows(slice(first, None)), time=s.time[: s.time.size - first])
        work, loss = (x[first:] - x[first] for x in (self.work, self.loss))
        effort, command, friction = (x[first:] for x in (self.effort, self.command, self.friction))
        return SimulatedRun(samples, effort, command, friction, work, loss, self.energy[first:])


State = TypeVar("State", ca.MX, Array)


def rk4_step(rate: Callable[[State, State], State], x: State, inputs: State, h: float, substeps: int) -> State:
    """State after ``substeps`` steps of the classical Runge-Kutta method."""
    for k in range(substeps):
        start, middle, end = (inputs[:, 2 * k + j] for j in range(3))
        k1 = rate(x, start)
        k2 = rate(x + h / 2 * k1, middle)
        k3 = rate(x + h / 2 * k2, middle)
        k4 = rate(x + h * k3, end)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def simulated_run(
    robot: ControlledRobot,
    reference: Reference,
    rate: float,
    steps: Steps,
    progress: Progress | None = None,
    ramps: GivenTorque | None = None,
    impacts: Impacts | None = None,
) -> SimulatedRun:
    """Motion of a controlled robot that starts as the reference does."""
    n, s = robot.plant.robot.n, steps.substeps
    h = 1.0 / (rate * s)
    count = round(reference.duration * rate)
    advance = in_turn((_implicit_step if steps.implicit else _step)(robot, steps, h), (count + 1) * s)
    first = reference.samples(np.zeros(1))
    state = np.concatenate([first.q[0], first.dq[0], np.zeros(2), unloaded(robot.plant, first.dq[0]), np.zeros(3)])
    parts: list[Array] = []
    with deferred_interruption() as answer:  # compiled chunks swallow what is raised inside them
        for begin in range(0, count + 1, _CHUNK):
            length = min(_CHUNK, count + 1 - begin)
            after, seen = np.split(
                advance(state, _wanted(reference, ramps, impacts, begin, length, h, s)), [state.size]
            )
            before = np.column_stack([state, after[:, :-1]])
            parts.append(np.vstack([before[: 2 * n + 2], seen])[:, ::s].T)
            state = after[:, -1]
            _check_progress(parts[-1], begin / rate, rate)
            if progress is not None:
                progress(min(begin + length, count), count)
            answer()
    return _course(robot, np.vstack(parts), rate, impacts)


def _step(robot: ControlledRobot, steps: Steps, h: float) -> ca.Function:
    """Map (state, inputs) to the state after a substep, and effort, command, ddq, least pivot before it.

    The state is (q, dq, work, loss), then directions of friction and the memory of a ramp; the inputs at the begin, the
    middle and the end are (q, dq, ddq) of the reference, torques from outside, torque and number of the ramp.
    """
    n = robot.plant.robot.n
    y_size, k = 2 * n + 2, friction_rows(robot.plant.robot).shape[0]
    symbols, expressions = robot.instant(steps.width, steps.sticking)
    instant = ca.Function("instant", symbols, expressions)
    x, r = ca.MX.sym("x", y_size + k + 3), ca.MX.sym("r", _inputs(robot), 3)
    y, s, latch = x[:y_size], x[y_size : y_size + k], x[y_size + k :]
    is_open = ca.MX(0)
    if robot.ramped is not None:
        latch = robot.ramped.latch()(y[:n], latch, r[-1, 0])
        is_open = ca.logic_and(latch[0] > 0, ca.logic_not(latch[2]))
    memory = ca.vertcat(y[:n], s, is_open)
    seen = instant(y, r[:-1, 0], memory)[1:]
    after = rk4_step(lambda state, given: instant(state, given, memory)[0], y, r[:-1, :], h, 1)
    s = robot.turned(steps.sticking)(after[:n] - y[:n], s)
    return ca.Function("step", [x, r], [ca.vertcat(after, s, latch, *seen)])


def _inputs(robot: ControlledRobot) -> int:
    return (4 if robot.struck else 3) * robot.plant.robot.n + 2


_GAMMA = 1 - np.sqrt(0.5)
_NEWTON = 8
_PARTS = (1.0, 0.5, 0.25, 0.1)  # of a step of Newton's method: within a whole one friction may change its sign


def _implicit_step(robot: ControlledRobot, steps: Steps, h: float) -> ca.Function:
    """As `_step`, with implicit friction."""
    n, first, delta = robot.plant.robot.n, h * _GAMMA, 1 - 0.5 / _GAMMA
    whole, smooth = (ca.Function("instant", *one.instant(steps.width)) for one in (robot, robot.without_friction()))
    mass, friction = robot.steep_friction(steps.width)
    still = ca.SX.zeros(whole.size_in(2))  # a memory without presliding
    x, r = ca.SX.sym("x", 2 * n + 2 + still.numel() - n + 2), ca.SX.sym("r", _inputs(robot), 3)
    y, given = x[: 2 * n + 2], r[:-1, :]
    at = np.array([(1 - _GAMMA) * (1 - 2 * _GAMMA), 4 * _GAMMA * (1 - _GAMMA), _GAMMA * (2 * _GAMMA - 1)])
    given_2 = ca.mtimes(given, ca.DM(at))  # by the parabola through the three

    def slowed(y: ca.SX) -> ca.SX:
        """State after friction: ``M (v - v_0) + h gamma f(v) = 0``, by a damped Newton's method from near rest."""
        M, v = mass(y[:n]), ca.SX(ca.DM.ones(n, 1) * (1e-6 * steps.width))
        rigid, scale = ca.mtimes(M, v - y[n : 2 * n]), ca.sqrt(ca.diag(M))
        for _ in range(_NEWTON):
            f, slope = friction(v)
            whole_step = solved(M + first * slope, rigid + first * f)[0]
            pushed, best, least = ca.mtimes(M, whole_step), ca.SX(0.0), ca.SX(np.inf)
            for part in _PARTS:
                size = ca.sumsqr((rigid - part * pushed + first * friction(v - part * whole_step)[0]) / scale)
                best, least = ca.if_else(size < least, part, best), ca.fmin(size, least)
            v, rigid = v - best * whole_step, rigid - best * pushed
        return ca.vertcat(y[:n], v, y[-2], y[-1] + first * ca.dot(v, friction(v)[0]))

    rate = smooth(y, given[:, 0], still)[0]
    free_2 = y + first * rate
    y_2 = slowed(free_2)
    rate_2 = smooth(y_2, given_2, still)[0]
    free_3 = y + h * (delta * rate + (1 - delta) * rate_2) + (1 - _GAMMA) / _GAMMA * (y_2 - free_2)
    after = ca.vertcat(slowed(free_3), x[2 * n + 2 :], *whole(y, given[:, 0], still)[1:])
    return ca.Function("step", [x, r], [after])


def _wanted(
    reference: Reference, ramps: GivenTorque | None, impacts: Impacts | None, begin: int, length: int, h: float, s: int
) -> Array:
    """Inputs of a chunk, three columns per substep: at its begin, its middle and its end."""
    half = np.arange(2 * s * length + 1) + 2 * s * begin
    time = np.minimum(half * (h / 2), reference.duration)
    samples = reference.samples(time)
    pushed = np.zeros((time.size, 2)) if ramps is None else ramps.at(time)
    struck = np.zeros((time.size, 0)) if impacts is None else impacts(np.asarray(half * (h / 2)))
    table = np.hstack([samples.q, samples.dq, samples.ddq, struck, pushed])
    columns = np.arange(length * s)[:, None] * 2 + np.arange(3)
    return np.asarray(table[columns.reshape(-1)].T)


def _check_progress(part: Array, start: float, rate: float) -> None:
    lost, indefinite = ~np.all(np.isfinite(part), axis=1), part[:, -1] <= 0
    if np.any(indefinite) and not np.any(lost[: int(np.argmax(indefinite))]):
        when = start + float(np.argmax(indefinite)) / rate
        raise InputError(
            f"the mass matrix is not positive definite at {when:.4g} s: the inertial parameters of the robot's links "
            "are not those of real bodies"
        )
    if np.any(lost):
        when = start + float(np.argmax(lost)) / rate
        raise LostMotionError(
            f"the simulated motion diverges at {when:.4g} s: the controller is not stable; change its bandwidth"
        )


def _course(robot: ControlledRobot, table: Array, rate: float, impacts: Impacts | None) -> SimulatedRun:
    n, count = robot.plant.robot.n, table.shape[0]
    q, dq, energies, effort, command, ddq, _ = np.split(table, np.cumsum([n, n, 2, n, n, n]), axis=1)
    stored = program(robot.plant.energy)((q.T, dq.T))[0]
    samples = Samples(np.arange(count) / rate, q, dq, ddq, np.full_like(q, np.nan))
    acting = effort if impacts is None else effort + impacts(samples.time)
    friction = acting - program(robot.plant.torque)((q.T, dq.T, ddq.T)).T
    return SimulatedRun(samples, effort, command, friction, energies[:, 0], energies[:, 1], stored)
