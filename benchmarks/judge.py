"""An evaluator that shares no code with what it judges: Pinocchio's regressor, SciPy's QR, NumPy's roots.

A motion is ``q_j(t) = offset_j + sum_k cosine_jk cos(k w t) + sine_jk sin(k w t)``, w = 2 pi / period.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]
import scipy.linalg
from numpy.typing import NDArray
from problems import PROBLEMS, RATE, Problem

Array = NDArray[np.float64]

_TOLERANCE = 1e-8  # of the first pivot: what is less counts as nothing
_TIE = 1e-6  # rests that differ by less count as equal where ties go to the left
_DENSE = 100_000.0  # [Hz]
_CHUNK = 50_000
_ORDER = (0, 1, 2, 3, 4, 5, 7, 6, 8, 9)  # Pinocchio has m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz
_NAMES = ("m{0}", "m{0}c{0}x", "m{0}c{0}y", "m{0}c{0}z", *(f"I{{0}}{a}" for a in ("xx", "xy", "xz", "yy", "yz", "zz")))


@dataclass(frozen=True, eq=False)
class Motion:
    """A finite Fourier series per joint.

    Parameters
    ----------
    period : float
        [s]
    offset : ndarray, shape (n,)
    cosine, sine : ndarray, shape (n, K)
    """

    period: float
    offset: Array
    cosine: Array
    sine: Array

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> Motion:
        """From the ``trajectory`` of a ``design.json``."""
        return cls(plain["period"], *(np.array(plain[part], dtype=float) for part in ("offset", "cosine", "sine")))

    def _phasors(self, derivative: int) -> Array:
        """``c_k`` of ``q^(d) = Re sum_k c_k exp(i k w t)`` without the offset, shape (n, K), complex."""
        omega = 2 * np.pi / self.period * np.arange(1, self.cosine.shape[1] + 1)
        return np.asarray((self.cosine - 1j * self.sine) * (1j * omega) ** derivative)

    def values(self, time: Array, derivative: int) -> Array:
        """Position (0), velocity (1) or acceleration (2) at given instants, shape (N, n)."""
        order = 2 * np.pi / self.period * np.arange(1, self.cosine.shape[1] + 1)
        phase = np.outer(time, order)
        c = self._phasors(derivative).T
        constant = self.offset if derivative == 0 else 0.0
        return np.asarray(np.cos(phase) @ c.real - np.sin(phase) @ c.imag + constant)

    def extreme_times(self, derivative: int) -> Array:
        """Instants among which every extremum lies: angles of all roots of the next derivative, in z = exp(i w t)."""
        zero = np.zeros(1)
        angles: list[Array] = [zero]
        for c in self._phasors(derivative + 1):
            angles.append(np.asarray(np.angle(np.roots(np.concatenate([c[::-1], zero, np.conj(c)])))))
        return np.concatenate(angles) * self.period / (2 * np.pi)


@cache
def pinocchio_model(name: str) -> tuple[Any, Any]:
    """Pinocchio's model of the arm with everything off the chain locked at zero."""
    problem = PROBLEMS[name]
    full = pin.buildModelFromUrdf(str(problem.path))
    tip = full.frames[full.getFrameId(problem.tip)].parentJoint
    chain = list(full.supports[tip])
    model = pin.buildReducedModel(full, [j for j in range(1, full.njoints) if j not in chain], pin.neutral(full))
    return model, model.createData()


def standard_names(links: int) -> list[str]:
    """Names of the ten inertial parameters of every link, in this project's order."""
    return [name.format(link) for link in range(1, links + 1) for name in _NAMES]


def column_names(problem: Problem) -> list[str]:
    """`standard_names` of an arm."""
    return standard_names(len(problem.lower))


def numbers_in_pinocchio(links: int) -> NDArray[np.intp]:
    """Pinocchio's number of each of our columns."""
    return np.concatenate([np.array(_ORDER) + 10 * link for link in range(links)])


def leftmost_columns(W: Array) -> NDArray[np.intp]:
    """Numbers of the columns that are independent of those to their left."""
    size = np.abs(np.diag(np.linalg.qr(W, mode="r")))
    return np.flatnonzero(size > _TOLERANCE * size.max())


