"""Folders of sweeps whose designs are copies of one, made without any search."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from excite.design.formulation import formulate
from excite.design.optimisation import solve
from excite.files.design_folder import design_content
from excite.storage.migrations import schema_of
from excite.sweeps.cell import Cell, cell_identities
from excite.sweeps.cell_folder import CELLS
from excite.tasks.task import Task
from regressors.readers.library import load_robot


@cache
def _content(folder: str) -> str:
    task = Task("irp6", harmonics=3, starts=1, executor="serial")
    robot = load_robot("irp6")
    return json.dumps(design_content(solve(robot, formulate(robot, task), Path(folder))))


def copies(cells: Sequence[Cell], root: Path, change: Callable[[int, dict[str, Any]], None]) -> None:
    """Write a design into every cell's folder.

    Parameters
    ----------
    cells : sequence of Cell
    root : Path
        Of the sweep; its parent holds the starts of the design that is copied.
    change : callable
        Changes the content of ``design.json`` of a cell by its number.
    """
    starts = root.parent / "copied"
    starts.mkdir(exist_ok=True)
    identities = cell_identities(cells)
    for number, cell in enumerate(cells):
        folder = root / CELLS / cell.name
        folder.mkdir(parents=True)
        content = json.loads(_content(str(starts)))
        change(number, content)
        record = {"schema": schema_of("cell"), "sha256": identities[cell.name], "status": "", "reason": ""}
        (folder / "design.json").write_text(json.dumps(content))
        (folder / "cell.json").write_text(json.dumps({**record, "search": cell.task.search.extent}))
