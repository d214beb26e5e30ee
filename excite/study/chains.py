"""Chains of samples: paths that are reflected at the bounds of what is possible.

A path alternates kicks by the energy's slope with straight drifts; where a drift meets a wall, the velocity is
reflected at its normal. The next wall is exact: of a body ``M + s Q`` is singular at ``s = -1 / lambda_min`` with the
least eigenvalue of ``L^-1 Q L'^-1``, ``M = L L'``. Reflections keep volume and energy, so that the usual acceptance
makes the density right.

The data say ``beta ~ t(b, C, nu)`` of the base parameters ``beta = A phi``, the description ``phi ~ N(phi0, V)``. What
the data determine is taken from the data alone; the description decides what they leave open, ``phi | beta``:

    phi = phi0 + G (b + L x - A phi0) + N y,   G = V A' (A V A')^-1,   L L' = C,   N N' = V - G A V,

with ``x ~ t(0, E, nu)`` and ``y ~ N(0, E)``.

What a robot's description says of its standard parameters, with a relative uncertainty.

Of a body with the pseudo-inertia ``J0 = T T'`` the difference ``E = T^-1 (J - J0) T'^-1`` has independent normal
entries, those of its diagonal with the standard deviation r, the others with ``r / sqrt 2``: then ``-log p`` is
``tr((J0^-1 (J - J0))^2) / (2 r)^2``, which depends neither on units nor on the frame [Lee, Wensing, Park 2020, whose
entropic divergence it is to second order, times ``1 / (2 r^2)``]. The mass has the relative deviation r, the second
moments too, and the centre of mass moves by 0.7 r of the body's root mean square extent in each direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy
from numpy.random import Generator
from numpy.typing import NDArray

from excite.errors import ConicSolverError
from excite.identification.estimators.possible_set import (
    PossibleSet,
    StandardProblem,
    conic_solution,
    nearest,
    possible_set,
)
from regressors.errors import InputError
from regressors.robot.inertia import from_pseudo_inertia
from regressors.samples import Array, Index
from regressors.work_prediction import Steps

CHAINS = 32
_STAGES = (20, 25, 25, 10)  # paths of every chain, after each of which but the last the shape is taken anew
_THIN = 3  # paths from one sample to the next
_ALONE = 0.2  # share of the deviations alone in a shape, without correlations: the draws are few
_ENOUGH, _SHORTER = 0.5, 0.8  # accepted paths of the warm-up, below which drifts are made shorter, and by how much
_LEAST = 0.05  # accepted paths, below which samples are not believed


def path_count(samples: int) -> int:
    """Paths that each of the chains computes for a number of samples."""
    return sum(_STAGES) + _THIN * -(-samples // CHAINS)


def draws(
    coordinates: PosteriorCoordinates,
    possible: PossibleSet,
    start: Array,
    count: int,
    seed: int,
    progress: Steps = lambda _, __: None,
) -> Array:
    """Coordinates of every chain after the warm-up, shape (rounds, chains, d), at least as many as asked for."""
    # start (d,)
    rng, z, done, total = np.random.default_rng(seed), np.tile(start, (CHAINS, 1)), 0, path_count(count)
    shape, length = np.eye(coordinates.size), STEP
    for stage, paths in enumerate(_STAGES):
        seen = []
        for _ in range(paths):
            z, moved = next_points(coordinates, possible, z, rng, shape, length)
            length *= _SHORTER if moved.mean() < _ENOUGH else 1.0
            seen.append(z)
            done += 1
            progress(done, total)
        if stage < len(_STAGES) - 1:
            shape, length = _shape(np.concatenate(seen[paths // 3 :])), STEP
    kept, accepted = [], 0.0
    while done < total:
        z, moved = next_points(coordinates, possible, z, rng, shape, length)
        accepted += float(moved.mean()) / (total - sum(_STAGES))
        done += 1
        if (total - done) % _THIN == 0:
            kept.append(z)
        progress(done, total)
    if accepted < _LEAST:
        raise ConicSolverError(
            "the posterior leaves hardly any room for possible robots: the data contradict the description; give a "
            "larger `prior`, or correct the description"
        )
    return np.array(kept)


def _shape(z: Array) -> Array:
    """A factor of the covariance of points, shape (d, d)."""
    covariance = np.atleast_2d(np.cov(z, rowvar=False))
    alone = np.diag(np.diag(covariance) + 1e-12)
    return np.asarray(np.linalg.cholesky((1 - _ALONE) * covariance + _ALONE * alone))


_STEPS = 6  # drifts of a path
# their mean length in deviations; 4 of 0.35 gave as many draws a second for a Panda, 8 of 0.15 a third less
STEP = 0.25
_SPREAD = 0.2  # of the length of a drift, from path to path
_INSIDE = 1e-8  # slack in a constraint's own size that a point has after a reflection
_MOST = 2000  # reflections in one drift


def next_points(
    coordinates: PosteriorCoordinates, possible: PossibleSet, z: Array, rng: Generator, shape: Array, length: float
) -> tuple[Array, NDArray[np.bool_]]:
    """One path of every chain: its new points, shape (n, d), and whether it moved there, shape (n,)."""
    # z (n, d); shape (d, d)
    n = rng.normal(size=z.shape)
    step = length * (1 + _SPREAD * (2 * rng.uniform() - 1))
    bound = np.log(rng.uniform(size=len(z)))
    before = coordinates.energy(z) + np.sum(n**2, axis=1) / 2
    path = ReflectedPaths(possible, shape, z.copy(), n, np.ones(len(z), dtype=bool))
    path.n = n - step / 2 * coordinates.slope_of_energy(z) @ shape
    for k in range(_STEPS):
        path.drift(step)
        path.n -= (step if k < _STEPS - 1 else step / 2) * coordinates.slope_of_energy(path.z) @ shape
    after = coordinates.energy(path.z) + np.sum(path.n**2, axis=1) / 2
    accepted = path.sound & (bound < before - after)
    accepted[accepted] = possible.contains(path.z[accepted])
    return np.where(accepted[:, None], path.z, z), accepted


@dataclass(eq=False)
class ReflectedPaths:
    """Points and velocities of all chains on their way."""

    possible: PossibleSet
    shape: Array  # (d, d) velocities are ``shape @ n``
    z: Array  # (chains, d) changed in place
    n: Array  # (chains, d)
    sound: NDArray[np.bool_]  # (chains,) False of paths that rounding took out of the set, or that met walls too often

    def drift(self, length: float) -> None:
        """Move all points by their velocities times a length, with reflections."""
        left = np.full(len(self.z), length)
        moving = np.flatnonzero(self.sound)
        for _ in range(_MOST):
            distance, number, u, sound = self._walls(moving)
            moving, distance = moving[sound], distance[sound]
            hit = distance < left[moving]
            travelled = np.where(hit, distance, left[moving])
            self.z[moving] += travelled[:, None] * (self.n[moving] @ self.shape.T)
            left[moving] -= travelled
            moving = moving[hit]
            if not moving.size:
                return
            self._reflect(moving, number[sound][hit], u[sound][hit])
        self.sound[moving] = False

    def _walls(self, moving: Index) -> tuple[Array, Index, Array, NDArray[np.bool_]]:
        """Of each chain: distance to the next wall, its number, bodies first, the body's null vector; if sound."""
        possible, z, v = self.possible, self.z[moving], self.n[moving] @ self.shape.T
        M, Q = possible.M + possible.bodies(z), possible.bodies(v)
        slack, speed = possible.c + z @ possible.b.T, v @ possible.b.T
        sound = np.all(slack > 0.0, axis=1)
        try:
            L = np.linalg.cholesky(M)
        except np.linalg.LinAlgError:
            sound &= np.all(np.linalg.eigvalsh(M)[..., 0] > _INSIDE**2, axis=1)
            L = np.linalg.cholesky(np.where(sound[:, None, None, None], M, np.eye(4)))
        self.sound[moving[~sound]] = False
        inverse = np.linalg.inv(L)
        values, vectors = np.linalg.eigh(inverse @ Q @ inverse.swapaxes(-1, -2))
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.concatenate([values[..., 0], speed / slack], axis=1)
            distance = np.where(rates < 0, -1 / rates, np.inf)
        number = np.argmin(distance, axis=1)
        body = np.minimum(number, len(possible.M) - 1)
        every = np.arange(len(moving))
        u = np.einsum("nij,ni->nj", inverse[every, body], vectors[every, body, :, 0])
        return distance[every, number], number, u / np.linalg.norm(u, axis=1)[:, None], sound

    def _reflect(self, moving: Index, number: Index, u: Array) -> None:
        """Reflect velocities at the walls, and set the points inside of them by what rounding takes."""
        possible, of_bodies = self.possible, len(self.possible.M)
        normal, slack = np.zeros((len(moving), possible.size)), np.zeros(len(moving))
        at_body = number < of_bodies
        body, u, z = number[at_body], u[at_body], self.z[moving]
        normal[at_body] = np.einsum("ni,nijd,nj->nd", u, possible.B[body], u)
        slack[at_body] = np.einsum("ni,nij,nj->n", u, possible.M[body], u) + np.sum(normal * z, axis=1)[at_body]
        other = number[~at_body] - of_bodies
        normal[~at_body] = possible.b[other]
        slack[~at_body] = possible.c[other] + np.sum(normal * z, axis=1)[~at_body]
        normal = normal @ self.shape
        square = np.sum(normal**2, axis=1)
        self.n[moving] -= (2 * np.sum(normal * self.n[moving], axis=1) / square)[:, None] * normal
        self.z[moving] += (np.maximum(_INSIDE - slack, 0.0) / square)[:, None] * normal @ self.shape.T


