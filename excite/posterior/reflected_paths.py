"""Hamiltonian Monte Carlo in a convex set whose walls reflect [Afshar, Domke 2015], [Chalkis et al. 2023].

A path alternates kicks by the energy's slope with straight drifts; where a drift meets a wall, the velocity is
reflected at its normal. The next wall is exact: of a body ``M + s Q`` is singular at ``s = -1 / lambda_min`` with the
least eigenvalue of ``L^-1 Q L'^-1``, ``M = L L'``. Reflections keep volume and energy, so that the usual acceptance
makes the density right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.identification.estimators.possible_set import PossibleSet
from excite.posterior.posterior_coordinates import PosteriorCoordinates
from regressors.samples import Array, Index

_STEPS = 6  # drifts of a path
STEP = (
    0.25  # their mean length in deviations; 4 of 0.35 gave as many draws a second for a Panda, 8 of 0.15 a third less
)
_SPREAD = 0.2  # of the length of a drift, from path to path
_INSIDE = 1e-8  # slack in a constraint's own size that a point has after a reflection
_MOST = 2000  # reflections in one drift


def next_points(
    coordinates: PosteriorCoordinates,
    possible: PossibleSet,
    z: Array,
    rng: np.random.Generator,
    shape: Array,
    length: float = STEP,
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
            walls = self._walls(moving)
            moving, walls = moving[walls.sound], walls.of(walls.sound)
            hit = walls.distance < left[moving]
            travelled = np.where(hit, walls.distance, left[moving])
            self.z[moving] += travelled[:, None] * (self.n[moving] @ self.shape.T)
            left[moving] -= travelled
            moving = moving[hit]
            if not moving.size:
                return
            self._reflect(moving, walls.of(hit))
        self.sound[moving] = False

    def _walls(self, moving: Index) -> _Walls:
        """The next wall of each chain."""
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
        return _Walls(distance[every, number], number, u / np.linalg.norm(u, axis=1)[:, None], sound)

    def _reflect(self, moving: Index, walls: _Walls) -> None:
        """Reflect velocities at the walls, and set the points inside of them by what rounding takes."""
        possible, of_bodies = self.possible, len(self.possible.M)
        normal, slack = np.zeros((len(moving), possible.size)), np.zeros(len(moving))
        at_body = walls.number < of_bodies
        body, u, z = walls.number[at_body], walls.u[at_body], self.z[moving]
        normal[at_body] = np.einsum("ni,nijd,nj->nd", u, possible.B[body], u)
        slack[at_body] = np.einsum("ni,nij,nj->n", u, possible.M[body], u) + np.sum(normal * z, axis=1)[at_body]
        other = walls.number[~at_body] - of_bodies
        normal[~at_body] = possible.b[other]
        slack[~at_body] = possible.c[other] + np.sum(normal * z, axis=1)[~at_body]
        normal = normal @ self.shape
        square = np.sum(normal**2, axis=1)
        self.n[moving] -= (2 * np.sum(normal * self.n[moving], axis=1) / square)[:, None] * normal
        self.z[moving] += (np.maximum(_INSIDE - slack, 0.0) / square)[:, None] * normal @ self.shape.T


@dataclass(frozen=True, eq=False)
class _Walls:
    """Of each chain: distance to the next wall, its number, bodies first, and the body's null vector there."""

    distance: Array
    number: Index
    u: Array
    sound: NDArray[np.bool_]

    def of(self, chosen: NDArray[np.bool_]) -> _Walls:
        return _Walls(self.distance[chosen], self.number[chosen], self.u[chosen], self.sound[chosen])
