"""One experiment in simulation, identified as its log will be, and how errors reach the parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from excite.identification.allowances import found_columns
from excite.identification.biases import without_standstill
from excite.identification.covariance import METHODS, divisors
from excite.identification.equations import equations, right_sides
from excite.identification.estimator import Context, LinearSolution, solve_triangular_system
from excite.identification.identification import Identification
from excite.identification.noise import AutoregressiveNoise, noise_of_residuals
from excite.identification.observations import GroupFactors, Observations, rows_of_groups
from excite.identification.prediction import without_friction
from excite.identification.preparation import PreparedLog, prepare
from excite.logs.log import Log
from excite.logs.signals.periods import mean_rate
from excite.simulation.sensors import first_order_noise, joint_log
from excite.simulation.settings import SimulationSettings, one_each
from excite.simulation.simulation import Simulation
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.samples import Array
from regressors.work_prediction import Steps


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """A simulated experiment and its identification, whose settings and weights repeats are taken to share."""

    simulation: Simulation
    result: Identification  # of its log
    # settings that every repeat finds again from its own log, see `excite.identification.allowances`
    found: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        method, model = self.result.estimate.method, self.result.target.model
        if method not in METHODS:
            raise InputError(f"accuracy is predicted for the estimators {', '.join(METHODS)}, not for {method}")
        if self.result.recipe.average:
            raise InputError("accuracy is predicted for every instant of the log; leave out `average`")
        if model.channel != "effort":
            raise InputError("accuracy is predicted for models of joint torques, not for those of a wrench")

    @property
    def moves(self) -> bool:
        """Whether the measured motion is not exact."""
        return motion_settings(self.simulation.settings) != exact_settings(self.simulation.settings)

    @cached_property
    def exact(self) -> LinearEquations:
        """Equations of the exact motion and the exact torques, with whatever the model does not describe."""
        return self.equations(self.log(exact_settings(self.simulation.settings), np.zeros(self.simulation.robot.n)))

    def equations(self, log: Log) -> LinearEquations:
        """Equations of a log by the settings of the identification."""
        return linear_equations(self.result, self.prepared(log), self.found)

    def prepared(self, log: Log) -> PreparedLog:
        """Motion and measurements of a log by the settings of the identification."""
        result = self.result
        part = prepare(log, result.robot, result.target, result.recipe)
        part = without_standstill(part, result.target, result.recipe.standstill)
        if result.friction is None:
            return part
        return without_friction(part, result.target, result.friction, result.recipe)

    def log(self, settings: SimulationSettings, shift: Array) -> Log:
        """The run as sensors measure it whose zeros are elsewhere, so that steps fall on other instants."""
        # shift (n,)
        run, rng = self.simulation.run, np.random.default_rng(settings.seed)
        shifted = replace(run, samples=replace(run.samples, q=run.samples.q + shift))
        log = joint_log(self.simulation.robot, shifted, settings, rng)
        return replace(log, q=log.q - shift)


def motion_settings(settings: SimulationSettings) -> SimulationSettings:
    """The settings without noise of torques."""
    return replace(settings, torque_noise=(0.0,), coloured_noise=(0.0,))


def exact_settings(settings: SimulationSettings) -> SimulationSettings:
    """The settings of exact sensors; gains and drifts stay."""
    quiet, none = motion_settings(settings), (0.0,)
    return replace(quiet, encoder=None, position_noise=none, velocity_noise=none, position_step=none)


def motion_errors(rehearsal: Rehearsal, count: int, seed: int, progress: Steps = lambda *_: None) -> Array:
    """Errors of the estimate from measured motions and exact torques, shape (count, p).

    Each measured motion passes the filter and the derivatives of the identification and gives its own regressor W, so
    that parameters are also pulled towards zero, ``(W' V W)^-1 W' V (y - W beta)``. Encoders count from a random phase:
    a repeat of the motion that is not the same to within a count meets other steps.
    """
    settings, rng, errors = motion_settings(rehearsal.simulation.settings), np.random.default_rng([seed, 1]), []
    exact = rehearsal.exact.solution.values
    widest = _widest_step(settings, rehearsal.simulation.robot.n)
    for k in range(count):
        one = replace(settings, seed=int(rng.integers(2**31)))
        log = rehearsal.log(one, widest * rng.random(widest.size))
        errors.append(rehearsal.equations(log).error(exact))
        progress(k + 1, count)
    return np.array(errors)


def _widest_step(settings: SimulationSettings, joints: int) -> Array:
    """Step of the positions of each joint, or more where gears reduce it, shape (n,)."""
    step = np.broadcast_to(settings.position_step, joints)
    if settings.encoder is None:
        return np.asarray(step)
    return np.asarray(np.maximum(step, 2 * np.pi / np.broadcast_to(settings.encoder, joints)))


@dataclass(frozen=True, eq=False)
class LinearEquations:
    """Equations ``y = W beta + C c + e``, each row with a divisor, and columns C of settings found with beta."""

    rows: Observations  # with the columns [W C]
    divisor: Array  # (groups,) noise by which the rows of each group are divided
    count: int  # parameters p of beta, the first columns

    @cached_property
    def factor(self) -> Array:
        """Triangular factor of ``V^1/2 [W C y]``."""
        return GroupFactors.of(self.rows).stacked(self.divisor)

    @cached_property
    def solution(self) -> LinearSolution:
        """Weighted least squares, also of the settings."""
        return solve_triangular_system(self.factor)

    @cached_property
    def root(self) -> Array:
        """Triangular factor of the equations of beta once the settings are eliminated, shape (p, p)."""
        p, k = self.count, self.factor.shape[1] - 1 - self.count
        first = np.concatenate([self.factor[:, p : p + k], self.factor[:, :p]], axis=1)
        return np.asarray(np.linalg.qr(first, mode="r"))[k : k + p, k:]

    def errors(self, changes: Array) -> Array:
        """``(W' V W)^-1 W' V e`` for errors of the right-hand side of shape (m, k), shape (k, p)."""
        half, scores = self.solution.half, np.zeros((self.solution.half.shape[1], changes.shape[1]))
        for block in self.rows.blocks():
            scale = self.divisor[self.rows.group[block], None]
            scores += (self.rows.W[block] @ half / scale).T @ (changes[block] / scale)
        return np.asarray((half @ scores)[: self.count].T)

    def error(self, values: Array) -> Array:
        """Estimate of these equations less given values, shape (p,)."""
        return np.asarray((self.solution.values - values)[: self.count])


def linear_equations(result: Identification, part: PreparedLog, found: frozenset[str]) -> LinearEquations:
    """Equations of a log by the settings and with the weights of an identification."""
    target, recipe, estimate = result.target, result.recipe, result.estimate
    rows = equations(target, [part], recipe)
    for name, column in found_columns(estimate, Context(target, (part,), recipe), found):
        rows = rows.beside(column[:, None], (name,))
    return LinearEquations(rows, divisors(estimate), len(result.names))


FREE = ("weighted", "least-squares", "recursive", "huber")  # linear in the measurements, or nearly so


def bounded_estimates(
    result: Identification, linear: LinearEquations, values: Array, progress: Steps = lambda *_: None
) -> Array:
    """What an estimator makes of measurements whose weighted least-squares estimates are given, shape (k, p).

    The rows are condensed to p equations ``R beta = R values`` with ``R'R = W' V W``, of noise one.
    """  # values (k, p)
    estimator, target = result.recipe.chosen_estimator(), result.target
    context = Context(target, result.prepared, result.recipe, standard_values(target.robot))
    p, root, rows = linear.count, linear.root, linear.rows
    first: np.ndarray = np.zeros(p, dtype=np.intp)
    condensed = replace(
        rows,
        W=root,
        y=np.zeros(p),
        names=rows.names[:p],
        units=rows.units[:p],
        equation=first,
        equations=rows.equations[:1],
        log=first,
        time=np.zeros(p),
        noise=np.ones((1, 1)),
    )
    bounded = []
    for k, one in enumerate(values, 1):
        bounded.append(estimator.estimate(replace(condensed, y=root @ one), context).coefficients)
        progress(k, len(values))
    return np.array(bounded)


_NUMBERS = 2**23  # of noise that is held at once


def torque_errors(
    result: Identification,
    noise: TorqueNoise,
    count: int,
    seed: int,
    found: frozenset[str] = frozenset(),
    progress: Steps = lambda *_: None,
) -> Array:
    """Errors ``(W' V W)^-1 W' V F n`` of an estimate, shape (count, p).

    F brings torques to the rows of the equations: their low-pass and decimation, and the windows of the model.
    """
    (part,), target, recipe = result.prepared, result.target, result.recipe
    N, n = part.measured.shape
    linear = linear_equations(result, part, found)
    rng, errors = np.random.default_rng([seed, 0]), []
    block = max(1, min(count, _NUMBERS // (N * n)))
    for first in range(0, count, block):
        samples = [noise.draw(part.samples.time, n, rng) for _ in range(min(block, count - first))]
        errors.append(linear.errors(right_sides(target, part, recipe, np.array(samples))))
        progress(min(first + block, count), count)
    return np.concatenate(errors)


_SAME_RATE = 0.02
_SETTLED = 1e-6  # what is left of the initial state of coloured noise


class TorqueNoise(ABC):
    """Noise of the torques of n joints, stationary in time, with zero mean."""

    @abstractmethod
    def draw(self, time: Array, joints: int, rng: np.random.Generator) -> Array:
        """Noise at uniform instants, shape (N, n) [Nm or N].

        Parameters
        ----------
        time : ndarray, shape (N,)
            [s]
        joints : int
            n.
        rng : numpy.random.Generator
        """


@dataclass(frozen=True)
class StatedNoise(TorqueNoise):
    """White noise, and noise through a first-order low-pass, as of `excite.simulation.settings.SimulationSettings`."""

    white: tuple[float, ...]  # standard deviations, one for all joints or one each [Nm or N]
    coloured: tuple[float, ...]
    corner: float  # corner frequency of the coloured noise [Hz]; its time constant is ``1 / (2 pi corner)``

    def draw(self, time: Array, joints: int, rng: np.random.Generator) -> Array:
        """See `TorqueNoise.draw`."""
        white = rng.standard_normal((time.size, joints)) * np.array(one_each(self.white, joints, "torque_noise"))
        if not any(self.coloured):
            return np.asarray(white)
        coloured = one_each(self.coloured, joints, "coloured_noise")
        return np.asarray(white + first_order_noise(time, coloured, self.corner, rng))


@dataclass(frozen=True, eq=False)
class MeasuredNoise(TorqueNoise):
    """Autoregressive noise of each joint's equation, ``n_t = sum_k a_k n_{t-k} + u_t``."""

    rate: float  # of its instants [Hz]
    joints: tuple[AutoregressiveNoise, ...]

    @property
    def deviation(self) -> Array:
        """Standard deviation of each joint's noise, shape (n,) [Nm or N]."""
        spectra = (noise.spectrum(2**14) for noise in self.joints)
        return np.array([np.sqrt(np.mean(np.concatenate([s, s[1:-1]]))) for s in spectra])

    def draw(self, time: Array, joints: int, rng: np.random.Generator) -> Array:
        """See `TorqueNoise.draw`."""
        rate = mean_rate(time)
        if abs(rate / self.rate - 1) > _SAME_RATE or joints != len(self.joints):
            raise InputError(
                f"noise was measured of {len(self.joints)} joints at {self.rate:.4g} Hz, and the motion has {joints} "
                f"joints at {rate:.4g} Hz; give noise that was measured at the same rate"
            )
        return np.column_stack([_drawn(noise, time.size, rng) for noise in self.joints])


def _drawn(noise: AutoregressiveNoise, count: int, rng: np.random.Generator) -> Array:
    polynomial = np.append(1.0, -noise.coefficients)
    slowest = float(np.abs(np.roots(polynomial)).max(initial=0.0))
    lead = 0 if slowest == 0.0 else int(np.ceil(np.log(_SETTLED) / np.log(min(slowest, 0.9999))))
    white = rng.standard_normal(lead + count) * np.sqrt(noise.variance)
    return np.asarray(scipy.signal.lfilter([1.0], polynomial, white)[lead:])


@checked
def measured_noise(result: Identification, log: int = 0) -> MeasuredNoise:
    """Noise of the torques of one log, by its residuals: of each joint, level and colour.

    What the model does not explain, such as friction of another form, counts as noise. Each spectrum is that of an
    autoregressive process, see `excite.identification.noise`.

    Parameters
    ----------
    result : Identification
        With an instantaneous model of joint torques, neither low-passed nor decimated.
    log : int
        Which of its logs.

    Raises
    ------
    InputError
        Another model, or filtered equations.
    """
    recipe, rows = result.recipe, result.observations
    if not 0 <= log < len(result.prepared):
        raise InputError(f"log: expected the number of one of {len(result.prepared)} logs, from 0 on, given {log}")
    if result.target.model.window is not None or result.target.model.channel != "effort":
        raise InputError("noise is measured with a model of joint torques at single instants, such as 'differential'")
    if recipe.low_pass is not None or (recipe.every or 1) > 1 or recipe.average:
        raise InputError("noise is measured by unfiltered equations; leave out `low_pass`, `every` and `average`")
    residual, r = result.estimate.residual(rows), len(rows.equations)
    joints, deviation = [], result.estimate.noise[log]
    for group, own in rows_of_groups(rows.group):
        if group // r == log:
            e = residual[own]
            fitted = float(np.sqrt(np.mean(e**2)))  # less than the noise by what the parameters take up
            joints.append(noise_of_residuals(e * deviation[group % r] / fitted if fitted > 0 else e))
    return MeasuredNoise(mean_rate(result.prepared[log].samples.time), tuple(joints))
