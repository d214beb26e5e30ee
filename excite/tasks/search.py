"""Search for the best motion, and what is written of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from excite.registry import STARTS
from excite.tasks.option import essential, option, strict
from regressors.errors import InputError, check_names

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
    )
    rounds: int | None = option(
        None,
        "integer",
        "Rounds that combine the best motions after the random starts.",
        unset="as many as pay; 0 with starts",
        late=True,
    )
    budget: float | None = option(None, "number", "Processor time after which no further round begins.", late=True)
    seed: int = essential(0, "integer", "Seed of the starts; the same seed on the same machine gives the same motion.")
    start: tuple[str, ...] = option(
        ("random",),
        "names",
        f"Initial guess: {', '.join(STARTS)}; one, or one per moving joint or drive.",
        metavar="KIND,...",
    )
    begin: Any = option(None, "text", "Start the search from the motion of this design, of any family.", metavar="DIR")
    solver: Any = option("sqp", "name", "Solver of the starts: sqp, or module:Name of your own.", part="solver")
    executor: str | Executor = option("process", "name", "Where the starts run.", part="executor")
    workers: int | None = option(None, "integer", "Number of processes.", unset="one per core")

    def __post_init__(self) -> None:
        strict(self)
        check_names("start", self.start, STARTS)

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


MOST_SAMPLES = 1_000_000  # rows of trajectory.csv
ROBOTS_HOME: Literal["robot"] = "robot"


@dataclass(frozen=True)
class Output:
    """Sampling and execution of a motion.

    Parameters
    ----------
    rate : float
        Sampling rate of the written motion and of the reported criteria [Hz].
    home : tuple of float, or "robot", optional
        Pose of all joints from which the robot comes and to which it returns [rad or m], or ``"robot"`` for the one in
        its description; the exciting motion alone if not given.
    via : tuple of (tuple of float)
        Poses to pass between home and the motion [rad or m].
    settle : float
        Rest between approach, exciting motion and return [s].
    speed : tuple of float
        Fractions of full speed, in (0, 1], at which the motion is written as well.
    stops : bool
        The exciting motion is followed by itself, slowly and then with stops: along the same path, so that positions
        and distances keep their limits, and no faster. For servos, whose friction, dead band and offset they show.

    Raises
    ------
    InputError
        Invalid numbers, or via poses without a home.
    """

    rate: float = essential(100.0, "number", "Samples per second of the file.")
    home: tuple[float, ...] | Literal["robot"] | None = option(
        None, "pose", "Home pose, before and after the motion; robot: that of its file.", metavar="Q,..."
    )
    via: tuple[tuple[float, ...], ...] = option(
        (), "poses", "Waypoint between home and the motion; repeatable.", metavar="Q,..."
    )
    settle: float = option(1.0, "number", "Rest before and after the exciting motion.")
    speed: tuple[float, ...] = option(
        (), "numbers", "Write slower rehearsals too: 0.1 for a tenth of speed.", metavar="V,..."
    )
    stops: bool = option(
        False,
        "flag",
        "Play the motion again slowly, and with stops; by default for servos.",
        flag="stops/no-stops",
        late=True,
    )

    def __post_init__(self) -> None:
        strict(self)
        if self.via and self.home is None:
            raise InputError("`via` gives poses between home and the motion, but there is no home; give `home`")
        if isinstance(self.home, str) and self.home != ROBOTS_HOME:
            raise InputError(f"home must be a pose, or {ROBOTS_HOME!r} for that of its file; given {self.home!r}")

    def check_duration(self, period: float) -> None:
        """Raise `InputError` where a motion of this duration [s] is not a whole number of samples, or too many."""
        samples, description = self.rate * period, f"{period:g} s at {self.rate:g} Hz"
        if samples > MOST_SAMPLES:
            raise InputError(f"{description} is {samples:.6g} samples; expected {MOST_SAMPLES} or fewer")
        if samples < 1 or abs(samples - round(samples)) > 1e-9 * samples:
            nearest = max(1, round(samples)) / self.rate
            raise InputError(
                f"{description} is {samples:g} samples, not a whole number; the nearest period is {nearest:.12g} s"
            )
        for speed in self.speed:
            if (slower := samples / speed) > MOST_SAMPLES:
                raise InputError(f"at speed {speed:g} are {slower:.6g} samples; expected {MOST_SAMPLES} or fewer")
