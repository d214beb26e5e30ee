"""Families by name: made for a task, made richer, and read back from files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from excite.tasks.task import Task
from excite.trajectories.bspline import BSplineFamily
from excite.trajectories.cosine import CosineFamily
from excite.trajectories.family import Family, Trajectory
from excite.trajectories.fourier import FourierFamily
from excite.trajectories.fourier_quintic import FourierQuinticFamily
from excite.trajectories.linear import LinearFamily
from excite.trajectories.nonlinear import NonlinearFamily
from excite.trajectories.sines import SinesFamily
from excite.trajectories.waypoints import WaypointFamily
from regressors.errors import InputError, UnknownName


@dataclass(frozen=True)
class _Kind:
    """How a family is made of a task's options or of a file's entries, which carry the same names."""

    make: Callable[..., Any]
    options: tuple[str, ...]  # after the period
    richness: str  # the option that makes its motions richer
    parts: tuple[str, ...] = ()  # of a linear family's physical coefficients in files, side by side


_KINDS = {
    "fourier": _Kind(FourierFamily, ("harmonics",), "harmonics", ("offset", "cosine", "sine")),
    "fourier-quintic": _Kind(FourierQuinticFamily, ("harmonics",), "harmonics", ("cosine", "sine", "chebyshev")),
    "cosine": _Kind(CosineFamily, ("harmonics",), "harmonics", ("offset", "cosine", "sine")),
    "bspline": _Kind(BSplineFamily, ("intervals", "order"), "intervals", ("control",)),
    "waypoints": _Kind(WaypointFamily, ("intervals",), "intervals"),
    "sines": _Kind(SinesFamily, ("harmonics",), "harmonics"),
}


def family_of(task: Task) -> Family:
    """Family that a task asks for.

    Raises
    ------
    InputError
        Options that no motion of the family can have.
    """
    kind = _KINDS[task.trajectory]
    family: Family = kind.make(task.period, *(getattr(task, name) for name in kind.options))
    return family


def finer(task: Task, by: int = 1) -> tuple[Task, str, int]:
    """The task with a richer family.

    Parameters
    ----------
    task : Task
    by : int
        How much more of the option that makes its family richer.

    Returns
    -------
    task : Task
    option : str
        Its name.
    value : int
    """
    option = _KINDS[task.trajectory].richness
    value = getattr(task, option) + by
    return replace(task, **{option: value}), option, value


def stored_trajectory(series: Mapping[str, Any], joints: int) -> Trajectory:
    """Motion from the entries of a design's file.

    Parameters
    ----------
    series : mapping
        What `Family.to_dict` made.
    joints : int
        Number of joints that it moves.

    Raises
    ------
    UnknownName
        No such family.
    InputError
        Coefficients of another shape, or not finite.
    """
    name = series.get("family", "fourier")
    if name not in _KINDS:
        raise UnknownName("trajectory family", str(name), _KINDS)
    kind = _KINDS[name]
    family = kind.make(series["period"], *(series[option] for option in kind.options))
    if isinstance(family, NonlinearFamily):
        return _carried(family, series, joints)
    return _linear(family, series, kind.parts, joints)


def _carried(family: NonlinearFamily, series: Mapping[str, Any], joints: int) -> Trajectory:
    x = family.restored(series)
    matrix, rest = np.array(series["matrix"], dtype=float), np.array(series["rest"], dtype=float)
    expected = (joints, family.coordinates(x))
    if (
        matrix.shape != expected
        or rest.shape != expected[:1]
        or not all(np.all(np.isfinite(a)) for a in (x, matrix, rest))
    ):
        raise InputError(
            f"trajectory: expected finite numbers for {expected[1]} coordinates of {expected[0]} joints, "
            f"given a matrix of shape {matrix.shape}"
        )
    return Trajectory(family, x).carried(matrix, rest)


def _linear(family: LinearFamily, series: Mapping[str, Any], parts: tuple[str, ...], joints: int) -> Trajectory:
    coefficients = np.column_stack([np.array(series[part], dtype=float) for part in parts])
    expected = (joints, family.coefficients(family.constant[None]).shape[1])
    if coefficients.shape != expected or not np.all(np.isfinite(coefficients)):
        raise InputError(
            f"trajectory: expected {expected[1]} finite coefficients for each of {expected[0]} joints, "
            f"given an array of shape {coefficients.shape}"
        )
    return Trajectory(family, family.from_coefficients(coefficients))
