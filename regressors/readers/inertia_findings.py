"""Implausible masses and inertias of a description, and placeholders."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regressors.robot.finding import Finding
from regressors.robot.inertia import Array
from regressors.robot.plausibility import principal_moments

_HEAVY = 1e5  # kg
_SMALLEST_REACH = 0.3  # m; of robots whose links carry no lengths
_SLACK = 1e-3  # part of the largest moment of inertia, for values that were rounded
_FEWEST_EQUAL = 3
_NEGLIGIBLE = 1e-3  # part of all the mass; so light a body may well be a point
_ADVICE = "parameters known beforehand, torque limits and simulations rest on it; take it from a CAD model"


@dataclass(frozen=True, eq=False)
class Body:
    """A body with its inertial parameters about its own frame."""

    name: str  # of its link
    carrier: str  # link of the chain that it moves with
    theta: Array  # (10,)

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.theta[0])

    @cached_property
    def centre(self) -> Array:
        """Centre of mass in the link's frame [m], shape (3,)."""
        return np.asarray(self.theta[1:4] / self.mass)

    @cached_property
    def moments(self) -> Array:
        """Principal moments of inertia about the centre of mass, in ascending order [kg m^2], shape (3,)."""
        moments = principal_moments(self.theta)
        noise = 1e-12 * float(np.max(np.abs(self.theta[4:])))
        return np.where(np.abs(moments) < noise, 0.0, moments)


def inertia_findings(bodies: Sequence[Body], reach: float) -> Iterator[Finding]:
    """Findings on bodies: masses and inertias that no body has, that look copied, or that are far too large."""
    bodies = [body for body in bodies if np.all(np.isfinite(body.theta)) and np.any(body.theta)]
    least = _NEGLIGIBLE * sum(abs(body.mass) for body in bodies)
    size = max(reach, _SMALLEST_REACH)
    faults: Mapping[str, Callable[[Body], bool]] = {
        "its mass is not positive": lambda body: body.mass <= 0.0,
        f"its mass is above {_HEAVY:g} kg, so it may be in grams": lambda body: body.mass > _HEAVY,
        "its inertia is zero, as of a point": lambda body: body.mass > least and not np.any(body.moments),
        "its inertia is not positive definite about the centre of mass": _not_positive,
        "its inertia violates the triangle inequality: no body has it": _no_triangle,
        "its inertia is too large for its mass: it would be larger than the arm": lambda body: _too_large(body, size),
        "its centre of mass is farther away than the arm reaches": lambda body: _too_far(body, size),
    }
    for what, has in faults.items():
        if names := [body.name for body in bodies if has(body)]:
            yield Finding("suspicious", _listed(names), what, _ADVICE)
    yield from _placeholders(bodies)


def _not_positive(body: Body) -> bool:
    return bool(np.any(body.moments) and body.moments[0] <= 0.0)


def _no_triangle(body: Body) -> bool:
    first, second, third = body.moments
    return bool(first > 0.0 and first + second < third * (1.0 - _SLACK))


def _too_large(body: Body, size: float) -> bool:
    return bool(body.mass > 0.0 and body.moments[-1] > body.mass * size**2)


def _too_far(body: Body, size: float) -> bool:
    return bool(body.mass > 0.0 and np.linalg.norm(body.centre) > size)


def _placeholders(bodies: Sequence[Body]) -> Iterator[Finding]:
    """Links of the chain of the same mass and inertia; fingers and other parts on one link may be alike."""
    groups: dict[tuple[float, ...], list[str]] = defaultdict(list)
    for body in bodies:
        if body.mass > 0.0 and body.name == body.carrier:
            groups[tuple(float(f"{value:.6g}") for value in (body.mass, *body.moments))].append(body.name)
    for (mass, *_), names in groups.items():
        if len(names) >= _FEWEST_EQUAL:
            what = f"the same {mass:g} kg and the same inertia, so they may be placeholders"
            yield Finding("suspicious", _listed(names), what, _ADVICE)


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
    return f"link{'s' if len(names) > 1 else ''} {shown}"
