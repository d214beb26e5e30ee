"""Choice of the family of motions and their duration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from excite.registry import OwnPart, part
from excite.tasks.option import AUTO, essential, option, strict
from regressors.errors import InputError

if TYPE_CHECKING:
    from excite.trajectories.family import Family

FEWEST = 5  # harmonics with which a search begins that chooses their number


@dataclass(frozen=True)
class TrajectoryChoice:
    """A family by name with its options, or a family object.

    Parameters
    ----------
    trajectory : str or Family
        A registered name, or a family object, whose own period and options then count.
    period : float
        Duration of the motion [s].
    harmonics : int or "auto"
        Number of harmonics of the Fourier and cosine series; number of free sines. ``"auto"`` raises it until that
        does not pay, see `excite.design.search_rounds`.
    bandwidth : float, optional
        Highest frequency that the robot's controller follows; ``"auto"`` takes no harmonic beyond it [Hz].
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

    trajectory: str | Family = essential("fourier", "name", "Family of motions; see below.", part="trajectory")
    period: float = essential(10.0, "number", "Duration of the motion.")
    harmonics: int | str = essential(
        FEWEST,
        "count",
        "Harmonics of the series; number of sines; auto raises it from 5 until that does not pay; for servos 15.",
        metavar="N|auto",
    )
    bandwidth: float | None = option(
        None, "number", "Highest frequency that the controller follows, which bounds automatic harmonics.", late=True
    )
    intervals: int = option(15, "integer", "Intervals of B-splines or between waypoints.")
    order: int = option(6, "integer", "Order of the B-splines: 4 (cubic), 5 or 6 (quintic).")

    def __post_init__(self) -> None:
        strict(self)
        if not isinstance(self.trajectory, str | OwnPart | type):
            for name in ("period", *self.trajectory.options):
                own = self.trajectory.duration if name == "period" else getattr(self.trajectory, name)
                object.__setattr__(self, name, own)
        if self.grows:
            self._check_growth()
        elif self.bandwidth is not None:
            raise InputError("`bandwidth` bounds the number of harmonics of `harmonics='auto'`; give both, or neither")

    def _check_growth(self) -> None:
        """Refuse families whose motions are not among those with more harmonics."""
        kind = self.kind
        if isinstance(kind, type) and kind.richness_option == "harmonics" and kind.linear:  # type: ignore[attr-defined]
            return
        own = self.kind.richness_option
        remedy = f"give `{own}`" if own != "harmonics" else "give a number"
        raise InputError(
            f"harmonics: {AUTO} is for series to which harmonics are added, such as fourier, not for {self.name}; "
            f"{remedy}"
        )

    @property
    def grows(self) -> bool:
        """Whether a search chooses the number of harmonics."""
        return self.harmonics == AUTO

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
        return name, FEWEST if self.grows else getattr(self, name)

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
            Options that are invalid for the family, or a number of harmonics that is to be chosen.
        """
        if self.grows:
            raise InputError(
                f"harmonics: {AUTO} is for `design_trajectory` and `excite design` only; expected a whole number"
            )
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