SHARE = 1e-3  # of its described pseudo-inertia that every body keeps


def inner_point(possible: PossibleSet) -> tuple[Array, Array]:
    """A point to begin with, as far from all bounds as possible, and the possible point nearest to zero, shape (d,).

    ``min |z|`` subject to the bounds; then ``max s`` subject to slack s of all bounds and
    ``|z|^2 <= |z_nearest|^2 + d``.
    """
    d = possible.size
    closest, _ = nearest(possible)
    radius = np.sqrt(float(closest @ closest) + d)
    ball = np.vstack([np.zeros(d + 1), np.hstack([-np.eye(d), np.zeros((d, 1))])])
    most = np.append(np.zeros(d), 1.0)[None]
    further = [
        (ball, np.append(radius, np.zeros(d)), clarabel.SecondOrderConeT(d + 1)),
        (most, np.ones(1), clarabel.NonnegativeConeT(1)),
    ]
    linear = scipy.sparse.csc_matrix((d + 1, d + 1))
    inside, _ = conic_solution(possible, linear, np.append(np.zeros(d), -1.0), [*possible.blocks(slack=True), *further])
    z = inside[:d]
    if not possible.contains(z[None])[0]:
        raise ConicSolverError("samples of the posterior: no possible robot is near the identified one")
    return z, closest


