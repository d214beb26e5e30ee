"""Parameters that are identifiable individually from a partial motion, and motions that identify a parameter."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

import numpy as np

from regressors.models.base import MOST_STATES, random_states, triangular_factor
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion, drive_names, of_drives
from regressors.samples import Array

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
