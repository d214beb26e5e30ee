"""Limits that nothing is known of, so that a design cannot say whether its motion keeps them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from constraints.linear import QUANTITIES, LinearConstraint, spanned
from regressors.models.partial import PartialMotion

_SURFACES = ("floor", "wall", "ceiling")
_COLLISIONS = (*_SURFACES, "self-collision")  # obstacles are the user's to state
_ORDER = (*QUANTITIES, "torque", "power", "tool", "distance")


@dataclass(frozen=True)
class Unchecked:
    """A kind of limit that is not checked.

    Parameters
    ----------
    limit : str
        ``position``, ``velocity``, ``acceleration``, ``jerk``, ``torque``, ``self-collision``, ``floor`` (or ``wall``,
        ``ceiling``) or ``obstacles``.
    reason : str
        Why, with the joints where it is not all of them.
    """

    limit: str
    reason: str

    def __str__(self) -> str:
        return f"{self.limit} ({self.reason})"


def unchecked_limits(motion: PartialMotion, limits: Sequence[LinearConstraint]) -> tuple[Unchecked, ...]:
    """Limits of joints and drives that neither the robot's description nor the task states, but for torques."""
    unchecked = []
    for derivative, quantity in enumerate(QUANTITIES):
        bounded = spanned(tuple(limits), len(motion.labels), (derivative,))
        free = [name for name, known in zip(motion.labels, bounded, strict=True) if not known]
        if free:
            of = "" if len(free) == len(motion.labels) else f" for {', '.join(free)}"
            unchecked.append(Unchecked(quantity, f"no limit is stated{of}"))
    return tuple(unchecked)


def checked_text(quantities: Iterable[str]) -> str:
    """Kinds of limits that were checked, each with the number of limits, such as ``position (7), distance (54)``."""
    counts = Counter(quantities)
    order = [*(kind for kind in _ORDER if kind in counts), *sorted(set(counts) - set(_ORDER))]
    return ", ".join(f"{kind} ({counts[kind]})" for kind in order)


def collisions_unchecked(limits: Iterable[str]) -> tuple[str, ...]:
    """Those kinds of limits among them whose breach may break the robot: of the robot with itself and its mounting."""
    return tuple(limit for limit in limits if limit in _COLLISIONS)


def gravest_first(unchecked: Iterable[Unchecked]) -> tuple[Unchecked, ...]:
    """What the robot is mounted on first, then the robot itself, then the others in their order."""
    return tuple(sorted(unchecked, key=lambda each: (each.limit not in _SURFACES, each.limit not in _COLLISIONS)))


def kept_headline(limits: Iterable[str], plain: str) -> str:
    """First words on a motion that exceeds no limit that was checked."""
    missing = collisions_unchecked(limits)
    return f"limits kept; collisions NOT checked ({', '.join(missing)})" if missing else plain


def kept_text(unchecked: Sequence[Unchecked], quantities: Iterable[str] = ()) -> str:
    """Verdict on a motion that exceeds no limit, with what was not checked and what was."""
    checked = f"; checked: {text}" if (text := checked_text(quantities)) else ""
    if not unchecked:
        return f"every limit is kept{checked}"
    kept = kept_headline((each.limit for each in unchecked), "every limit that was checked is kept")
    return f"{kept}; not checked: {', '.join(map(str, unchecked))}{checked}"