def coordinates_inside(standard: StandardProblem, coordinates: PosteriorCoordinates) -> PossibleSet:
    """Possible robots in the coordinates of a posterior.

    Every body keeps a share of its described pseudo-inertia, ``J_i(z) - share J0_i > 0``, so that no sample is flat to
    rounding; in the body's own scale, ``T^-1 (J_i - share J0_i) T'^-1 > 0`` with ``J0 = T T'``.
    """
    lowest = [SHARE * body.reference for body in standard.bodies]
    scaling = [np.linalg.inv(np.linalg.cholesky(body.reference)) for body in standard.bodies]
    return possible_set(standard, coordinates.origin, coordinates.slope, lowest, scaling)


@dataclass(frozen=True, eq=False)
class PosteriorCoordinates:
    """``theta = origin + slope @ z`` with ``z = (x, y)``."""

    origin: Array  # (t,)
    slope: Array  # (t, d)
    determined: int  # number of the coordinates x, which the data determine; they are the first
    freedom: float  # degrees of freedom nu of their distribution

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.slope.shape[1])

    def theta(self, z: Array) -> Array:
        """Standard parameters, shape (..., t)."""
        return np.asarray(self.origin + z @ self.slope.T)

    def energy(self, z: Array) -> Array:
        """``-log p(z)`` without its constant, shape (...)."""
        x, y = self._squares(z)
        return np.asarray((self.freedom + self.determined) / 2 * np.log1p(x / self.freedom) + y / 2)

    def slope_of_energy(self, z: Array) -> Array:
        """Gradient of `energy`, shape (..., d)."""
        gradient = z.copy()
        x, _ = self._squares(z)
        gradient[..., : self.determined] *= ((self.freedom + self.determined) / (self.freedom + x))[..., None]
        return gradient

    def _squares(self, z: Array) -> tuple[Array, Array]:
        p = self.determined
        return np.sum(z[..., :p] ** 2, axis=-1), np.sum(z[..., p:] ** 2, axis=-1)


