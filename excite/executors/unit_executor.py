"""Units of work that do not know of each other, and what runs them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

Work: TypeAlias = Callable[[Any, Any], Any]


@dataclass(frozen=True)
class LostUnit:
    """A unit whose worker ended each time that it ran."""

    reason: str  # how, in words


class UnitExecutor(Protocol):
    """Runs units of work.

    Attributes
    ----------
    shares_disk : bool
        Whether the units see the folders of this process.
    """

    shares_disk: bool

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """Call ``work(common, unit)`` for every unit, until the generator is closed.

        Parameters
        ----------
        work : callable
            A function of a module, so that another process finds it by its name.
        common : object
            What is the same for all units; it can be pickled.
        units : sequence
            Each can be pickled.

        Yields
        ------
        index : int
            Of the unit.
        result : object
            What the call returned, or a `LostUnit`; in the order in which the units end.

        Raises
        ------
        LostWorkersError
            No worker is left to run the other units.
        """
        ...


class InThisProcess:
    """Runs units one after the other in this process."""

    shares_disk = True

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """See `UnitExecutor.run`."""
        for index, unit in enumerate(units):
            yield index, work(common, unit)
