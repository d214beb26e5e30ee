"""The table of a sweep: a thousand cells, groups that are comparable, figure, page and summary."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from designed import copies

import excite
from excite.cli.sweep_run import show_sweep
from excite.design.sweeps.cell import CELLS, Cell, read_cell, write_cell
from excite.design.sweeps.run_sweep import cells_left
from excite.design.sweeps.sweep_table import SweepTable, load_sweep, sweep_table
from excite.design.task_file import task_content
from excite.tasks.task import Task
from regressors.errors import InputError

COUNT = 60


@pytest.fixture(scope="module")
def cells() -> list[Cell]:
    return [
        Cell(f"{robot}-{seed}", Task("irp6", seed=seed, starts=2), {"robot": robot, "seed": str(seed % 10)})
        for robot in ("one", "two")
        for seed in range(COUNT // 2)
    ]


@pytest.fixture(scope="module")
def root(cells: list[Cell], tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("sweep") / "out"

    def change(number: int, content: dict[str, Any]) -> None:
        content["criteria"]["condition_number"] = 1000.0 - number
        content["base"]["columns"] = ["one" if number < COUNT // 2 else "two"]
        if number == 3:  # whatever the file says of it
            content["trajectory"]["cosine"] = [[3 * x for x in row] for row in content["trajectory"]["cosine"]]

    copies(cells, root, change)
    broken = root / CELLS / cells[5].name
    before = read_cell(broken)
    assert before is not None
    write_cell(broken, replace(before, status="infeasible", reason="no \x1b[31mway"))
    return root


@pytest.fixture(scope="module")
def table(cells: list[Cell], root: Path) -> Iterator[SweepTable]:
    return sweep_table(cells, root)


def test_finished_cells_are_not_left(cells: list[Cell], root: Path) -> None:
    left = cells_left(cells, root)
    assert (len(left.done), len(left.work)) == (COUNT, 0)


@pytest.mark.parametrize("changed", [{"starts": 3}, {"harmonics": 4}, {"noise": 2.0}, {"rate": 50.0}])
def test_cells_with_other_options_are_refused_or_run_again(
    changed: dict[str, Any], cells: list[Cell], root: Path
) -> None:
    other = replace(cells[0], task=cells[0].task.changed(**changed))
    with pytest.raises(InputError, match="1 cell of the same name has other options or versions: one-0; `replace`"):
        cells_left([other, *cells[1:3]], root)
    left = cells_left([other, *cells[1:3]], root, replace=True)
    assert [(cell.name, work.fresh) for cell, work in left.work] == [("one-0", "starts" not in changed)]


@pytest.mark.parametrize("changed", [{"executor": "serial"}, {"workers": 1}])
def test_where_a_cell_runs_changes_nothing(changed: dict[str, Any], cells: list[Cell], root: Path) -> None:
    assert cells_left([replace(cells[0], task=cells[0].task.changed(**changed))], root).work == ()


def test_failed_cells_run_again_and_infeasible_ones_do_not(cells: list[Cell], root: Path, tmp_path: Path) -> None:
    record = read_cell(root / CELLS / cells[0].name)
    assert record is not None
    for status, work in (("failed", 1), ("infeasible", 0), ("", 1)):  # the last without a design
        folder = tmp_path / CELLS / cells[0].name
        folder.mkdir(parents=True, exist_ok=True)
        write_cell(folder, replace(record, status=status, reason="why"))
        assert len(cells_left([cells[0]], tmp_path).work) == work


def test_groups_have_the_best_first(table: SweepTable) -> None:
    assert table.counts == {"designed": COUNT - 2, "exceeds limits": 1, "infeasible": 1}
    assert not table.holds
    assert {group: (rows[0].cell, len(rows)) for group, rows in table.groups.items()} == {
        1: ("one-29", COUNT // 2 - 1),
        2: ("two-29", COUNT // 2),
    }
    conditions = [row.condition for row in table.groups[2]]
    assert conditions == sorted(conditions)


def test_csv_has_a_line_for_every_cell_and_the_table_is_read_back(table: SweepTable, root: Path) -> None:
    files = table.save(root)
    with files[0].open(newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    assert [line["cell"] for line in lines] == [row.cell for row in table.rows]
    assert [float(line["condition_number"] or "inf") for line in lines] == [row.condition for row in table.rows]
    assert (lines[5]["status"], lines[5]["group"], lines[5]["grid.seed"]) == ("infeasible", "", "5")
    assert load_sweep(root) == table
    files[1].write_text(files[1].read_text().replace("designed", "dreamt"))
    with pytest.raises(InputError, match=r"campaign\.json has been changed"):
        load_sweep(root)
    table.save(root)


def test_summary_fits_thirty_lines(table: SweepTable, root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show_sweep(table, [root / "campaign.csv"], root)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 30
    assert lines[0] == "58 of 60 cells have a design within their limits; 1 exceeds limits; 1 infeasible."
    assert "48 more cells" in "\n".join(lines)
    assert not any("\x1b" in line for line in lines)


@pytest.mark.slow
def test_a_thousand_cells_are_in_one_table_figure_and_page(tmp_path: Path) -> None:
    cells = [
        Cell(f"s{seed}", Task("irp6", seed=seed), {"seed": str(seed), "tens": str(seed // 10)}) for seed in range(1000)
    ]
    copies(cells, tmp_path / "out", lambda number, content: content["criteria"].update(condition_number=50.0 + number))
    assert cells_left(cells, tmp_path / "out").work == ()
    table = sweep_table(cells, tmp_path / "out")
    table.save(tmp_path / "out")
    with (tmp_path / "out" / "campaign.csv").open(newline="", encoding="utf-8") as stream:
        assert [line["cell"] for line in csv.DictReader(stream)] == [cell.name for cell in cells]
    (figure,) = excite.draw(table).values()
    assert [ax.get_title("left") for ax in figure.axes] == ["by seed", "by tens"]
    for ax in figure.axes:
        assert sum(np.size(line.get_xdata()) for line in ax.lines if line.get_marker() in (".", "^")) == 1000
    page = excite.write_report(tmp_path / "out", tmp_path / "page.html").read_text(encoding="utf-8")
    assert all(f">{cell.name}<" in page for cell in cells)
    assert "1000 of 1000 cells have a design within their limits" in page


def test_the_options_that_identify_a_cell_are_all_of_a_task() -> None:
    """An option of a task that did not count would let a sweep keep designs of another problem."""
    from excite.design.sweeps.cell import cell_identities

    task = Task("irp6")
    ours = cell_identities([Cell("a", task)])["a"]
    for name, value in {
        "seed": 1,
        "gravity": (0.0, 0.0, -1.6),
        "criterion": "logdet",
        "home": "robot",
        "begin": "d",
    }.items():
        assert name in task_content(task)
        assert cell_identities([Cell("a", task.changed(**{name: value}))])["a"] != ours
