"""Sweeps: YAML that states the options of many designs at once, and their designs, each on disk as soon as it ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from types import GenericAlias
from typing import Any

from pydantic import BaseModel

from excite.design.executors.dask_cluster import unit_executor, versions_of
from excite.design.executors.unit_executor import LostUnit, UnitExecutor
from excite.design.sweeps.cell import (
    CELLS,
    FAILED,
    INFEASIBLE,
    Cell,
    CellRecord,
    CellWork,
    cell_identities,
    cell_name,
    clear_cells,
    design_cell,
    is_cell_name,
    pickled_task,
    place,
    read_cell,
    stored_design,
    value_name,
    write_cell,
)
from excite.design.sweeps.sweep_table import SweepTable, sweep_table
from excite.design.task_file import beside, option_types, options_schema, task_from_options
from excite.errors import LostWorkersError
from excite.storage.atomic import writing
from excite.storage.result_folder import result_folder
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import ExciteError, InputError, listed_names, shortened
from regressors.readers.documents import Document, FieldPath, read_document, validate
from regressors.readers.library import built_in_names

_SHOWN = 3  # names of cells in a message


@dataclass(frozen=True)
class CellProgress:
    """One cell that has ended."""

    cell: str
    done: int  # cells that have ended, those of earlier runs among them
    total: int  # all cells
    condition: float | None = None  # condition number of its design
    status: str = ""  # where there is no design, and why
    reason: str = ""


@dataclass(frozen=True)
class CellsLeft:
    """Cells of a sweep in a folder."""

    done: tuple[Cell, ...]  # finished by an earlier run: designed, or found to be infeasible
    work: tuple[tuple[Cell, CellWork], ...]  # those that are left


@checked
def run_sweep(
    cells: str | Path | Mapping[str, Task] | Sequence[Cell],
    folder: str | Path,
    *,
    executor: str | UnitExecutor = "process",
    workers: int | None = None,
    replace: bool = False,
    progress: Callable[[CellProgress], None] | None = None,
    left: Callable[[CellsLeft], None] | None = None,
) -> SweepTable:
    """Design every cell of a sweep, and write the table of all.

    Every cell is a folder ``cells/NAME`` as `Design.save` writes it, complete as soon as the cell ends. A cell that has
    no feasible motion, or fails, does not stop the others. The same call again continues: finished cells of the same
    problem are not computed again, nor are the finished starts of others, except those that were on Dask.

    Parameters
    ----------
    cells : path, mapping of str to Task, or sequence of Cell
        Sweep file, see `excite.design.sweeps.run_sweep.read_sweep_file`; or tasks by the names of their cells.
    folder : path
        Created if it does not exist.
    executor : str or UnitExecutor
        ``process``, ``serial``, ``dask://HOST:PORT``, ``dask-file:PATH``, ``dask-local`` or ``dask-local:N``: where
        cells run, each as one unit with its starts one after the other. The results are the same.
    workers : int, optional
        Processes of this machine; one per core if not given.
    replace : bool
        Replace cells of other problems that are there under the same names.
    progress : callable, optional
        Called as each cell ends.
    left : callable, optional
        Called once, before the first cell runs.

    Returns
    -------
    SweepTable

    Raises
    ------
    InputError
        A file that cannot be used, a folder with other cells under the same names or in use, or Dask not reachable.
    excite.errors.LostWorkersError
        Worker processes end again and again, or the Dask scheduler went away; the same call continues. The table is
        written, with the cells that are not run.
    KeyboardInterrupt
        Likewise.
    """
    folder, chosen = Path(folder), _cells(cells)
    units = unit_executor(executor, workers)
    with result_folder(folder):
        with writing(folder / CELLS):
            (folder / CELLS).mkdir(exist_ok=True)
        clear_cells(folder / CELLS)
        todo = cells_left(chosen, folder, replace=replace, shares_disk=units.shares_disk)
        if left is not None:
            left(todo)
        try:
            _run(units, todo, folder, progress or (lambda _: None))
        except (KeyboardInterrupt, LostWorkersError):
            sweep_table(chosen, folder).save(folder)
            raise
        except InputError:
            with suppress(OSError):  # as there are no cells in it
                (folder / CELLS).rmdir()
            raise
        table = sweep_table(chosen, folder)
        table.save(folder)
    return table


def _cells(given: str | Path | Mapping[str, Task] | Sequence[Cell]) -> list[Cell]:
    if not isinstance(given, str | Path) and not given:
        raise InputError("a sweep needs at least one cell; none is given")
    if isinstance(given, str | Path):
        return read_sweep_file(given)
    if not isinstance(given, Mapping):
        return list(given)
    if bad := [name for name in given if not is_cell_name(name)]:
        raise InputError(f"names of cells are letters, digits and . _ + - = and commas, given {shortened(bad[0])}")
    return [Cell(name, task) for name, task in given.items()]


def cells_left(cells: Sequence[Cell], folder: Path, *, replace: bool = False, shares_disk: bool = True) -> CellsLeft:
    """Compare the cells of a sweep with those that a folder holds."""
    identities = cell_identities(cells)
    done, others, work = [], [], []
    for cell in cells:
        place_of_cell = folder / CELLS / cell.name
        before = read_cell(place_of_cell)
        wanted = CellRecord(identities[cell.name], cell.task.search.extent)
        same = before is not None and before.sha256 == wanted.sha256 is not None
        if before is not None and wanted.sha256 is not None:
            alike = same and before.search == wanted.search
            if alike and before.status != FAILED and (before.status == INFEASIBLE or stored_design(place_of_cell)):
                done.append(cell)
                continue
            others += [] if alike else [cell.name]
        where = str(place_of_cell) if shares_disk else ""
        work.append((cell, CellWork(pickled_task(cell.task), wanted, where, fresh=not same)))
    if others and not replace:
        count = "1 cell of the same name has" if len(others) == 1 else f"{len(others)} cells of the same names have"
        raise InputError(
            f"in {folder}, {count} other options or versions: {listed_names(others[:_SHOWN])}; `replace` runs "
            "them again, or choose another `folder`"
        )
    return CellsLeft(tuple(done), tuple(work))


def _run(units: UnitExecutor, todo: CellsLeft, folder: Path, progress: Callable[[CellProgress], None]) -> None:
    """Run the cells that are left, write what is not on disk yet, and say what came of each."""
    if not todo.work:
        return
    total = len(todo.done) + len(todo.work)
    results = units.run(design_cell, versions_of(units), [work for _, work in todo.work])
    for done, (index, result) in enumerate(results, len(todo.done) + 1):
        cell, work = todo.work[index]
        place_of_cell, condition = folder / CELLS / cell.name, None
        if isinstance(result, LostUnit):
            record = CellRecord(work.record.sha256, work.record.search, FAILED, result.reason)
            with result_folder(place_of_cell):
                write_cell(place_of_cell, record)
        else:
            record, files = result
            if files:
                place(files, place_of_cell)
        if not record.status and (design := stored_design(place_of_cell)) is not None:
            condition = design["criteria"]["condition_number"]
        progress(CellProgress(cell.name, done, total, condition, record.status, record.reason))


MOST_CELLS = 10_000
_WHERE = ("executor", "workers")  # options that say where a single design runs: given for the whole sweep
_LONGEST_LABEL = 40
_NAME = "name"
Values = Mapping[str, Any]
_Chosen = tuple[str, dict[str, str], dict[str, Any]]


def read_sweep_file(path: str | Path) -> list[Cell]:
    """Read the cells of a sweep file: the product of its ``grid``, less ``exclude``, then those of ``include``.

    ``grid`` has lists of values by the names of options of a task file; or, where values are long, mappings of short
    labels to values. ``common`` has options of all cells. ``exclude`` is a list of combinations that are left out, by
    some of the options of the grid; ``include`` is a list of further cells, each with options beside ``common``.
    """
    path = Path(path)
    document = read_document(path, "sweep file")
    content = validate(document, _schema(document)).model_dump(exclude_none=True)
    grid = {option: _labelled(document, option, content["grid"][option]) for option in _given(document, "grid", {})}
    included = content.get("include", [])
    count = math.prod(map(len, grid.values())) * bool(grid) + len(included)
    if count > MOST_CELLS:
        raise InputError(f"{path}: {count} cells are more than the {MOST_CELLS} that a sweep may have")
    exclude = [_excluded(document, grid, number, each) for number, each in enumerate(content.get("exclude", []))]
    chosen = [*_product(grid, exclude), *_included(_given(document, "include", []), included)]
    _check_names(document, [name for name, _, _ in chosen])
    common = content.get("common", {})
    return [Cell(name, _task(path, name, {**common, **options}), labels) for name, labels, options in chosen]


def _schema(document: Document) -> type[BaseModel]:
    """Schema of a sweep file; each option of a grid is a list, or a mapping of labels to values, as it is given."""
    types = {name: kind for name, kind in option_types().items() if name not in _WHERE}
    content = document.content
    given = content.get("grid") if isinstance(content, dict) else None
    given = given if isinstance(given, dict) else {}
    labelled = {name for name, values in given.items() if isinstance(values, dict)}
    several = {
        name: GenericAlias(dict, (str, kind)) if name in labelled else _list_of(kind) for name, kind in types.items()
    }
    one = str | bool | int | float | list[Any]
    sections = {
        "common": options_schema("Common", types),
        "grid": options_schema("Grid", several),
        "exclude": _list_of(options_schema("Combination", dict.fromkeys(given, one))),
        "include": _list_of(options_schema("Included", {**types, _NAME: str})),
    }
    return options_schema("Sweep", sections)


def _list_of(kind: Any) -> GenericAlias:
    return GenericAlias(list, (kind,))


def _given(document: Document, key: str, otherwise: Any) -> Any:
    """A section as it is written, with the order of its keys, and with whole numbers as such."""
    content: Any = document.content
    return otherwise if content.get(key) is None else content[key]


def _labelled(document: Document, option: str, values: list[Any] | dict[str, Any]) -> dict[str, Any]:
    """Values of one option of the grid by their labels, which are unique."""
    place: FieldPath = ("grid", option)
    if not values:
        raise document.error([(place, "has no value")])
    if isinstance(values, dict):
        bad = [label for label in values if value_name(label) != label or len(label) > _LONGEST_LABEL]
        if bad:
            what = f"labels are letters, digits and . _ + -, {_LONGEST_LABEL} at most, given {shortened(bad[0])}"
            raise document.error([(place, what)])
        return values
    labelled = dict(zip(map(value_name, _given(document, "grid", {})[option]), values, strict=True))
    if len(labelled) < len(values):
        raise document.error([(place, "has a value twice")])
    return labelled


def _product(grid: Mapping[str, Values], exclude: list[dict[str, str]]) -> Iterator[_Chosen]:
    """Names, labels and options of the cells of a grid."""
    for labels in product(*grid.values()) if grid else ():
        cell = dict(zip(grid, labels, strict=True))
        if not any(all(cell[name] == its for name, its in left_out.items()) for left_out in exclude):
            yield cell_name(cell), cell, {name: grid[name][label] for name, label in cell.items()}


def _excluded(document: Document, grid: Mapping[str, Values], number: int, combination: Values) -> dict[str, str]:
    """Labels of a combination that is left out."""
    if not combination:
        raise document.error([(("exclude", number), "names no option of the grid")])
    wanted = {}
    for name, value in combination.items():
        label = value if isinstance(value, str) and value in grid[name] else value_name(value)
        if label not in grid[name]:
            what = f"is not a value of the grid; available: {listed_names(grid[name])}"
            raise document.error([(("exclude", number, name), what)])
        wanted[name] = label
    return wanted


def _included(written: list[Values], include: list[Values]) -> Iterator[_Chosen]:
    """Names, labels and options of further cells, as written and as validated."""
    for text, options in zip(written, include, strict=True):
        labels = {name: value_name(value) for name, value in text.items() if name != _NAME}
        name = options.get(_NAME)
        own = {name: value for name, value in options.items() if name != _NAME}
        yield cell_name(labels) if name is None else value_name(name), labels, own


def _check_names(document: Document, names: list[str]) -> None:
    if not names:
        raise document.error([((), "has no cell: state options in 'grid', or cells in 'include'")])
    known: set[str] = set()
    for name in names:
        if not name:
            raise document.error([(("include",), "has no option")])
        if name.casefold() in known:  # some file systems do not tell the cases of letters apart
            what = f"has two cells named {shortened(name)}; give one of them another 'name'"
            raise document.error([(("include",), what)])
        known.add(name.casefold())


def _task(path: Path, name: str, options: dict[str, Any]) -> Task:
    robot = options.get("robot")
    if robot is None:
        raise InputError(f"{path}: cell {name} has no robot; state one in 'common' or 'grid'")
    if robot not in built_in_names():
        options["robot"] = str(path.parent / robot)
    try:
        return task_from_options(beside(path.parent, options))
    except ExciteError as error:
        raise InputError(f"{path}: cell {name}: {error}") from error
