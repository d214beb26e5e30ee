"""What earlier experiments tell of the parameters, as the objective of a task holds it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regressors.errors import InputError

if TYPE_CHECKING:  # what describes options must be imported in no time
    import numpy as np
    from numpy.typing import NDArray

RESULT, DESIGN = "result", "design"


@dataclass(frozen=True, eq=False, repr=False)
class EarlierInformation:
    """Information of one earlier result, or of one run of a design that is going to be played.

    It is about the combinations ``A u`` of standard parameters u. That of a result is the inverse of the covariance
    that it states; that of a design is ``sum_j F_j' F_j / n_j^2`` over its equations j, with the density n_j of their
    noise: the standard deviation of a row times the root of the time between rows, which does not depend on the rate.

    Parameters
    ----------
    name : str
        Folder, or name of the object.
    kind : {"result", "design"}
    sha256 : str
        Hash of its file, or of the information itself.
    robot, robot_sha256 : str
        Name and hash of the description.
    geometry : str
        Hash of what defines the parameters, see `excite.information.earlier_precision.geometry`.
    payload : str or None
        What the robot carried.
    logs : tuple of str
        Hashes of the logs of a result.
    parameters : tuple of str, length s
        Names of u.
    A : ndarray, shape (b, s)
    factors : tuple of ndarray, shape (k, b)
        Of a result one, R with the information ``R'R``; of a design F_j for each equation.
    equations : tuple of (str, str)
        Name and unit of each equation.
    density : tuple of float, optional
        Density of the noise of each equation, measured by a result or stated by a design [unit times root of s].
    seconds : float
        Duration of the motion, or of the logs [s].
    degrees_of_freedom : int
        Of the noise that a result has estimated, or that one run of a design lets estimate.
    values : ndarray, shape (b,), optional
        Estimate of ``A u`` by a result; NaN where it is not identifiable.
    """

    name: str
    kind: str
    sha256: str
    robot: str
    robot_sha256: str
    geometry: str
    payload: str | None
    logs: tuple[str, ...]
    parameters: tuple[str, ...]
    A: NDArray[np.float64]
    factors: tuple[NDArray[np.float64], ...]
    equations: tuple[tuple[str, str], ...]
    density: tuple[float, ...] | None
    seconds: float
    degrees_of_freedom: int
    values: NDArray[np.float64] | None = None

    def __str__(self) -> str:
        """Its folder."""
        return self.name

    def __repr__(self) -> str:
        """One line."""
        return f"<EarlierInformation of the {self.kind} {self.name}: {len(self.A)} parameters of {self.robot}>"

    def rows(self, densities: Mapping[str, float]) -> list[NDArray[np.float64]]:
        """Rows R, in parts, with the information ``R'R`` about ``A u``.

        Parameters
        ----------
        densities : mapping of str to float
            Density of the noise of the equations of the model that is designed for, by their names.

        Raises
        ------
        InputError
            The noise of an equation of a design is not known.
        """
        if self.kind == RESULT:
            return list(self.factors)
        names = [name for name, _ in self.equations]
        known = dict(zip(names, self.density or (), strict=False))
        given = densities if all(name in densities for name in names) else known
        if not given:
            raise InputError(
                f"`after`: {self.name} has the equations {', '.join(names)}, whose noise is not known here; "
                "design it with `noise`, or with the model of this task"
            )
        return [F / given[name] for F, name in zip(self.factors, names, strict=True)]
