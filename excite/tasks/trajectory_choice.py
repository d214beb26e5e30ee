"""Choice of the family of motions and their duration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from excite.registry import OwnPart, check_name, part
from excite.tasks.option import option
from excite.tasks.values import strict

if TYPE_CHECKING:
    from excite.trajectories.family import Family


@dataclass(frozen=True)
class TrajectoryChoice:
    """A family by name with its options, or a family object.

    Parameters
    ----------
    trajectory : str or Family
        A registered name, or a family object, whose own period and options then count.
    period : float
        Duration of the motion [s].
    harmonics : int
        Number of harmonics of the Fourier and cosine series; number of free sines.
    intervals, order : int
        Number of intervals, equal ones of the B-splines or free ones between waypoints; order of the B-splines, 4
        (cubic) to 6 (quintic).

    Raises
    ------
    UnknownName
        No such family.
    InputError
        An invalid period.
    """

    trajectory: str | Family = option("fourier", "name", "Family of motions; see below.", part="trajectory")
    period: float = option(10.0, "number", "Duration of the motion [s].", metavar="S")
    harmonics: int = option(5, "integer", "Harmonics of the series; number of sines.", metavar="N")
    intervals: int = option(15, "integer", "Intervals of B-splines or between waypoints.", metavar="N")
    order: int = option(6, "integer", "Order of the B-splines: 4 (cubic), 5 or 6 (quintic).", metavar="N")

    def __post_init__(self) -> None:
        strict(self)
        if isinstance(self.trajectory, str):
            check_name("trajectory", self.trajectory)
        elif not isinstance(self.trajectory, OwnPart | type):
            for name in ("period", *self.trajectory.options):
                own = self.trajectory.duration if name == "period" else getattr(self.trajectory, name)
                object.__setattr__(self, name, own)

    @property
    def kind(self) -> Any:
        """The family, or the callable that builds it from the options."""
        return part("trajectory", self.trajectory)

    @property
    def name(self) -> str:
        """Name of the family."""
        return str(self.kind.name)

    @property
    def richness(self) -> tuple[str, int]:
        """The option that makes motions of the family richer, and its value."""
        name = str(self.kind.richness_option)
        return name, getattr(self, name)

    def finer(self, by: int = 1) -> TrajectoryChoice:
        """The choice with a richer family: its richness option increased by ``by``.

        Parameters
        ----------
        by : int
        """
        option, value = self.richness
        finer: dict[str, Any] = {option: value + by}
        return replace(self, **finer)

    def family(self) -> Family:
        """The family.

        Raises
        ------
        InputError
            Options that are invalid for the family.
        """
        kind = self.kind
        if not isinstance(kind, type):
            return kind  # type: ignore[no-any-return]
        family: Family = kind(self.period, *(getattr(self, name) for name in kind.options))  # type: ignore[attr-defined]
        return family

    @property
    def fewest_samples(self) -> int:
        """Number of samples that a motion must exceed to be distinguishable from one with fewer terms."""
        if isinstance(self.trajectory, OwnPart):
            return 1
        return int(self.kind.samples_per_term) * self.richness[1]