def regressor(problem: Problem, q: Array, dq: Array, ddq: Array, *, pinocchio_order: bool = False) -> Array:
    """Stacked W, instant by instant, shape (N n, 10 n)."""
    model, data = pinocchio_model(problem.name)
    rows = [pin.computeJointTorqueRegressor(model, data, *state).copy() for state in zip(q, dq, ddq, strict=True)]
    W = np.concatenate(rows)
    return W if pinocchio_order else np.asarray(W[:, numbers_in_pinocchio(model.nv)])


def torques_and_tool(problem: Problem, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, Array]:
    """Torques of the joints (N, n), place of the last link's frame in the base frame (N, 3), and its speed (N,)."""
    model, data = pinocchio_model(problem.name)
    torque, place, speed = [], [], []
    for state in zip(q, dq, ddq, strict=True):
        torque.append(pin.rnea(model, data, *state))
        pin.forwardKinematics(model, data, *state[:2])
        place.append(data.oMi[model.njoints - 1].translation.copy())
        speed.append(np.linalg.norm(data.v[model.njoints - 1].linear))
    return np.array(torque), np.array(place), np.array(speed)


def torque_limits(problem: Problem) -> Array:
    """Torque limits in the URDF, shape (n,) [Nm]."""
    return np.array(pinocchio_model(problem.name)[0].effortLimit)


def described_parameters(problem: Problem) -> Array:
    """Values of `column_names` in the URDF, shape (10 n,)."""
    inertias = pinocchio_model(problem.name)[0].inertias[1:]
    return np.concatenate([inertia.toDynamicParameters()[list(_ORDER)] for inertia in inertias])


def random_states(problem: Problem, draws: str = "in turn") -> tuple[Array, Array, Array]:
    """2000 states uniform within the limits from ``default_rng(0)``, in one of the orders in which one may draw them.

    Parameters
    ----------
    problem : Problem
    draws : {"in turn", "state by state", "joint by joint"}
        q (2000, n), then dq, then ddq; or all of one state, then the next; or 2000 of one joint's q, then the next.
    """
    rng, count = np.random.default_rng(0), 2000
    bounds = [problem.bounds(derivative) for derivative in range(3)]
    n = len(problem.lower)
    if draws == "state by state":
        lower, upper = (np.concatenate([pair[side] for pair in bounds]) for side in (0, 1))
        X = rng.uniform(lower, upper, (count, 3 * n))
        return X[:, :n], X[:, n : 2 * n], X[:, 2 * n :]
    if draws == "joint by joint":
        q, dq, ddq = (np.column_stack([rng.uniform(a[j], b[j], count) for j in range(n)]) for a, b in bounds)
    else:
        q, dq, ddq = (rng.uniform(a, b, (count, n)) for a, b in bounds)
    return q, dq, ddq


def lapack_columns(problem: Problem, draws: str = "in turn", rows: str = "instants") -> list[str]:
    """Names of the base columns that SciPy's (LAPACK's) column-pivoted QR finds in Pinocchio's stack.

    Parameters
    ----------
    problem : Problem
    draws : str
        See `random_states`.
    rows : {"instants", "joints"}
        All joints of an instant, then the next instant; or all instants of a joint, then the next joint.
    """
    n = len(problem.lower)
    W = regressor(problem, *random_states(problem, draws), pinocchio_order=True)
    if rows == "joints":
        W = W.reshape(-1, n, 10 * n).transpose(1, 0, 2).reshape(-1, 10 * n)
    R, pivots = scipy.linalg.qr(W, mode="r", pivoting=True)
    size = np.abs(np.diag(R))
    chosen = pivots[: len(size)][size > _TOLERANCE * size[0]]
    place = [10 * link + p for link in range(n) for p in _ORDER]  # Pinocchio's number of each of our columns
    names = column_names(problem)
    return [names[k] for k in sorted(place.index(int(p)) for p in chosen)]


def _rests(R: Array, chosen: list[int]) -> Array:
    """Length of what is left of every column without its part in the span of those chosen."""
    if not chosen:
        return np.asarray(np.linalg.norm(R, axis=0))
    Q = scipy.linalg.orth(R[:, chosen])
    return np.asarray(np.linalg.norm(R - Q @ (Q.T @ R), axis=0))


