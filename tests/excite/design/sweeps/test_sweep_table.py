"""Sweep files and the table of a sweep: which cells are stated, groups that are comparable, figure and page."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from designed import copies
from hypothesis import given, settings, strategies as st
from refused import refusal
from written_files import text_file

from excite.cli.design_run import show_sweep
from excite.design.sweeps.cell import CELLS, Cell, cell_identities, cell_name, read_cell, value_name, write_cell
from excite.design.sweeps.run_sweep import cells_left, read_sweep_file
from excite.design.sweeps.sweep_table import SweepTable, load_sweep, sweep_table
from excite.design.task_file import task_content
from excite.tasks.task import Task
from regressors.errors import InputError


def written(tmp_path: Path, text: str) -> Path:
    return text_file(tmp_path / "sweep.yaml", text)


WHOLE = """
common: {starts: 3, harmonics: 4}
grid:
  robot: [irp6, panda]
  limits: {slow: {velocity: 0.5}, fast: {velocity: [1.0]}}
  seed: [0, 1, 2]
  joints: [[1, 2], [1, 2, 3]]
exclude:
  - {robot: panda, limits: slow}
  - {seed: 2, joints: [1, 2]}
include:
  - {robot: ur10e, limits: {acceleration: 3}, seed: 0}
  - {name: mine, robot: irp6, criterion: logdet}
