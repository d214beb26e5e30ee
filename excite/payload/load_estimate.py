"""Estimate of a load, and of the gains, from equations with and without it: y = (1 + e)(W beta + K phi + F d).

Gauss-Newton iterations on ``y = (1 + e) (W beta + K phi + F d) + noise`` with normal priors on e, d and, where it is
known, beta. Rows are weighted by the size of their residuals and by how many of them are independent, so that what is
known of the gains counts as much as it should. The covariance is that of stationary autoregressive noise, see
`excite.identification.noise`, each deviation at least that from the scatter between blocks of time.

beta are the parameters of what is there without the load, phi the ten of the load, d how far friction in the loaded
log is from that in the other, and e the relative error of the gain of each drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from excite.identification.estimator import CONFIDENCE
from excite.identification.noise import NoiseGroup, autocorrelation, autoregressive_covariance, effective_samples
from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.models.load import LOAD_PARAMETERS
from regressors.numerical import column_lengths
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.samples import Array, Index

_ROUNDS, _WEIGHTED = 12, 3
_SETTLED = 1e-8
_SINGULAR = 1e-9  # of the largest singular value, of columns of unit length
_BLOCKS = 30  # of each log
_PER_DEGREE = 4  # effective rows, as in excite.identification.covariance
_LEAST_FREEDOM = 3


@dataclass(frozen=True, eq=False)
class LoadEstimate:
    """Parameters of a load with their covariance."""

    phi: Array  # (10,) about the origin of the last link's frame [kg, kg m, kg m^2]
    covariance: Array  # (10, 10) of phi: noise, model and gains
    by_gains: Array  # (10, 10) the part of it that is due to the gains
    gains: Array  # (k,) relative errors e of the gains
    gains_covariance: Array  # (k, k)
    beta: Array  # (p,)
    degrees_of_freedom: int  # of Student's t
    residuals: Array  # (m,)
    effective: float  # rows that are as good as independent

    @property
    def quantile(self) -> float:
        """Half of the 99 % interval over the standard deviation."""
        return float(scipy.special.stdtrit(self.degrees_of_freedom, 0.5 + CONFIDENCE / 2))


def estimate_load(equations: LoadEquations, mass: float | None = None, start: float = 1.0) -> LoadEstimate:
    """Estimate a load, with all that is uncertain beside it."""
    problem = _Problem(equations, mass, start)
    problem.iterate()
    return problem.estimate()


class _Problem:
    """The unknowns are ``[beta, phi, d, e]``."""

    def __init__(self, equations: LoadEquations, mass: float | None, start: float) -> None:
        self.equations = equations
        self.k, self.width = equations.gains.shape[0], equations.rows.shape[1]
        self.size = self.width + self.k
        self.places = np.arange(self.size)[equations.place]
        self.free = np.arange(self.size) if mass is None else np.delete(np.arange(self.size), self.places[0])
        self.x = np.zeros(self.size)
        if equations.known is not None:
            self.x[: equations.p] = equations.known
        if mass is not None:
            self.x[self.places[0]] = mass
        self.centre = self.x.copy()
        self.x[self.width :] = 1.0 / start - 1.0
        self.prior = self._prior()
        e = equations
        factors = [np.linalg.qr(e.rows[rows]) for rows in e.groups]
        self.reduced = [(Q.T @ e.observations.y[rows], R) for rows, (Q, R) in zip(e.groups, factors, strict=True)]
        sizes = [float(np.sqrt(np.mean(e.observations.y[rows] ** 2))) for rows in e.groups]
        self.weight = 1.0 / np.maximum(sizes, 1e-9 * max(*sizes, 1e-300))  # equal sizes at first
        self.effective = float(e.observations.y.size)

    def _prior(self) -> Array:
        """Factor P of the prior's precision, ``|P (x - x0)|^2``."""
        e, p = self.equations, self.equations.p
        blocks = []
        if e.known is not None and e.covariance is not None:
            blocks.append(_placed(_precision_factor(e.covariance), np.arange(p), self.size))
        place = np.arange(e.place.stop, self.width)
        blocks.append(_placed(np.diag(1.0 / e.changes), place, self.size))
        if self.k:
            blocks.append(_placed(_precision_factor(e.gains), np.arange(self.width, self.size), self.size))
        return np.concatenate(blocks)

    def iterate(self) -> None:
        for number in range(_ROUNDS):
            if 0 < number <= _WEIGHTED:
                self._reweight()
            step = self._step()
            self.x += step
            moved = np.abs(step[self.places]).max() < _SETTLED * max(np.abs(self.x[self.places]).max(), 1e-12)
            if moved and number > _WEIGHTED:
                break
        self._reweight()

    def _jacobian(self, R: Array, j: int) -> tuple[Array, Array]:
        """Prediction and its derivative for rows of equation j, from rows of ``[W, K, F]`` or a factor of them."""
        e, factor = self.equations, 1.0 + float(self.x[self.width + j]) if self.k else 1.0
        J = np.zeros((R.shape[0], self.size))
        scaled = np.arange(self.width) if e.scales_all else self.places
        J[:, : self.width] = R
        J[:, scaled] *= factor
        if self.k:
            J[:, self.width + j] = R[:, scaled] @ self.x[scaled]
        return J[:, : self.width] @ self.x[: self.width], J

    def _reweight(self) -> None:
        """One over the noise of each group, for as many rows as are independent."""
        e = self.equations
        weights, effective = [], 0.0
        for rows, j in zip(e.groups, e.equation, strict=True):
            error = e.observations.y[rows] - self._jacobian(e.rows[rows], int(j))[0]
            count = effective_samples(autocorrelation(error), error.size)
            floor = 1e-9 * float(np.sqrt(np.mean(e.observations.y[rows] ** 2)))
            size = max(float(np.sqrt(np.mean(error**2))), floor, 1e-300)
            weights.append(np.sqrt(count / error.size) / size)
            effective += count
        self.weight, self.effective = np.array(weights), effective

    def _system(self) -> tuple[Array, Array]:
        blocks, rights = [], []
        for (y, R), j, w in zip(self.reduced, self.equations.equation, self.weight, strict=True):
            predicted, J = self._jacobian(R, int(j))
            blocks.append(w * J)
            rights.append(w * (y - predicted))
        A, b = np.concatenate([*blocks, self.prior]), np.concatenate([*rights, -self.prior @ (self.x - self.centre)])
        return A[:, self.free], b

    def _step(self) -> Array:
        A, b = self._system()
        scale = column_lengths(A)
        step = np.zeros(self.size)
        step[self.free] = np.linalg.lstsq(A / scale, b, rcond=_SINGULAR)[0] / scale
        return step

    def estimate(self) -> LoadEstimate:
        e = self.equations
        A, _ = self._system()
        scale = column_lengths(A)
        _, sigma, V = np.linalg.svd(np.linalg.qr(A / scale, mode="r"), full_matrices=False)
        shown = sigma > _SINGULAR * sigma[0]
        self._check_shown(V[~shown])
        half = (V[shown].T / sigma[shown]) / scale[:, None]  # half half' is the covariance of the weighted rows
        errors = np.empty(e.observations.y.size)
        groups, scores = [], []
        drifts = np.zeros((errors.size, 0)) if e.drifts is None else e.drifts
        drifted = np.zeros((half.shape[1], drifts.shape[1]))
        for rows, j, w in zip(e.groups, e.equation, self.weight, strict=True):
            predicted, J = self._jacobian(e.rows[rows], int(j))
            errors[rows] = e.observations.y[rows] - predicted
            X = J[:, self.free] @ half
            groups.append(NoiseGroup(errors[rows], X, w**2 * X, np.ones((rows.size, 1))))
            scores.append(w**2 * X * errors[rows, None])
            drifted += w**2 * X.T @ drifts[rows]
        noise = autoregressive_covariance(groups, self.effective)
        prior = self.prior[:, self.free] @ half
        reduced = noise + prior.T @ prior
        blocked = _between_blocks(e, scores, half.shape[1])
        covariance = half @ reduced @ half.T
        wider = half @ (blocked + prior.T @ prior) @ half.T
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.sqrt(np.maximum(np.nan_to_num(np.diag(wider) / np.diag(covariance), nan=1.0), 1.0))
        covariance = covariance * np.outer(ratio, ratio) + half @ (drifted @ drifted.T) @ half.T
        whole = np.zeros((self.size, self.size))
        whole[np.ix_(self.free, self.free)] = covariance
        of_gains = self.prior[-self.k :, self.free] @ half if self.k else np.zeros((0, half.shape[1]))
        by_gains = np.zeros((self.size, self.size))
        by_gains[np.ix_(self.free, self.free)] = half @ (of_gains.T @ of_gains) @ half.T
        freedom = max(_LEAST_FREEDOM, int((self.effective - sigma.size) / (_PER_DEGREE * max(1, len(e.groups)))))
        own, k = np.ix_(self.places, self.places), slice(self.width, self.size)
        phi, gains, beta = self.x[self.places], self.x[k], self.x[: e.p]
        return LoadEstimate(phi, whole[own], by_gains[own], gains, whole[k, k], beta, freedom, errors, self.effective)

    def _check_shown(self, null: Array) -> None:
        """Refuse motions that do not show all of the load's parameters."""
        places = np.flatnonzero(np.isin(self.free, self.places)) if null.size else ()
        # what is not shown of beta alone does not matter
        names = [LOAD_PARAMETERS[int(self.free[k] - self.places[0])] for k in places if np.abs(null[:, k]).max() > 1e-6]
        if names:
            raise InputError(not_shown(names))


