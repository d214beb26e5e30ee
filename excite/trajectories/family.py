"""Interface of trajectory families, trajectories of a family, and their motion at given instants."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from constraints.certificate import Extrema, LimitUse
from constraints.linear import Constraint, LinearConstraint
from excite.registry import BUILT_IN, OwnPart, built_in
from regressors.errors import InputError, check_names
from regressors.models.partial import PartialMotion
from regressors.quantities import check
from regressors.samples import Array, Index, Samples


def check_size(duration: float, fewest: int, **richness: int) -> None:
    """Raise `InputError` for an invalid duration [s], or a number of terms that is too small or too large."""
    for option, count in richness.items():
        if count < fewest:
            few = f"{count} are too few for a motion at rest at both ends; expected {fewest} or more"
            raise InputError(f"{option}: {few if fewest > 1 else f'expected 1 or more, given {count}'}")
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"period must be a positive number of seconds, given {duration}")
    for name, value in {"period": duration, **richness}.items():
        check(name, value)


class Family(ABC):
    """Motions of any number of joints, at rest at both ends, each given by an array x of parameters.

    Attributes
    ----------
    name : str
        Short name, as in ``trajectory="fourier"``.
    duration : float
        [s]
    size : int
        Number of coefficients per joint in which motions are linear.
    linear : bool
        Whether motions are linear in all of x; otherwise a part of x, the shape, determines the functions that the
        coefficients multiply.
    options : tuple of str
        Task options that the constructor takes after the period; attributes of the same names.
    richness_option : str
        The option that makes its motions richer.
    terms : str
        What its motions consist of, with its attributes in braces, such as ``{harmonics} harmonics``.
    samples_per_term : int
        Samples per unit of that option up to which a motion cannot be distinguished from a poorer one.
    """

    name: str
    duration: float
    size: int
    linear: bool
    options: ClassVar[tuple[str, ...]] = ("harmonics",)
    richness_option: ClassVar[str] = "harmonics"
    terms: ClassVar[str] = "{harmonics} harmonics"
    samples_per_term: ClassVar[int] = 2

    def __repr__(self) -> str:
        """One line."""
        return f"<{type(self).__name__}: {self.described} over {self.duration:g} s>"

    @property
    def richness(self) -> int:
        """Approximate number of harmonics of a motion, which determines its sampling."""
        return int(getattr(self, self.richness_option))

    @property
    def described(self) -> str:
        """Short description of its terms, such as ``5 harmonics``."""
        return self.terms.format(**vars(self))

    @property
    def harmonic_frequencies(self) -> Array | None:
        """Angular frequencies of its motions' harmonics, ascending [rad/s]; None where motions have other terms too."""
        return None

    def grid(self, count: int) -> Array:
        """Grid of ``count`` equal steps over the duration, without the last instant [s]."""
        return np.linspace(0.0, self.duration, count, endpoint=False)

    def breaks(self, x: Array) -> Array:
        """Instants at which motion x changes from one polynomial to the next [s]; none if it is one smooth function."""
        return np.zeros(0)

    @abstractmethod
    def motion(self, x: Array, time: Array, derivative: int) -> Array:
        """Motion x at given instants [s], 0 for position to 3 for jerk, shape (N, n)."""

    @abstractmethod
    def carried(self, x: Array, matrix: Array, offset: Array) -> tuple[Family, Array]:
        """The motion ``matrix q + offset`` as a member of a family: that family, and its x."""

    @abstractmethod
    def joints(self, time: Array, motion: PartialMotion) -> JointMotion:
        """Motion of all joints of a robot under a partial motion of this family."""

    @abstractmethod
    def on_grid(self, count: int) -> GridMotion:
        """Motion of the coordinates on a grid of ``count`` instants or more, on which limits are imposed."""

    @property
    @abstractmethod
    def constant(self) -> Array:
        """Coefficients of rest at position 1 for any shape, shape (size,)."""

    @abstractmethod
    def split(self, x: Array) -> tuple[Array, Array]:
        """Coefficients in which motions are linear, shape (n, size), and the shape parameters: views of x."""

    @abstractmethod
    def resting(self, pose: Array, rng: np.random.Generator | None = None) -> Array:
        """The x of rest in a pose, shape (n,), with the most regular shape, or with a random one."""

    def coordinate_step(self, x: Array, joint: int, coefficients: Array) -> Array:
        """The step from x that adds to one coordinate's coefficients and leaves the shape unchanged."""
        step = np.zeros_like(x)
        self.split(step)[0][joint] = coefficients
        return step

    def moved(self, x: Array, pose: Array) -> Array:
        """The motion with a pose added: ``y + pose`` at every instant."""
        moved = x.copy()
        linear, _ = self.split(moved)
        linear += np.outer(pose, self.constant)
        return moved

    def drawn(self, x: Array, pose: Array, part: float) -> Array:
        """The motion scaled towards a pose: ``pose + part (y - pose)`` at every instant."""
        drawn = x.copy()
        linear, _ = self.split(drawn)
        rest = np.outer(pose, self.constant)
        linear[:] = rest + part * (linear - rest)
        return drawn

    @abstractmethod
    def nearest(self, time: Array, q: Array) -> Array:
        """The x of the motion nearest to positions of shape (N, n) at given instants, by least squares."""

    @abstractmethod
    def grid_factor(self, count: int, derivative: int) -> float:
        """Lower bound of the largest ``|value|`` on the grid of ``count`` over that over continuous time.

        A function of the family whose values on the grid stay within ``factor * bound`` stays within ``bound``
        everywhere. Values are relative to the middle of the allowed range.
        """

    @abstractmethod
    def combined_extrema(self, x: Array, matrix: Array, offset: Array, derivative: int) -> Extrema:
        """Exact extrema over continuous time of ``matrix q + offset`` or of one of its derivatives."""

    @abstractmethod
    def to_dict(self, x: Array) -> dict[str, object]:
        """The motion in the family's physical coefficients, for JSON, in SI."""

    @abstractmethod
    def stored(self, series: Mapping[str, Any], joints: int) -> Trajectory:
        """The motion of ``joints`` joints from the entries of `to_dict`.

        Raises
        ------
        InputError
            Numbers of another shape, or not finite.
        """


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One motion of a family.

    Parameters
    ----------
    family : Family
    x : ndarray
        Parameters of the motion: for a linear family the coefficients of each joint, shape (n, size).
    """

    family: Family
    x: Array

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.family.duration

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]; exactly at rest at both ends, where rounding would give friction a sign."""
        samples = Samples(time, *(self.family.motion(self.x, time, d) for d in range(4)))
        ends = (time == 0.0) | (time == self.duration)
        samples.dq[ends] = samples.ddq[ends] = 0.0
        return samples

    def joints(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Those of a robot's joints that its coefficients are of: all, unless loops make some of them follow."""
        return names

    def sampled(self, rate: float) -> Samples:
        """Motion at a uniform rate [Hz] from 0 to the duration, both included."""
        return self.samples(np.linspace(0.0, self.duration, round(self.duration * rate) + 1))

    def extrema(self, constraint: Constraint) -> Extrema:
        """Exact extrema of a constraint's functions over continuous time."""
        if not isinstance(constraint, LinearConstraint):
            raise TypeError(f"no exact extrema for {type(constraint).__name__}")
        return self.family.combined_extrema(self.x, constraint.matrix, constraint.offset, constraint.derivative)

    @property
    def jerk(self) -> Array:
        """Largest |jerk| of every joint, shape (n,)."""
        n = self.family.motion(self.x, np.zeros(1), 0).shape[1]
        third = self.family.combined_extrema(self.x, np.eye(n), np.zeros(n), 3)
        return np.maximum(np.abs(third.low), np.abs(third.high))

    @property
    def proven(self) -> tuple[LimitUse, ...]:
        """Certificate of what the motion itself needs."""
        return ()

    def carried(self, matrix: Array, offset: Array) -> Trajectory:
        """The motion ``matrix q + offset``."""
        return Trajectory(*self.family.carried(self.x, matrix, offset))


@dataclass(frozen=True, eq=False)
class JointMotion:
    """The motion of all joints, ``q = N y + q0`` with a family's y, at fixed instants as a function of x."""

    values: Callable[[Array], list[Array]]  # position, velocity and acceleration at x, each of shape (n, T)
    # gradient with respect to x of a function, from x and from its derivatives with respect to `values`
    pullback: Callable[[Array, Sequence[Array]], Array]


#: Some derivatives of the k coordinates' motion at T instants of a grid, linearised about one x: slopes of weighted
#: sums, each at one instant, with respect to the flat x, from weights (rows, derivatives, k) and places (rows,).
MotionTangent = Callable[[Array, Index], Array]


@dataclass(frozen=True, eq=False)
class GridMotion:
    """The motion y of a family's k coordinates on a grid of N instants, as a function of x."""

    linear: bool  # in x, so that tangents are the same for every x
    factor: Callable[[int], float]  # see `Family.grid_factor`, of a derivative
    values: Callable[[Array, int], Array]  # ``y^(d)`` at x, shape (N, k)
    combined: Callable[[Array, Array, int], Array]  # ``A y^(d)`` at x for a matrix A of shape (m, k), shape (m, N)
    # some derivatives of the motion at some instants, linearised about x
    tangent: Callable[[Array, Sequence[int], Index], MotionTangent]


def stored_trajectory(series: Mapping[str, Any], joints: int, family: Family | None = None) -> Trajectory:
    """Motion from the entries of a design's file."""
    name = str(series.get("family", "fourier"))
    if family is None:
        if ":" in name:
            raise OwnPart("trajectory", name).missing()
        check_names("trajectory family", [name], BUILT_IN["trajectory"])
        kind = built_in("trajectory", name)
        family = kind(series["period"], *(series[option] for option in kind.options))
    return family.stored(series, joints)
