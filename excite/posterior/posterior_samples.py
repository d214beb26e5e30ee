"""Samples of the posterior: possible robots, as values of their standard parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from excite.registry import built_in
from regressors.errors import InputError
from regressors.quantities import check
from regressors.samples import Array

LEVEL = 0.99
_TAIL = 5  # samples beyond each end of a range, below which it is not stated


@dataclass(frozen=True)
class ParameterRange:
    """What the samples say of one parameter.

    Parameters
    ----------
    name, unit : str
    low, high : float
        Quantiles that enclose the level between them.
    mean, deviation : float
    """

    name: str
    unit: str
    low: float
    high: float
    mean: float
    deviation: float


@dataclass(frozen=True, eq=False, repr=False)
class PosteriorSamples:
    """Possible robots that data and description allow.

    Parameters
    ----------
    robot : str
        Name of the robot.
    result_sha256 : str or None
        Hash of the ``result.json``; None for a result that was not saved.
    seed : int
    prior : float
        Relative uncertainty of the description.
    names, units : tuple of str, length t
        Of the standard parameters of the moving bodies and drives.
    values : ndarray, shape (N, t)
        In SI.
    base_names, base_units : tuple of str, length b
    base_matrix : ndarray, shape (b, t)
        ``beta = base_matrix @ theta``.
    distance : float
        Of the nearest possible robot from the estimate, in deviations of the posterior.
    effective : float
        Independent samples that say as much of the least known mean.
    split_deviation : float
        Largest potential scale reduction R of the parameters; 1 for chains that agree.
    notes : tuple of str
    """

    robot: str
    result_sha256: str | None
    seed: int
    prior: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    base_names: tuple[str, ...]
    base_units: tuple[str, ...]
    base_matrix: Array
    distance: float
    effective: float
    split_deviation: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number N of samples."""
        return len(self.values)

    @property
    def base_values(self) -> Array:
        """Base parameters of every sample, shape (N, b)."""
        return np.asarray(self.values @ self.base_matrix.T)

    @property
    def mean(self) -> Array:
        """Mean of the standard parameters, itself a possible robot, shape (t,)."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def covariance(self) -> Array:
        """Covariance of the standard parameters, shape (t, t)."""
        return np.cov(self.values, rowvar=False)

    def standard(self, number: int) -> dict[str, float]:
        """Standard parameters of one sample by name.

        Parameters
        ----------
        number : int
            0 for the first.
        """
        return dict(zip(self.names, self.values[number].tolist(), strict=True))

    def ranges(self, level: float = LEVEL) -> tuple[ParameterRange, ...]:
        """Range, mean and deviation of each standard parameter, then of each base parameter that is not one of them.

        Parameters
        ----------
        level : float
            Share of the samples between low and high, such as 0.99; as many are below as above.

        Raises
        ------
        InputError
            A level that is not between 0 and 1, or too few samples for it.
        """
        check("level", level)
        needed = int(np.ceil(2 * _TAIL / (1 - level) - 1e-9))
        if len(self) < needed:
            raise InputError(f"level: a range of {100 * level:g} % needs at least {needed} samples, given {len(self)}")
        new = [k for k, name in enumerate(self.base_names) if name not in self.names]
        values = np.hstack([self.values, self.base_values[:, new]])
        names = (*self.names, *(self.base_names[k] for k in new))
        units = (*self.units, *(self.base_units[k] for k in new))
        low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2], axis=0)
        rows = zip(names, units, low, high, values.mean(axis=0), values.std(axis=0, ddof=1), strict=True)
        return tuple(ParameterRange(name, unit, *map(float, numbers)) for name, unit, *numbers in rows)

    def save(self, path: str | Path, *, replace: bool = False) -> Path:
        """Write the samples to a file that `excite.load_posterior` reads: ``.npz``, or ``.csv`` with every digit.

        Parameters
        ----------
        path : path
        replace : bool
            Replace a file that is already there.

        Raises
        ------
        InputError
            Another suffix, or a file that is there already or cannot be written.
        """
        written: Path = built_in("writer", "posterior")(self, path, replace=replace)
        return written

    def __repr__(self) -> str:
        """One line."""
        return (
            f"<PosteriorSamples of {self.robot}: {len(self)} possible robots of {len(self.names)} parameters, about "
            f"{self.effective:.0f} of them independent>"
        )
