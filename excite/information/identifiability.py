"""Parameters that are identifiable individually from a partial motion, and motions that identify a parameter.

Base parameters without those that motions show in theory only.

Which these are, is found on independent states, as many as the motion has samples: from the right, one after the other,
those whose predicted deviation is more than `FACTOR` times their size. What is left of the regressor has a rank of its
own, with the second gap of the singular values behind it, and base columns are chosen of it as of any other.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations

import numpy as np

from excite.information.prior import base_sizes, column_sizes
from excite.tasks.task import Task
from regressors.models.base import CHOICES, MOST_STATES, Base, base_of, random_states, triangular_factor
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion, drive_names, of_drives
from regressors.samples import Array, Samples

_TOLERANCE = 1e-7


class Identifiability:
    """Row spaces of a model under partial motions."""

    def __init__(self, model: RegressorModel) -> None:
        self.model = model
        self._states = random_states(model.robot, MOST_STATES)
        whole = triangular_factor(model.instants(self._states))
        sizes = np.linalg.norm(whole, axis=0)
        self._scale = np.where(sizes > 0, sizes, 1.0)

    def rows(self, motion: PartialMotion, equations: tuple[str, ...] | None = None) -> Array:
        """Basis of the row space of a partial motion, columns scaled by their norm for motions of all joints."""
        W = self.model.restricted(motion, equations).instants(motion.states(self._states))
        return _independent(triangular_factor(W) / self._scale)

    def rank(self, factors: Iterable[Array]) -> int:
        """Number of parameter combinations that the motions identify together."""
        return len(_independent(np.vstack(list(factors))))

    def shown(self, factors: Iterable[Array]) -> list[int]:
        """Indices of the parameters that the motions together identify individually."""
        V = _independent(np.vstack(list(factors)))
        rest = np.eye(V.shape[1]) - V.T @ V
        return [k for k in range(V.shape[1]) if np.linalg.norm(rest[k]) < _TOLERANCE * 100]


def _independent(rows: Array) -> Array:
    """Orthonormal basis of a row space, shape (rank, p)."""
    if rows.shape[0] == 0:
        return rows
    _, sigma, V = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(V[sigma > _TOLERANCE * sigma[0]]) if sigma[0] > 0 else V[:0]


def partial_motions(model: RegressorModel, at_once: int) -> list[tuple[tuple[str, ...], PartialMotion]]:
    """Motions of every selection of at most ``at_once`` drives, fewest first."""
    names = drive_names(model.robot)
    sizes = range(1, min(at_once, len(names)) + 1)
    return [(moving, of_drives(model.robot, moving)) for size in sizes for moving in combinations(names, size)]


def identifying_motion(model: RegressorModel, parameter: int) -> tuple[str, ...] | None:
    """Fewest drives whose motion identifies a parameter individually; None if no motion does."""
    identifiability = Identifiability(model)
    for moving, motion in partial_motions(model, len(drive_names(model.robot))):
        if parameter in identifiability.shown([identifiability.rows(motion)]):
            return moving
    return None


FACTOR = 100.0
_ALONE = 0.3  # part of a column that the others must explain, or it counts as nothing
_NOTHING = 1e-6  # of a coefficient of what is explained


def inverse_half(W: Array) -> Array:
    """H with ``(W'W)^-1 = H H'``, shape (b, b), of columns of any size."""  # W (k, b)
    length = np.linalg.norm(W, axis=0)
    length = np.where(length > 0, length, 1.0)
    return np.asarray(np.linalg.pinv(np.linalg.qr(W / length, mode="r"), rcond=1e-15) / length[:, None])


def visible_bases(
    model: RegressorModel, torques: RegressorModel, bases: tuple[Base, ...], states: Samples, task: Task
) -> tuple[Base, ...]:
    """Base columns of both choices, without parameters that are nearly unidentifiable."""
    base = bases[0]
    given = (1.0,) if model.window is not None or task.objective.noise is None else task.objective.noise
    rows = len(torques.row_labels)
    noise = np.broadcast_to(np.asarray(given if len(given) in (1, rows) else (1.0,), dtype=float), (rows,))
    W = torques.instants(states)[:, [torques.names.index(name) for name in base.names]]
    W = W / np.tile(noise, states.time.size)[:, None]
    count = task.trajectory.period * task.output.rate
    kept = _kept(W * np.sqrt(count / states.time.size), base_sizes(model, base))
    if len(kept) == base.rank:
        return bases
    R = triangular_factor(model.instants(states))
    visible = R[:, base.index] @ _explained(R[:, base.index], kept) @ base.D
    chosen = (base_of(model, visible, choice) for choice in CHOICES)
    values = _singular_values(R, column_sizes(model))
    return tuple(replace(part, singular_values=values) for part in chosen)


def _singular_values(R: Array, size: Array) -> Array:
    """Of columns in units of their sizes; one without a size is as long as the longest one with."""
    length = np.linalg.norm(R, axis=0)
    known = np.isfinite(size)
    longest = float((length[known] * size[known]).max(initial=0.0)) or 1.0
    unit = np.where(known, size, longest / np.where(length > 0, length, np.inf))
    return np.asarray(np.linalg.svd(R * unit, compute_uv=False), dtype=float)


def _kept(W: Array, size: Array) -> list[int]:
    """Columns that are left when those seen too badly are taken away from the right."""
    kept = list(range(W.shape[1]))
    while kept:
        deviation = np.linalg.norm(inverse_half(W[:, kept]), axis=1)
        hidden = np.flatnonzero(deviation > FACTOR * size[kept])
        if hidden.size == 0:
            break
        del kept[hidden[-1]]
    return kept


def _explained(R: Array, kept: list[int]) -> Array:
    """Every column by those kept, shape (b, b): itself, a combination of them, or nothing."""
    A = np.zeros((R.shape[1],) * 2)
    A[kept, kept] = 1.0
    for j in sorted(set(range(R.shape[1])) - set(kept)):
        part = np.linalg.lstsq(R[:, kept], R[:, j], rcond=None)[0]
        size = np.linalg.norm(R[:, j])
        if np.linalg.norm(R[:, j] - R[:, kept] @ part) > _ALONE * size:
            continue
        part[np.abs(part) * np.linalg.norm(R[:, kept], axis=0) < _NOTHING * size] = 0.0
        nearest = np.round(part)
        A[kept, j] = np.where(np.abs(part - nearest) < _NOTHING, nearest, part)
    return A