def not_shown(names: list[str]) -> str:
    """What to say of parameters of a load that a motion does not show."""
    shows = {
        "m": "the mass shows where its weight changes a torque: move joints whose axes are not vertical",
        "mc": "the centre shows where the load is turned against gravity: turn the wrist about two axes",
        "I": "the inertia shows where the load is turned with changing speed about three axes",
    }
    causes = [text for kind, text in shows.items() if kind in {name.rstrip("xyz") for name in names}]
    return (
        f"the motion does not show {', '.join(names)} of the load; {'; '.join(causes)}. A motion that shows all of "
        "them is made by `design_payload_motion`"
    )


def _placed(block: Array, place: Index, size: int) -> Array:
    whole = np.zeros((block.shape[0], size))
    whole[:, place] = block
    return whole


def _precision_factor(C: Array) -> Array:
    """P of ``C^-1 = P'P``, one row for each unknown; directions that are exact get a very small deviation."""
    values, vectors = scipy.linalg.eigh((C + C.T) / 2)
    floor = max(1e-12 * float(np.abs(values).max(initial=0.0)), 1e-16)
    return np.asarray((vectors / np.sqrt(np.maximum(values, floor))).T)


def _between_blocks(equations: LoadEquations, scores: list[Array], size: int) -> Array:
    """Covariance of the sums of scores from their scatter between blocks of time, all equations of a log together."""
    total = np.zeros((size, size))
    log = equations.observations.log
    for number in range(int(log.max()) + 1):
        own = [(rows, s) for rows, s in zip(equations.groups, scores, strict=True) if log[rows[0]] == number]
        if not own:
            continue
        time = np.concatenate([equations.observations.time[rows] for rows, _ in own])
        edges = np.linspace(time.min(), time.max(), _BLOCKS + 1)[1:-1]
        sums = np.zeros((_BLOCKS, size))
        for rows, score in own:
            np.add.at(sums, np.searchsorted(edges, equations.observations.time[rows]), score)
        total += sums.T @ sums
    return total