"""


def test_cells_are_the_product_less_exclude_and_include(tmp_path: Path) -> None:
    cells = read_sweep_file(written(tmp_path, WHOLE))
    expected = [
        {"robot": robot, "limits": limits, "seed": str(seed), "joints": joints}
        for robot, limits, seed, joints in product(("irp6", "panda"), ("slow", "fast"), (0, 1, 2), ("1+2", "1+2+3"))
        if not (robot == "panda" and limits == "slow") and not (seed == 2 and joints == "1+2")
    ]
    assert [dict(cell.options) for cell in cells[:-2]] == expected
    assert cells[0].name == "robot=irp6,limits=slow,seed=0,joints=1+2"
    assert cells[-1].name == "mine"
    by_name = {cell.name: cell.task for cell in cells}
    task = by_name["robot=panda,limits=fast,seed=1,joints=1+2+3"]
    assert (task.robot, task.search.seed, task.model.joints) == ("panda", 1, ("1", "2", "3"))
    assert (task.limits.velocity, task.search.starts, task.trajectory.harmonics) == ((1.0,), 3, 4)
    assert by_name["mine"].objective.criterion == "logdet"
    assert cells[-2].task.limits.acceleration == (3.0,)


def test_names_do_not_depend_on_other_cells_and_files_are_relative_to_the_sweep_file(tmp_path: Path) -> None:
    text = "common: {robot: irp6}\ngrid: {seed: [%s], period: [10, 9.5]}"
    few = {cell.name for cell in read_sweep_file(written(tmp_path, text % "1"))}
    assert few == {"seed=1,period=10", "seed=1,period=9.5"}
    assert few < {cell.name for cell in read_sweep_file(written(tmp_path, text % "0, 1, 2"))}
    (cell,) = read_sweep_file(written(tmp_path, "grid: {robot: [arms/arm.urdf]}"))
    assert cell.task.robot == str(tmp_path / "arms" / "arm.urdf")
    assert cell.name.startswith("robot=arms-arm.urdf-")


BAD = {
    "grid: {seed: [0]": "line 1: not valid YAML",
    "common: {robot: irp6}": "has no cell: state options in 'grid', or cells in 'include'",
    "grid: {seed: []}": "grid.seed (line 1): has no value",
    "grid: {seed: [0, 0]}": "grid.seed (line 1): has a value twice",
    "grid: {seed: [0, 0.5]}": "grid.seed[2] (line 1): should be a whole number, given 0.5",
    "grid:\n  sed: [0]": "grid.sed (line 2): no such field; did you mean ",
    "grid: {robot: [irp6], executor: [serial]}": "grid.executor (line 1): no such field",
    "grid: {seed: [0]}": "cell seed=0 has no robot; state one in 'common' or 'grid'",
    "grid: {robot: [irp6], limits: {a b: {velocity: 1}}}": "labels are letters, digits and . _ + -, 40 at most",
    "grid: {robot: [irp6], period: [-1]}": "grid.period[1] (line 1): ",
    "grid: {robot: [irp6]}\nexclude: [{robot: panda}]": "exclude[1].robot (line 2): is not a value of the grid",
    "grid: {robot: [irp6]}\nexclude: [{}]": "exclude[1] (line 2): names no option of the grid",
    "include: [{robot: irp6}, {robot: irp6}]": "has two cells named 'robot=irp6'; give one of them another 'name'",
    "include: [{robot: irp6, name: A}, {robot: irp6, name: a}]": "has two cells named 'a'",
    "include: [{}]": "has no option",
    "grid: {robot: [irp6], rate: [0.1]}": "cell robot=irp6,rate=0.1: 10 s at 0.1 Hz is 1 samples",
    "grid: {robot: [irp6], criterion: [conditon]}": "cell robot=irp6,criterion=conditon: ",
    "grid: &a {robot: [irp6]}": "anchors and aliases",
    f"grid: {{robot: [irp6], seed: {list(range(101))}, harmonics: {list(range(1, 101))}}}":
        "10100 cells are more than the 10000 that a sweep may have",
}  # fmt: skip


def test_what_is_wrong_is_one_line(tmp_path: Path) -> None:
    for text, message in BAD.items():
        path = written(tmp_path, text)
        assert message in refusal(read_sweep_file, path, begins=str(path))
    with pytest.raises(InputError, match=r"cannot read sweep file .*none\.yaml: No such file"):
        read_sweep_file(tmp_path / "none.yaml")


plain = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=60)
values = st.recursive(plain, lambda each: st.lists(each, max_size=4) | st.dictionaries(st.text(), each, max_size=3))


@settings(max_examples=50)
@given(values, values)
def test_value_names_are_safe_and_tell_values_apart(one: object, other: object) -> None:
    name = value_name(one)
    assert re.fullmatch(r"[\w.+-]{0,41}", name, re.ASCII)
    assert name not in (".", "..")
    if isinstance(one, str | float) and isinstance(other, type(one)) and repr(one) != repr(other):
        assert name != value_name(other) or str(one) == str(other)


@given(st.dictionaries(st.sampled_from(["robot", "seed", "limits"]), st.text("ab1", min_size=1, max_size=90)))
def test_cell_names_fit_a_file_system(options: dict[str, str]) -> None:
    assert len(cell_name(options)) <= 169


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


def test_finished_cells_are_not_left_and_those_with_other_options_are_refused(cells: list[Cell], root: Path) -> None:
    left = cells_left(cells, root)
    assert (len(left.done), len(left.work)) == (COUNT, 0)
    for changed in ({"starts": 3}, {"harmonics": 4}, {"noise": 2.0}, {"rate": 50.0}):
        other = [replace(cells[0], task=cells[0].task.changed(**changed)), *cells[1:3]]
        with pytest.raises(InputError, match="1 cell of the same name has other options or versions: one-0; `replace`"):
            cells_left(other, root)
        left = cells_left(other, root, replace=True)
        assert [(cell.name, work.fresh) for cell, work in left.work] == [("one-0", "starts" not in changed)]
    for changed in ({"executor": "serial"}, {"workers": 1}):  # where a cell runs changes nothing
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
    best = [(group, rows[0].cell, len(rows)) for group, rows in table.groups.items()]
    assert best == [(1, "one-29", COUNT // 2 - 1), (2, "two-29", COUNT // 2)]
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


def test_the_options_that_identify_a_cell_are_all_of_a_task() -> None:
    """An option of a task that did not count would let a sweep keep designs of another problem."""
    task = Task("irp6")
    ours = cell_identities([Cell("a", task)])["a"]
    changes = {"seed": 1, "gravity": (0.0, 0.0, -1.6), "criterion": "logdet", "home": "robot", "begin": "d"}
    for name, value in changes.items():
        assert name in task_content(task)
        assert cell_identities([Cell("a", task.changed(**{name: value}))])["a"] != ours
