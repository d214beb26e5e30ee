"""Results of starts, their files, and the best of them."""

from __future__ import annotations

import hashlib
import heapq
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from excite.storage.manifest import read_hashed, write_hashed
from regressors.errors import InputError
from regressors.numerical import or_none
from regressors.samples import Array

RUNNING = "running; this is the best point so far"
_NAME = re.compile(r"start-(\d+)\.json")


@dataclass(frozen=True)
class StartResult:
    """Final point of a start, or its best point so far."""

    index: int  # number of the start; with the seed it determines the result
    x: list[Any]  # coefficients, shape (n, size), or the flat x of a family that is not linear in it; inside the limits
    value: float  # the criterion at the task's rate with exact friction; while running, the solver's smooth value
    status: str  # how it ended, as a sentence
    history: list[float]  # the criterion at every accepted iterate, with the smooth friction sign of the solver
    evaluations: int
    cpu: float  # processor time [s]
    parents: tuple[int, ...] = ()  # numbers of the starts whose motions it combines or refines; none for a random one
    lineage: str = ""  # hash of what it descends from, see `excite.design.start_results`; empty for a random one

    @property
    def coefficients(self) -> Array:
        """`x` as an array."""
        return np.array(self.x)

    def summary(self) -> dict[str, Any]:
        """What ``design.json`` says of it."""
        return {
            "index": self.index,
            "value": or_none(self.value),
            "status": self.status,
            "iterations": len(self.history),
            "evaluations": self.evaluations,
            "cpu_seconds": self.cpu,
        }


Progress = Callable[[StartResult], None]
Kind = Literal["random", "combination", "refinement"]


@dataclass(frozen=True, eq=False)
class PlannedStart:
    """One start of a search; with the seed it determines its result."""

    index: int  # its number
    # whether it begins with random motions, with combinations of its parents, or goes on from its only parent
    kind: Kind = "random"
    parents: tuple[StartResult, ...] = ()  # the best motions of earlier rounds
    avoided: tuple[StartResult, ...] = ()  # motions to whose basins it is not to return

    @property
    def lineage(self) -> str:
        """Hash of what the start depends on beside the problem and its number; empty for a random one."""
        if self.kind == "random":
            return ""
        content = json.dumps([self.kind, *([each.x for each in group] for group in (self.parents, self.avoided))])
        return hashlib.sha256(content.encode()).hexdigest()


Start = PlannedStart | int  # a number alone is that of a random one
Starts = Sequence[Start]


def number_of(start: Start) -> int:
    """Number of a start."""
    return start if isinstance(start, int) else start.index


#: Where a start's file comes from: ``problem``, see `excite.design.problem_identity`; ``sha256``, its hash, None where
#: two such problems cannot be compared; and ``run``, the unique number of the run that computed it.
Origin = dict[str, Any]


def start_file(folder: Path, index: int) -> Path:
    """File of a start."""
    return folder / f"start-{index:04d}.json"


def write_start(folder: Path, result: StartResult, origin: Origin | None = None) -> None:
    """Write one start's file; infinite values, of a motion that does not identify every parameter, become null."""
    content = asdict(result)
    content["value"] = or_none(result.value)
    content["history"] = [or_none(value) for value in result.history]
    if origin is not None:
        content["origin"] = origin
    write_hashed(start_file(folder, result.index), content)


def or_infinite(value: float | None) -> float:
    """A criterion as JSON holds it."""
    return np.inf if value is None else value


def start_files(folder: Path) -> list[tuple[int, Path]]:
    """Numbers and files of all starts on disk, by number."""
    found = ((_NAME.fullmatch(path.name), path) for path in folder.iterdir())
    return sorted((int(match.group(1)), path) for match, path in found if match is not None)


def read_start(path: Path) -> tuple[StartResult, Origin | None]:
    """Read one start's file."""
    content = read_hashed(path)
    try:
        known = fields(StartResult)  # younger ones have defaults
        values = {each.name: content[each.name] for each in known if each.default is MISSING or each.name in content}
        values["parents"] = tuple(values.get("parents", ()))
        values["history"] = [or_infinite(value) for value in values["history"]]
        values["value"] = or_infinite(values["value"])
        origin = (
            {name: content["origin"][name] for name in ("problem", "sha256", "run")} if "origin" in content else None
        )
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not the complete file of a start: {error}") from error
    return StartResult(**values), origin


RANDOM_MOTIONS = 20  # that a design is compared with


@dataclass(frozen=True)
class SearchSummary:
    """What became of a search."""

    rounds: int  # rounds after the first
    populations: int  # populations that ended since they brought next to nothing any more
    left: float | None  # estimated relative gain of one more population; None with fewer than two
    random: float | None = None  # least criterion of `RANDOM_MOTIONS` random ones within the limits; None if infinite


@dataclass(frozen=True)
class HarmonicsTrial:
    """One number of harmonics that a search tried, its best criterion, and the processor time [s]."""

    harmonics: int
    value: float
    cpu_seconds: float


def read_starts(folder: Path) -> list[StartResult]:
    """Read all starts on disk, by number."""
    return [read_start(path)[0] for _, path in start_files(folder)]


MOST_KEPT = 1000  # starts that a design keeps


@dataclass(frozen=True)
class BestStarts:
    """The best starts of a search, and how many there are."""

    best: tuple[StartResult, ...]  # by number; all of them, where there are not too many
    ended: int  # numbers of starts that ended, of those stopped before, and of those without a result
    unfinished: int
    missing: int = 0

    @property
    def further(self) -> int:
        """Number of starts beside the best."""
        return self.ended + self.unfinished - len(self.best)

    def note(self, *, interrupted: bool) -> str:
        """A sentence on starts that did not end; empty where all did."""
        if interrupted:
            return f"interrupted: best of {self.ended} finished and {self.unfinished} unfinished starts"
        if self.missing:
            return f"{self.missing} of {self.ended + self.missing} starts are left out: their processes ended each time"
        return ""


def best_starts(folder: Path, count: int, most: int = MOST_KEPT) -> BestStarts:
    """Read the starts below a number, and keep the best."""
    unfinished: Counter[bool] = Counter()

    def counted() -> Iterator[StartResult]:
        for _, path in start_files(folder):
            if (start := read_start(path)[0]).index < count:
                unfinished[start.status == RUNNING] += 1
                yield start

    best = heapq.nsmallest(most, counted(), key=lambda start: (start.value, start.index))
    by_number = tuple(sorted(best, key=lambda start: start.index))
    return BestStarts(by_number, unfinished[False], unfinished[True], count - unfinished.total())
