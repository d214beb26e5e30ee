"""All cells of a sweep in one table, with what may be compared marked."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from constraints.certificate import LimitUse
from excite.design.approach import stated_on_transfers
from excite.design.design import recomputed_limits
from excite.design.design_json import load_design
from excite.design.sweeps.cell import CELLS, Cell, read_cell, stored_design
from excite.registry import name_of
from excite.storage.atomic import replacing
from excite.storage.codec import record_of
from excite.storage.records import Shown, read_record, write_record
from regressors.arguments import checked
from regressors.errors import InputError

KIND = "campaign"
TABLE, JSON = "campaign.csv", "campaign.json"
DESIGNED, BROKEN, LEFT = "designed", "exceeds limits", "not run"
STATUSES = (DESIGNED, BROKEN, LEFT, "infeasible", "failed")


@dataclass(frozen=True, kw_only=True)
class CellFacts:
    """What is known of a cell's design."""

    robot: str
    model: str
    trajectory: str = ""
    parameters: int  # of the base
    duration: float  # of all that is played [s]
    minimised: str = ""
    criterion: float | None  # least value that was reached
    tightest_limit: str | None = None
    limit_use: float | None  # of the tightest limit
    starts: int = 0
    cpu_seconds: float | None = None  # processor time [s]


@dataclass(frozen=True)
class SweepRow:
    """One cell of a sweep in numbers."""

    cell: str  # name of the cell, and of its folder in ``cells``
    options: Mapping[str, str]  # options of the grid
    status: str  # one of `STATUSES`
    # rows of the same group have the same robot, model, moving joints and base parameters, so that their numbers are
    # comparable; 0 without a design
    group: int = 0
    # of ``design.json``, see `excite.information.matrix.CONVENTIONS`; each at the rate and noise of its own task
    criteria: Mapping[str, float | None] = field(default_factory=dict)
    facts: CellFacts | None = None  # of the design
    reason: str = ""  # why there is no design, or why its limits could not be computed

    def __post_init__(self) -> None:
        """Check that there is such an end, and facts of a design."""
        if self.status not in STATUSES:
            raise InputError(f"no cell ends {self.status!r}")
        if self.group and self.facts is None:
            raise InputError(f"cell {self.cell!r} has a design, but no facts of it")

    @property
    def condition(self) -> float:
        """Condition number, infinite where there is none."""
        value = self.criteria.get("condition_number")
        return math.inf if value is None else value