def posterior_coordinates(
    standard: StandardProblem, prior: tuple[Array, Array], estimate: Array, covariance: Array, freedom: float
) -> PosteriorCoordinates:
    """Coordinates of a posterior."""  # estimate (b,); covariance (b, b)
    (mean, half), known = prior, np.isfinite(np.diag(covariance))
    A = (standard.A @ standard.S)[known]  # (p, f)
    b, C = estimate[known], covariance[np.ix_(known, known)]
    size = np.sqrt(np.diag(C))
    try:
        L = size[:, None] * np.linalg.cholesky(C / np.outer(size, size))
    except np.linalg.LinAlgError:
        raise InputError("the covariance of the result is not positive definite; identify again") from None
    U, s, W = np.linalg.svd((A @ half) / size[:, None], full_matrices=True)
    p = len(b)
    G = half @ (W[:p].T / s) @ U.T / size  # V A' (A V A')^-1
    origin = mean + G @ (b - A @ mean)
    slope = np.hstack([G @ L, half @ W[p:].T])
    return PosteriorCoordinates(standard.S @ origin, standard.S @ slope, p, freedom)


UNDESCRIBED = 1.0  # relative deviation of what the description does not state


def described_prior(standard: StandardProblem, relative: float, stated: frozenset[str]) -> tuple[Array, Array]:
    """Mean of the free standard parameters phi, ``theta = S phi``, and a factor of their covariance ``half half'``."""
    deviation = np.array([relative if name in stated else max(relative, UNDESCRIBED) for name in standard.names])
    inverse = np.diag(1 / (standard.scale * deviation))
    for body in standard.bodies:
        r = relative if all(standard.names[k] in stated for k in body.index) else UNDESCRIBED
        inverse[np.ix_(body.index, body.index)] = np.linalg.inv(_half_of_body(body.reference, r))
    R = np.linalg.qr(inverse @ standard.S, mode="r")  # the structure's zeros and equalities hold exactly
    mean = np.linalg.lstsq(inverse @ standard.S, inverse @ standard.prior, rcond=None)[0]
    return np.asarray(mean), np.asarray(np.linalg.inv(R))


def _half_of_body(J: Array, relative: float) -> Array:
    """Change of the ten parameters per unit of each entry of E, shape (10, 10)."""
    T, columns = np.linalg.cholesky(J), []
    for i, j in zip(*np.triu_indices(4), strict=True):
        E = np.zeros((4, 4))
        E[i, j] = E[j, i] = relative if i == j else relative / np.sqrt(2)
        columns.append(from_pseudo_inertia(T @ E @ T.T))
    return np.column_stack(columns)
