"""Designs of all cells of a sweep, each on disk as soon as it ends; finished ones are not computed again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from excite.design.executors.unit_executor import LostUnit, UnitExecutor
from excite.design.executors.unit_executors import unit_executor
from excite.design.problem_identity import PACKAGES
from excite.design.sweeps.cell import Cell, cell_identities, is_cell_name
from excite.design.sweeps.cell_folder import (
    CELLS,
    FAILED,
    INFEASIBLE,
    CellRecord,
    CellWork,
    clear_cells,
    design_cell,
    pickled_task,
    place,
    read_cell,
    stored_design,
    write_cell,
)
from excite.design.sweeps.sweep_file import read_sweep_file
from excite.design.sweeps.sweep_table import SweepTable, sweep_table
from excite.errors import LostWorkersError
from excite.storage.atomic import writing
from excite.storage.result_folder import result_folder
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.quoting import listed_names, shortened

_SHOWN = 3  # names of cells in a message


@dataclass(frozen=True)
class CellProgress:
    """One cell that has ended.

    Parameters
    ----------
    cell : str
    done, total : int
        Cells that have ended, those of earlier runs among them, and all cells.
    condition : float, optional
        Condition number of its design.
    status, reason : str
        Where there is no design.
    """

    cell: str
    done: int
    total: int
    condition: float | None = None
    status: str = ""
    reason: str = ""


@dataclass(frozen=True)
class CellsLeft:
    """Cells of a sweep in a folder.

    Parameters
    ----------
    done : tuple of Cell
        Finished by an earlier run: designed, or found to be infeasible.
    work : tuple of (Cell, CellWork)
        Those that are left.
    """

    done: tuple[Cell, ...]
    work: tuple[tuple[Cell, CellWork], ...]


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
        Sweep file, see `excite.design.sweeps.sweep_file.read_sweep_file`; or tasks by the names of their cells.
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
    versions = {} if units.shares_disk else {name: version(name) for name in PACKAGES}
    total = len(todo.done) + len(todo.work)
    results = units.run(design_cell, versions, [work for _, work in todo.work])
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