@dataclass(frozen=True)
class SweepTable(Shown):
    """The table of a sweep; the same when it is loaded.

    Parameters
    ----------
    rows : tuple of SweepRow
        In the order of the sweep.
    """

    rows: tuple[SweepRow, ...]

    def __post_init__(self) -> None:
        """Check that there are cells."""
        if not self.rows:
            raise InputError("it has no cells")

    def __repr__(self) -> str:
        told = ", ".join(f"{count} {status}" for status, count in self.counts.items())
        return f"SweepTable({len(self.rows)} cells: {told})"

    @property
    def counts(self) -> dict[str, int]:
        """Number of cells by status."""
        return dict(Counter(row.status for row in self.rows))

    @property
    def holds(self) -> bool:
        """Whether every cell has a design inside its limits."""
        return all(row.status == DESIGNED for row in self.rows)

    @property
    def varied(self) -> tuple[str, ...]:
        """Options of the grid, in its order."""
        return tuple(dict.fromkeys(option for row in self.rows for option in row.options))

    @property
    def often_varied(self) -> tuple[str, ...]:
        """Options that most cells state, and not all alike."""
        stated = {name: [row.options[name] for row in self.rows if name in row.options] for name in self.varied}
        many = len(self.rows) // 2
        return tuple(name for name, values in stated.items() if len(values) > many and len(set(values)) > 1)

    @property
    def groups(self) -> dict[int, tuple[SweepRow, ...]]:
        """Designed rows by group, each sorted by condition number."""
        made = sorted((row for row in self.rows if row.group), key=lambda row: (row.group, row.condition))
        return {group: tuple(row for row in made if row.group == group) for group in {row.group: None for row in made}}

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``campaign.csv`` and ``campaign.json`` into the folder of the sweep, both at once.

        Raises
        ------
        InputError
            The folder cannot be written to.
        """
        return write_record(self, KIND, Path(folder), KIND, further={TABLE: self._write_lines})

    def _write_lines(self, path: Path) -> None:
        with replacing(path) as stream:
            csv.writer(stream, lineterminator="\n").writerows(_lines(self))


@checked
def load_sweep(folder: str | Path) -> SweepTable:
    """Read the table of a sweep from its folder, or from its ``campaign.json``."""
    path = Path(folder)
    return read_record(path if path.suffix == ".json" else path / JSON, SweepTable, KIND)


def sweep_table(cells: Iterable[Cell], folder: Path) -> SweepTable:
    """Table of the cells of a sweep, from their folders."""
    groups: dict[Any, int] = {}
    return SweepTable(tuple(_row(cell, folder / CELLS / cell.name, groups) for cell in cells))


def _row(cell: Cell, folder: Path, groups: dict[Any, int]) -> SweepRow:
    record, options = read_cell(folder), dict(cell.options)
    if record is not None and record.status:
        return SweepRow(cell.name, options, record.status, reason=record.reason)
    design = stored_design(folder)
    if design is None:
        return SweepRow(cell.name, options, LEFT)
    task = design["task"]
    comparable = (
        design["robot"]["sha256"], task["model"], task["window"], tuple(design["trajectory"]["joints"]),
        str(task["drives"]), tuple(design["base"]["columns"]),
    )  # fmt: skip
    group = groups.setdefault(comparable, len(groups) + 1)
    reason = ""
    try:
        motion, transfers, _ = recomputed_limits(load_design(folder), enclosed=False)
    except InputError as error:
        motion = tuple(record_of(LimitUse, use, {}) for use in design["limits"])
        transfers = stated_on_transfers(design.get("played", {}))
        reason = f"all limits are those that its file states: {error}"
    uses = (*motion, *(use for uses in transfers.values() for use in uses))
    status = DESIGNED if all(use.holds for use in uses) else BROKEN
    return SweepRow(cell.name, options, status, group, design["criteria"], _facts(cell, design, uses), reason)


def _facts(cell: Cell, design: Mapping[str, Any], uses: Sequence[LimitUse]) -> CellFacts:
    tightest = max(uses, key=lambda use: use.use, default=None)
    solver = design["solver"]
    return CellFacts(
        robot=design["robot"]["name"],
        model=name_of(cell.task.model.model),
        trajectory=design["trajectory"]["family"],
        parameters=design["base"]["rank"],
        duration=design["played"]["duration"],
        minimised=design["minimised"],
        criterion=min((start["value"] for start in solver["starts"] if start["value"] is not None), default=None),
        tightest_limit=None if tightest is None else tightest.label,
        limit_use=None if tightest is None else tightest.use,
        starts=len(solver["starts"]) + solver.get("further_starts", 0),
        cpu_seconds=design["provenance"]["cpu_seconds"],
    )


def _lines(table: SweepTable) -> list[Sequence[Any]]:
    """Header and lines of the CSV file."""
    criteria = list(dict.fromkeys(name for row in table.rows for name in row.criteria))
    facts = [each.name for each in fields(CellFacts)] if table.groups else []
    varied = table.varied
    header = ["cell", "status", "group", *(f"grid.{name}" for name in varied), *criteria, *facts, "reason"]
    lines: list[Sequence[Any]] = [header]
    for row in table.rows:
        options, numbers = [row.options.get(name, "") for name in varied], [row.criteria.get(name) for name in criteria]
        own = [getattr(row.facts, name, None) for name in facts]
        lines.append([row.cell, row.status, row.group or "", *options, *numbers, *own, row.reason])
    return lines
