"""Certificates of limits: the extreme value over continuous time, the bound, and the margin between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np

from constraints.linear import OTHER, Constraint
from constraints.nonlinear import NonlinearConstraint
from regressors.samples import Array

TOLERANCE = 1e-9
EXACT, ENCLOSED = "exact", "enclosed"


@dataclass(frozen=True)
class LimitUse:
    """One bound and the extreme value that comes closest to it."""

    beside: ClassVar[Mapping[str, Callable[[LimitUse], bool]]] = {"holds": lambda use: use.holds}

    label: str
    unit: str
    extreme: float  # value over continuous time that is closest to a bound, or furthest beyond it
    time: float  # when it occurs [s]
    bound: float  # the one that it is closest to
    margin: float  # distance to the bound, negative beyond it; in the same unit
    # fraction used of the distance from the middle of the allowed range to its edge; of the bound, if only one side is
    # bounded, or of the largest value where that bound is zero. Above 1 where the limit is violated; 0, never below,
    # where a value is further away than that
    use: float
    method: str = EXACT  # whether the extreme is exact, or an outer bound that is proven for every instant, `ENCLOSED`
    quantity: str = OTHER  # what is limited, in a word

    @property
    def holds(self) -> bool:
        """True unless the bound is exceeded by more than 1e-9 of its value."""
        return self.margin >= -TOLERANCE * abs(self.bound)

    def to_dict(self) -> dict[str, object]:
        """Fields and the verdict, for JSON."""
        return {**asdict(self), "holds": self.holds}


def limit_uses(
    constraint: Constraint, extrema: Extrema, method: str = EXACT, shown: Callable[[Array], Array] = np.asarray
) -> list[LimitUse]:
    """Certificate of each bound of a constraint from the extrema of its functions, both as they are shown."""
    uses = []
    values = (shown(x).tolist() for x in (constraint.lower, constraint.upper, extrema.low, extrema.high))
    for k, (lower, upper, low, high) in enumerate(zip(*values, strict=True)):
        below, above = low - lower, upper - high
        at_upper = above <= below
        extreme, bound, margin = (high, upper, above) if at_upper else (low, lower, below)
        time = float((extrema.high_time if at_upper else extrema.low_time)[k])
        largest = max(abs(low), abs(high))
        half = 0.5 * (upper - lower) if np.isfinite(upper - lower) else abs(bound) or largest
        use = max(0.0, 1.0 - margin / half) if half > 0 else 1.0
        what = constraint.labels[k], constraint.units[k]
        uses.append(LimitUse(*what, extreme, time, bound, margin, use, method, constraint.quantity))
    return uses


def worst_of_each(uses: Iterable[LimitUse]) -> list[LimitUse]:
    """Keep, of the functions that share a label (parts of one limit), the one with the least margin."""
    worst: dict[str, LimitUse] = {}
    for use in uses:
        worst[use.label] = min(worst.get(use.label, use), use, key=lambda each: each.margin)
    return list(worst.values())


@dataclass(frozen=True, eq=False)
class Extrema:
    """Smallest and largest value of k functions of time, and when they occur."""

    low: Array  # (k,)
    high: Array
    low_time: Array  # (k,) [s]
    high_time: Array

    @classmethod
    def among(cls, values: Iterable[Array], times: Iterable[Array]) -> Extrema:
        """The first least and the first largest of each function's values, and their instants."""
        pairs = [(value, time, value.argmin(), value.argmax()) for value, time in zip(values, times, strict=True)]
        rows = [(value[low], value[high], time[low], time[high]) for value, time, low, high in pairs]
        return cls(*np.array(rows, dtype=float).reshape(-1, 4).T)

    def uses(self, constraint: NonlinearConstraint) -> list[LimitUse]:
        """Certificate of each label of a constraint that these enclose, in the quantity that is reported."""
        return worst_of_each(limit_uses(constraint, self, ENCLOSED, constraint.shown))


def evaluate(constant: Array, cosine: Array, sine: Array, angle: Array) -> Array:
    """``constant + sum_k cosine_k cos(k angle) + sine_k sin(k angle)``, angles per function, shape (k, N)."""
    order = np.arange(1, cosine.shape[1] + 1)
    phase = angle[:, :, None] * order
    return np.asarray(
        constant[:, None]
        + np.einsum("kno,ko->kn", np.cos(phase), cosine)
        + np.einsum("kno,ko->kn", np.sin(phase), sine)
    )


def _stationary_angles(cosine: Array, sine: Array) -> Array:
    """Angles of all roots of the derivative, as a polynomial in exp(i angle); shape (k, 2K)."""
    count, K = cosine.shape
    order = np.arange(1, K + 1)
    half = 0.5 * order * (sine + 1j * cosine)  # of exp(i k angle); exp(-i k angle) has the conjugate
    polynomial = np.zeros((count, 2 * K + 1), dtype=complex)
    polynomial[:, K + 1 :] = half
    polynomial[:, :K] = np.conj(half[:, ::-1])
    angles = np.zeros((count, 2 * K))
    for k, row in enumerate(polynomial):
        roots = np.roots(np.where(np.abs(row) > 1e-15 * np.abs(row).max(), row, 0.0)[::-1])
        angles[k, : roots.size] = np.angle(roots)
    return angles


def trigonometric_extrema(constant: Array, cosine: Array, sine: Array, omega: float) -> Extrema:
    """Extrema of ``constant + sum_k cosine_k cos(k omega t) + sine_k sin(k omega t)`` over all t.

    The derivative is a polynomial of degree 2K in ``exp(i omega t)``; its roots on the unit circle are the stationary
    instants. Each root's angle is polished by Newton's method, and a grid of 8 K instants is added, which keeps the
    result accurate where roots are nearly double.
    """  # constant (k,); cosine, sine (k, K)
    K = cosine.shape[1]
    order = np.arange(1, K + 1)
    angle = _stationary_angles(cosine, sine)
    for _ in range(3):
        slope = evaluate(np.zeros_like(constant), order * sine, -order * cosine, angle)
        bend = evaluate(np.zeros_like(constant), -(order**2) * cosine, -(order**2) * sine, angle)
        step = np.divide(slope, bend, out=np.zeros_like(slope), where=np.abs(bend) > 1e-12 * np.abs(slope))
        angle = angle - np.clip(step, -0.1, 0.1)
    grid = np.broadcast_to(np.linspace(0.0, 2 * np.pi, 8 * K, endpoint=False), (constant.size, 8 * K))
    angle = np.mod(np.concatenate([angle, grid], axis=1), 2 * np.pi)
    return Extrema.among(evaluate(constant, cosine, sine, angle), angle / omega)
