"""Whether limbs that mirror each other are equal, as `symmetric` takes them to be.

Equal limbs have ``theta = S phi`` with the parameters phi of one of them, and so the base parameters ``beta = H phi``
of the estimate that does not tie them. The combinations ``d = C beta`` with ``C H = 0`` then are zero, within their
covariance ``C Cov C'``. C is chosen with one parameter of the second limbs in each combination.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from excite.identification.estimator import CONFIDENCE, Estimate
from excite.identification.large_residual import Doubt
from excite.information.target import IdentificationTarget
from regressors.errors import listed_names
from regressors.models.mirrored_limbs import mirrored_bodies
from regressors.models.reduction import free_parameters
from regressors.numerical import independent_columns
from regressors.robot.columns import BODY_KINDS, Column
from regressors.robot.robot import Robot, drive_numbers, transmission_of

_NOTHING = 1e-6  # of a singular value, and of a coefficient
_NAMED = 3  # differences in a sentence
_TINY = 1e-6  # probabilities below are not told apart


@dataclass(frozen=True)
class Difference:
    """A parameter of a limb less what the mirrored limb has it to be."""

    parameter: str
    body: str
    value: float
    half_width: float  # of its 99 % interval
    unit: str

    @property
    def text(self) -> str:
        """Its value with its interval."""
        return f"{self.parameter} of {self.body} by {self.value:.3g} +- {self.half_width:.2g} {self.unit}"


@dataclass(frozen=True)
class Symmetry:
    """How far limbs that are tied by `symmetric` differ.

    Parameters
    ----------
    pairs : tuple of str
        Bodies that share their parameters, two in each.
    compared, comparable : int
        Independent combinations of parameters of both limbs that the logs show, and that motions can show.
    probability : float
        Of differences as large or larger between equal limbs, from noise alone, by an F-test of all combinations
        together; 1 where nothing is compared.
    differences : tuple of Difference
        Where that is less than 1 %, the most decisive ones.
    """

    pairs: tuple[str, ...]
    compared: int
    comparable: int
    probability: float
    differences: tuple[Difference, ...] = ()

    @property
    def text(self) -> str:
        """One sentence."""
        tied, chance = listed_names(self.pairs), self._chance
        if self.compared < self.comparable:
            chance += f", in {self.compared} of {self.comparable} comparisons"
        if not self.compared:
            return f"left and right: not compared, since these logs do not show both of {tied}"
        if self.differences:
            return f"left and right: not equal ({chance}): {self._named}"
        return f"left and right: equal within what the logs show ({chance}): {tied}"

    @property
    def _chance(self) -> str:
        return f"p = {self.probability:.2g}" if self.probability > _TINY else f"p < {_TINY:g}"

    @property
    def _named(self) -> str:
        return "; ".join(difference.text for difference in self.differences)

    @property
    def doubt(self) -> Doubt | None:
        """Doubt where the limbs differ."""
        if not self.differences:
            return None
        return Doubt(
            f"left and right differ ({self._chance}): {self._named}",
            "one set of parameters cannot be that of both",
            "identify without `symmetric`",
            about="limbs",
        )


def symmetry_of(tied: IdentificationTarget, apart: IdentificationTarget, estimate: Estimate) -> Symmetry:
    """Compare limbs by an estimate of the parameters of `apart`, in which they are not tied."""
    pairs, structure = mirrored_bodies(apart.robot), tied.model.robot.structure
    definition, names = apart.model.definition()
    H = apart.base.D @ definition @ free_parameters(structure, names)[1]  # (b, f)
    seen = np.flatnonzero(np.isfinite(estimate.values) & np.isfinite(estimate.deviation))
    N = scipy.linalg.null_space(H[seen].T, rcond=_NOTHING).T  # (k, seen)
    counts = len(N), len(H) - int(np.linalg.matrix_rank(H, rtol=_NOTHING))
    if not len(N):
        return Symmetry(pairs, *counts, 1.0)
    first = np.array([estimate.names[k] not in structure.mirrored for k in seen])
    order = np.argsort(first, kind="stable")
    chosen = order[independent_columns(N[:, order], _NOTHING)]
    C = np.linalg.solve(N[:, chosen], N)
    d, V = C @ estimate.values[seen], C @ estimate.covariance[np.ix_(seen, seen)] @ C.T
    freedom, deviation = max(estimate.degrees_of_freedom, 1), np.sqrt(np.diag(V))
    z = d / deviation
    F = float(z @ np.linalg.pinv(V / np.outer(deviation, deviation), hermitian=True) @ z) / len(z)
    probability = float(scipy.special.fdtrc(len(z), freedom, F))
    if not probability < 1 - CONFIDENCE:
        return Symmetry(pairs, *counts, probability)
    half = deviation * float(scipy.special.stdtrit(freedom, 0.5 + CONFIDENCE / 2))
    columns = [apart.base.columns[k] for k in apart.base.index[seen[chosen]]]
    differences = (
        Difference(columns[k].name, _owner(columns[k], apart.robot), float(d[k]), float(half[k]), columns[k].unit)
        for k in np.argsort(-np.abs(z))[:_NAMED]
        if k == np.argmax(np.abs(z)) or abs(d[k]) > half[k]
    )
    return Symmetry(pairs, *counts, probability, tuple(differences))


def _owner(column: Column, robot: Robot) -> str:
    """Name of the body, or of the drive, of a parameter."""
    numbers, names = robot.body_numbers, [body.name for body in robot.bodies]
    if column.kind not in BODY_KINDS:
        numbers, names = drive_numbers(robot), [drive.name for drive in transmission_of(robot).drives]
    return names[numbers.index(column.owner)] if column.owner in numbers else ""