@dataclass(frozen=True, eq=False)
class LoadEquations:
    """Rows of all logs, and what is known beforehand."""

    observations: Observations  # W and y, in corrected gains
    load: Array  # (m, 10) K; zero in rows without the load
    friction: Array  # (m, f) F; zero in rows without the load
    changes: Array  # (f,) standard deviations of d
    gains: Array  # (k, k) covariance of e, one for each equation; of no rows where gains do not matter
    known: Array | None = None  # (p,) beta of an earlier identification; unknown if not given
    covariance: Array | None = None  # (p, p) of `known`
    drifts: Array | None = None  # (m, c) changes of the rows that are not estimated, each of deviation one
    scales_all: bool = True  # False where e changes K phi only, since beta is from torques with the same gains

    @property
    def p(self) -> int:
        """Number of parameters beta."""
        return int(self.observations.W.shape[1])

    @property
    def place(self) -> slice:
        """Of phi among all unknowns."""
        return slice(self.p, self.p + PARAMETERS_PER_LINK)

    @cached_property
    def rows(self) -> Array:
        """``[W, K, F]``, shape (m, p + 10 + f)."""
        return np.hstack([self.observations.matrix, self.load, self.friction])

    @cached_property
    def groups(self) -> tuple[Index, ...]:
        """Rows of each log and equation that has any."""
        group = self.observations.group
        return tuple(rows for g in range(int(group.max()) + 1) if (rows := np.flatnonzero(group == g)).size)

    @property
    def equation(self) -> Index:
        """Equation of each group."""
        return self.observations.equation[[rows[0] for rows in self.groups]]
