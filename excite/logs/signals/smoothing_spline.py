"""Quintic splines fitted by least squares, with as few knots as the noise allows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.interpolate

from excite.logs.signals.method import FilteredMotion, Method, check_positive, cut_motion, spacing
from regressors.samples import Array, Index

_DEGREE = 5
_FINER = np.sqrt(2.0)
_FEWEST_PER_KNOT = 3.0
_ALIKE = 1.02
_ABOVE_NOISE = 1.05


@dataclass(frozen=True)
class SmoothingSpline(Method):
    """Least-squares quintic spline with uniform knots; their distance is chosen per joint.

    With N samples, p coefficients and the sum of squares R of the residuals: where the noise s is known, the widest
    knots with ``R / (N - p) <= (1.05 s)^2``; where not, the widest whose generalised cross-validation
    ``N R / (N - p)^2`` [Craven, Wahba 1979] is within 2 % of the least. The former suits rounded positions better.
    """

    noise: float | None = None  # standard deviation of the positions [rad or m]
    # distance of the knots [s], of all joints or of each; chosen if not given
    knots: float | tuple[float, ...] | None = None
    cutoff: float | None = None  # instead: highest frequency that the knots resolve, two of them in its period [Hz]

    name: ClassVar[str] = "spline"

    def __post_init__(self) -> None:
        for knots in self.knots if isinstance(self.knots, tuple) else (self.knots,):
            check_positive(self.name, noise=self.noise, knots=knots, cutoff=self.cutoff)
        if self.knots is None and self.cutoff is not None:
            object.__setattr__(self, "knots", 0.5 / self.cutoff)

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Values and derivatives of the splines; see `Method.motion`."""
        h = spacing(time, self.name, 16)
        splines = self._splines(time, q)
        state = tuple(np.empty(q.shape) for _ in range(3))
        for fitted, joints in splines:
            for derivative, values in enumerate(state):
                values[:, joints] = fitted.spline(time, derivative)
        distance = np.array([fitted.distance for fitted, _ in splines])
        residual = np.concatenate([fitted.deviation for fitted, _ in splines])
        edge = min(int(np.ceil(distance.max() / h)), time.size // 10)
        assumed = (
            f"quintic smoothing splines of the positions, assuming white noise; knots every {_each(distance)} s "
            f"({self._reason}), residuals of {_each(residual)} rad or m; {edge * h:.3g} s cut at each end"
        )
        return cut_motion(time, (state[0], state[1], state[2]), edge, assumed)

    @property
    def _reason(self) -> str:
        if self.knots is not None:
            return "given"
        return "by cross-validation" if self.noise is None else f"for noise of {self.noise:g}"

    def settled(self, time: Array, q: Array) -> SmoothingSpline:
        """The method with the distance of the knots that it chooses for each joint."""
        if self.knots is not None:
            return self
        distance = np.empty(q.shape[1])
        for fitted, joints in self._splines(time, q):
            distance[joints] = fitted.distance
        return replace(self, knots=tuple(distance.tolist()))

    def _splines(self, time: Array, q: Array) -> list[tuple[SplineFit, Index]]:
        """Splines of the joints that have the same knots, and which joints these are."""
        if self.knots is not None:
            pieces = np.maximum(1, np.round(float(time[-1] - time[0]) / np.broadcast_to(self.knots, q.shape[1])))
            groups = [(int(count), np.flatnonzero(pieces == count)) for count in np.unique(pieces)]
            return [(fit(time, q[:, joints], count), joints) for count, joints in groups]
        fits = list(self._fits(time, q))
        chosen = self._chosen(fits, q)
        return [(fits[i].of(joints), joints) for i in np.unique(chosen) for joints in [np.flatnonzero(chosen == i)]]

    def _fits(self, time: Array, q: Array) -> Iterator[SplineFit]:
        most, pieces = max(1, int(time.size / _FEWEST_PER_KNOT) - _DEGREE), 1.0
        while pieces < most:
            yield fit(time, q, int(pieces))
            pieces = max(pieces * _FINER, pieces + 1)
        yield fit(time, q, most)

    def _chosen(self, fits: list[SplineFit], q: Array) -> Index:
        """Which fit each joint takes; the fits have ever closer knots."""
        if self.noise is None:
            score = np.array([f.deviation**2 / f.freedom for f in fits])
            least = score.min(axis=0) * _ALIKE + (np.finfo(float).eps * np.abs(q).max(axis=0)) ** 2
            return np.asarray(np.argmax(score <= least, axis=0))
        enough = np.array([f.deviation <= _ABOVE_NOISE * self.noise for f in fits])
        return np.asarray(np.where(enough.any(axis=0), np.argmax(enough, axis=0), len(fits) - 1))


@dataclass(frozen=True, eq=False)
class SplineFit:
    """Splines of all joints with one distance of knots."""

    spline: scipy.interpolate.BSpline  # of n columns
    distance: float  # [s]
    freedom: int  # ``N - p``
    deviation: Array  # (n,) ``sqrt(R / (N - p))``

    def of(self, joints: Index) -> SplineFit:
        """The splines of some joints."""
        spline = scipy.interpolate.BSpline(self.spline.t, self.spline.c[:, joints], self.spline.k)
        return SplineFit(spline, self.distance, self.freedom, self.deviation[joints])


def fit(time: Array, q: Array, pieces: int) -> SplineFit:
    """Least-squares quintic splines of a number of uniform pieces."""  # time (N,); q (N, n)
    inner = np.linspace(time[0], time[-1], pieces + 1)
    knots = np.concatenate([np.repeat(inner[0], _DEGREE), inner, np.repeat(inner[-1], _DEGREE)])
    spline = scipy.interpolate.make_lsq_spline(time, q, knots, _DEGREE, method="norm-eq")  # well conditioned, and fast
    freedom = time.size - (pieces + _DEGREE)
    return SplineFit(
        spline,
        float(inner[1] - inner[0]),
        freedom,
        np.sqrt(np.sum((q - spline(time)) ** 2, axis=0) / freedom),
    )


def _each(values: Array) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