def _leftmost_pivots(R: Array) -> list[int]:
    """Column-pivoted QR by projection, ties to the left."""
    chosen: list[int] = []
    first = float(_rests(R, chosen).max())
    while (size := _rests(R, chosen)).max() > _TOLERANCE * first:
        chosen.append(int(np.argmax(size >= (1 - _TIE) * size.max())))
    return chosen


@cache
def base_columns(name: str) -> dict[str, list[str]]:
    """Names of the base columns of every choice, for the problem of that name."""
    problem = PROBLEMS[name]
    R = np.asarray(np.linalg.qr(regressor(problem, *random_states(problem)), mode="r"))
    names = column_names(problem)
    return {
        "gautier": [names[k] for k in leftmost_columns(R)],
        "pivoted": [names[k] for k in sorted(_leftmost_pivots(R))],
        "pivoted-lapack": lapack_columns(problem),
    }


def _cond(W: Array, rank: int) -> float:
    sigma = np.linalg.svd(W, compute_uv=False)
    return float(sigma[0] / sigma[rank - 1])


def condition_numbers(problem: Problem, motion: Motion) -> dict[str, float]:
    """cond(W) at 1001 instants under every convention; friction is the exact sign of velocity."""
    time = np.linspace(0.0, motion.period, round(motion.period * RATE) + 1)
    q, dq, ddq = (motion.values(time, derivative) for derivative in range(3))
    W = regressor(problem, q, dq, ddq)
    n = len(problem.lower)
    eye = np.eye(n)
    friction = np.hstack([(np.sign(dq)[:, :, None] * eye).reshape(-1, n), (dq[:, :, None] * eye).reshape(-1, n)])
    everything = np.asarray(
        np.linalg.qr(np.hstack([W, friction]), mode="r")
    )  # has the singular values of any choice of columns
    W, friction = everything[:, : 10 * n], everything[:, 10 * n :]
    names = column_names(problem)
    choices = {key: W[:, [names.index(name) for name in chosen]] for key, chosen in base_columns(problem.name).items()}
    rank = choices["gautier"].shape[1]
    found = {key: _cond(columns, rank) for key, columns in choices.items()}
    found["orthonormal"] = _cond(W, rank)
    found["friction"] = _cond(np.hstack([choices["pivoted"], friction]), rank + 2 * n)
    found["friction-lapack"] = _cond(np.hstack([choices["pivoted-lapack"], friction]), rank + 2 * n)
    return found


def limit_use(problem: Problem, motion: Motion, *, dense: bool = True) -> dict[str, float]:
    """Largest part of the way from the middle of a limit's range to its edge that is used; above 1 it is broken.

    Returns
    -------
    dict
        ``exact`` over continuous time and, if wanted, ``dense`` at 100 kHz.
    """
    grid = np.linspace(0.0, motion.period, round(motion.period * _DENSE) + 1)
    chunks = np.array_split(grid, len(grid) // _CHUNK) if dense else []
    found = {"exact": 0.0} | ({"dense": 0.0} if dense else {})
    for derivative in range(3):
        lower, upper = problem.bounds(derivative)
        for key, times in (("exact", [motion.extreme_times(derivative)]), ("dense", chunks)):
            for time in times:
                values = motion.values(time, derivative)
                use = np.abs(values - 0.5 * (lower + upper)) / (0.5 * (upper - lower))
                found[key] = max(found[key], float(use.max()))
    return found


def restlessness(motion: Motion) -> float:
    """Largest velocity [rad/s] or acceleration [rad/s^2] at both ends."""
    ends = np.array([0.0, motion.period])
    return max(float(np.abs(motion.values(ends, derivative)).max()) for derivative in (1, 2))


def judgement(name: str, trajectory: Mapping[str, Any], *, dense: bool = True) -> dict[str, Any]:
    """Everything about one motion: condition numbers, use of the limits, rest, and the verdict ``feasible``."""
    problem, motion = PROBLEMS[name], Motion.of(trajectory)
    use, rest = limit_use(problem, motion, dense=dense), restlessness(motion)
    return {
        "condition_numbers": condition_numbers(problem, motion),
        "limit_use": use,
        "restlessness": rest,
        "feasible": max(use.values()) <= 1.0 + 1e-9 and rest <= 1e-9,
    }
