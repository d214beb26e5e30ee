"""Search for the best motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from excite.registry import STARTS, check_part
from excite.tasks.option import essential, option
from excite.tasks.values import strict
from regressors.errors import UnknownName

Executor = Callable[..., None]
RANDOM_STARTS = 4  # of a search that adapts their number


@dataclass(frozen=True)
class Search:
    """Starts, solver and executor of the search.

    Parameters
    ----------
    starts : int, optional
        Number of random starts; the search adapts it, and combines their motions, if not given.
    rounds : int, optional
        Number of rounds after the first, which combine the best motions so far, or begin anew where that does not pay
        any more; as many as pay if not given, none beside ``starts``.
    budget : float, optional
        Processor time after which no further round begins [s].
    seed : int
        The same seed on the same machine gives the same motion.
    start : tuple of {"random", "cosine", "quintic", "sines"}
        Initial motion of the search, one for all moving coordinates or one each.
    begin : str or Design, optional
        A design, of any family, or its folder, whose motion is the initial guess, projected onto this family.
    solver : str or Solver
        A registered name, or a solver object.
    executor : str or callable
        A registered name, or a function of (formulation, rounds of starts, folder, progress), see
        `excite.design.multistart.serial`.
    workers : int, optional
        Processes; one per core if not given.

    Raises
    ------
    UnknownName
        No such solver, executor or start.
    InputError
        Invalid numbers.
    """

    starts: int | None = essential(
        None,
        "integer",
        "Random starts; nothing else, and the best one is taken.",
        unset="as many as pay, and combinations of them",
        metavar="N",
    )
    rounds: int | None = option(
        None,
        "integer",
        "Rounds that combine the best motions after the random starts.",
        unset="as many as pay; 0 with starts",
        metavar="N",
        late=True,
    )
    budget: float | None = option(
        None, "number", "Processor time after which no further round begins.", metavar="S", late=True
    )
    seed: int = essential(
        0, "integer", "Seed of the starts; the same seed on the same machine gives the same motion.", metavar="N"
    )
    start: tuple[str, ...] = option(
        ("random",),
        "names",
        f"Initial guess: {', '.join(STARTS)}; one, or one per moving joint or drive.",
        metavar="KIND,...",
    )
    begin: Any = option(None, "text", "Start the search from the motion of this design, of any family.", metavar="DIR")
    solver: Any = option("sqp", "name", "sqp is fast; ipopt, slsqp are cross-checks.", part="solver")
    executor: str | Executor = option("process", "name", "Where the starts run.", part="executor")
    workers: int | None = option(None, "integer", "Number of processes.", metavar="N", unset="one per core")

    def __post_init__(self) -> None:
        strict(self)
        check_part("solver", self.solver)
        check_part("executor", self.executor)
        for name in self.start:
            if not isinstance(name, str) or name not in STARTS:
                raise UnknownName("start", str(name), STARTS)

    @property
    def first(self) -> int:
        """Number of random starts in the first round."""
        return RANDOM_STARTS if self.starts is None else self.starts

    @property
    def extent(self) -> str:
        """Starts, rounds and budget as text: searches of another extent may come to another motion."""
        given = {"starts": self.starts, "rounds": self.rounds, "budget": self.budget}
        return " ".join(f"{name}={value}" for name, value in given.items() if value is not None) or "adaptive"

    @property
    def adaptive(self) -> bool:
        """Whether rounds follow the random starts, and the best motion of all is refined."""
        return self.starts is None or self.rounds is not None or self.budget is not None
