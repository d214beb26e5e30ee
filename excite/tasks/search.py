"""Search for the best motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from excite.registry import STARTS, check_name
from excite.tasks.option import option
from excite.tasks.values import strict
from regressors.errors import UnknownName

if TYPE_CHECKING:
    from excite.design.solvers.solver import Solver


Executor = Callable[..., None]


@dataclass(frozen=True)
class Search:
    """Starts, solver and executor of the search.

    Parameters
    ----------
    starts : int
        Number of random starts.
    seed : int
        The same seed on the same machine gives the same motion.
    start : tuple of {"random", "cosine", "quintic", "sines"}
        Initial motion of the search, one for all moving coordinates or one each.
    begin : str or Design, optional
        A design, of any family, or its folder, whose motion is the initial guess, projected onto this family.
    solver : str or Solver
        A registered name, or a solver object.
    executor : str or callable
        A registered name, or a function of (blueprint, numbers of starts, folder, progress).
    workers : int, optional
        Processes; one per core if not given.

    Raises
    ------
    UnknownName
        No such solver, executor or start.
    InputError
        Invalid numbers.
    """

    starts: int = option(12, "integer", "Random starts; the best one is taken.", metavar="N")
    seed: int = option(0, "integer", "Seed; the same seed on the same machine gives the same motion.", metavar="N")
    start: tuple[str, ...] = option(
        ("random",),
        "names",
        f"Initial guess: {', '.join(STARTS)}; one, or one per moving joint or drive.",
        metavar="KIND,...",
    )
    begin: Any = option(None, "text", "Start the search from the motion of this design, of any family.", metavar="DIR")
    solver: str | Solver = option("sqp", "name", "sqp is fast; ipopt, slsqp are cross-checks.", part="solver")
    executor: str | Executor = option("process", "name", "Where the starts run.", part="executor")
    workers: int | None = option(None, "integer", "Number of processes.  [default: one per core]", metavar="N")

    def __post_init__(self) -> None:
        strict(self)
        if isinstance(self.solver, str):
            check_name("solver", self.solver)
        if isinstance(self.executor, str):
            check_name("executor", self.executor)
        for name in self.start:
            if name not in STARTS:
                raise UnknownName("start", name, STARTS)
