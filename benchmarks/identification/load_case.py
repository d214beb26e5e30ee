"""The load of [KD96] Table I: its true parameters, the motions that show it, and the noise of the sensor.

The sensor is at link 5 of the IRp-6 and gives a wrench 250 times a second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.optimize

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.models.load import LOAD_PARAMETERS, LoadModel
from regressors.readers.library import built_in
from regressors.robot.inertia import from_centre_of_mass
from regressors.samples import Array, Samples

ROBOT = built_in("irp6")
MODEL = LoadModel(ROBOT)
RATE, COARSE = 250.0, 1 / 0.032  # of the sensor, and of the positions in [KD96] section 5.3 [Hz]

MASS = 1.75  # the print has no row for it; its products of inertia give 1.73 to 1.78 kg
STEEL = 7850.0  # [kg/m^3]
COMPUTED = np.array([MASS, 0.0573, -0.0210, 0.1394, 0.01050, 0.00094, -0.00450, 0.01635, 0.00169, 0.00520])
ESTIMATED = np.array([np.nan, 0.0568, -0.0207, 0.1396, 0.01186, -0.00083, -0.00751, 0.01567, 0.00001, 0.00449])
PRINTED_DEVIATION = np.array([np.nan, 0.0028, 0.0088, 0.0091, 0.0051, 0.0014, 0.0017, 0.0071, 0.00060, 0.00037])
_DIAGONAL = [LOAD_PARAMETERS.index(name) for name in ("Ixx", "Iyy", "Izz")]

FROM, TO = np.radians([-40, 10, -30, 30, -150]), np.radians([30, -20, 40, -10, -10])
DURATION = 1.83  # [s]
SHORT = 1.832  # the nearest whole number of samples [s]
_SLACK = 1.01  # of the fit of the noise


def cuboid() -> tuple[Array, Array]:
    """Parameters of a homogeneous steel cuboid in place of the printed ones, shape (10,), and its edges [m].

    As printed, ``Ixx + Izz < Iyy``. The cuboid has the mass and the static moments; its faces are parallel to the axes
    of the sensor, as the printed products of inertia say, and its edges are those that bring the three moments of
    inertia nearest to the printed ones, by the sum of squares of the relative differences.
    """
    centre, volume = COMPUTED[1:4] / MASS, MASS / STEEL

    def edges(x: Array) -> Array:
        return np.array([volume / np.exp(x[0] + x[1]), *np.exp(x)])

    def theta(x: Array) -> Array:
        a2, b2, c2 = edges(x) ** 2
        return from_centre_of_mass(MASS, centre, MASS / 12 * np.diag([b2 + c2, a2 + c2, a2 + b2]))

    start = np.full(2, np.log(volume) / 3)
    found = scipy.optimize.least_squares(lambda x: (theta(x) / COMPUTED - 1)[_DIAGONAL], start, xtol=1e-14, ftol=1e-14)
    return theta(found.x), edges(found.x)


# --- motions ---------------------------------------------------------------------------------------------------------


def paper_motion(rate: float) -> Samples:
    """The polynomial of fifth order of [KD96] section 5.3, from rest to rest, at a uniform rate [Hz]."""
    time = np.arange(int(DURATION * rate) + 1) / rate
    u = (time / DURATION)[:, None]
    shapes = (
        u**3 * (10 - 15 * u + 6 * u**2),
        30 * u**2 * (1 - u) ** 2 / DURATION,
        60 * u * (1 - 3 * u + 2 * u**2) / DURATION**2,
        60 * (1 - 6 * u + 6 * u**2) / DURATION**3,
    )
    q, *rest = (shape * (TO - FROM) for shape in shapes)
    return Samples(time, FROM + q, *rest)


@cache
def designed(period: float) -> Design:
    """The design of ``excite design irp6 --model load --period PERIOD --rate 250 --seed 0``."""
    return design_trajectory(Task("irp6", model="load", period=period, rate=RATE, seed=0).changed(robot=ROBOT))


def at_rate(trajectory: Trajectory, rate: float) -> Samples:
    """A designed motion at a uniform rate [Hz], up to its end."""
    return trajectory.samples(np.arange(int(trajectory.duration * rate * (1 + 1e-12)) + 1) / rate)


def regressor(samples: Samples) -> Array:
    """The wrench per parameter, shape (N, 6, 10)."""
    return np.asarray(MODEL.assemble(samples).reshape(-1, 6, 10))


# --- noise of the sensor ---------------------------------------------------------------------------------------------

Deviations = Callable[[Array, Array], Array]


def weighted_deviation(W: Array, noise: Array) -> Array:
    """Standard deviation of weighted least squares, ``diag((W' Sigma^-1 W)^-1)^1/2``; `noise` per channel, (6,)."""
    R = np.linalg.qr((W / noise[:, None]).reshape(-1, 10), mode="r")
    return np.asarray(np.linalg.norm(np.linalg.inv(R), axis=1))


def plain_deviation(W: Array, noise: Array) -> Array:
    """Standard deviation of least squares with all rows alike, for white noise of each channel, shape (6,)."""
    P = _influence(W)
    return np.asarray(np.sqrt(np.einsum("pkc,c->p", P**2, noise**2)))


def offset_deviation(W: Array, noise: Array) -> Array:
    """The same, if each channel has an offset that is constant in a repetition and random from one to the next."""
    return np.asarray(np.sqrt(_influence(W).sum(axis=1) ** 2 @ noise**2))


def _influence(W: Array) -> Array:
    return np.linalg.pinv(W.reshape(-1, 10)).reshape(10, -1, 6)


def six(force: float, torque: float) -> Array:
    """Noise of the six channels [N, Nm]."""
    return np.repeat([force, torque], 3)


@dataclass(frozen=True)
class Fit:
    """Noise that explains the printed deviations best.

    Parameters
    ----------
    force, torque : float
        Standard deviation [N, Nm].
    rms_log : float
        Root mean square of ``log(printed / predicted)`` over the nine printed rows.
    least : float
        The same at the best ratio of the two.
    ratios : list of float
        Printed over predicted.
    """

    force: float
    torque: float
    rms_log: float
    least: float
    ratios: list[float]


def fitted_noise(deviations: Deviations, W: Array) -> Fit:
    """Force and torque noise for which the predicted deviations match the printed ones in the sense of logarithms.

    ``min sum (log printed - log predicted)^2``: at each ratio of the two the scale follows in closed form. The optimum
    is flat where the torque noise hardly matters, so the largest ratio within 1 % of the least root mean square is
    taken.
    """

    def at(ratio: float) -> tuple[float, float, Array]:
        logs = np.log(PRINTED_DEVIATION / deviations(W, six(1.0, ratio)))[1:]
        scale = float(np.exp(logs.mean()))
        return scale, float(logs.std()), np.exp(logs) / scale

    ratios = np.geomspace(1e-4, 10.0, 501)
    spreads = np.array([at(ratio)[1] for ratio in ratios])
    ratio = float(ratios[np.flatnonzero(spreads <= _SLACK * spreads.min())[-1]])
    scale, spread, each = at(ratio)
    return Fit(scale, scale * ratio, spread, float(spreads.min()), each.tolist())
