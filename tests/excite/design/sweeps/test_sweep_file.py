"""Sweep files: which cells they state, under which names; what is wrong with them in one line."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from excite.design.sweeps.cell import cell_name, value_name
from excite.design.sweeps.run_sweep import read_sweep_file
from regressors.errors import InputError


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "sweep.yaml"
    path.write_text(text, encoding="utf-8")
    return path


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


def test_names_do_not_depend_on_other_cells(tmp_path: Path) -> None:
    text = "common: {robot: irp6}\ngrid: {seed: [%s], period: [10, 9.5]}"
    few = {cell.name for cell in read_sweep_file(written(tmp_path, text % "1"))}
    assert few == {"seed=1,period=10", "seed=1,period=9.5"}
    assert few < {cell.name for cell in read_sweep_file(written(tmp_path, text % "0, 1, 2"))}


def test_files_are_relative_to_the_sweep_file(tmp_path: Path) -> None:
    (cell,) = read_sweep_file(written(tmp_path, "grid: {robot: [arms/arm.urdf]}"))
    assert cell.task.robot == str(tmp_path / "arms" / "arm.urdf")
    assert cell.name.startswith("robot=arms-arm.urdf-")


BAD = {
    "": "expected a mapping of fields, given nothing",
    "grid: {seed: [0]": "line 1: not valid YAML",
    "common: {robot: irp6}": "has no cell: state options in 'grid', or cells in 'include'",
    "grid: {}": "has no cell",
    "grid: {seed: []}": "grid.seed (line 1): has no value",
    "grid: {seed: 0}": "grid.seed (line 1): should be a valid list, given 0",
    "grid: {seed: [0, 0]}": "grid.seed (line 1): has a value twice",
    "grid: {seed: [0, 0.5]}": "grid.seed[2] (line 1): should be a valid integer",
    "grid:\n  sed: [0]": "grid.sed (line 2): no such field; did you mean ",
    "grid: {robot: [irp6], executor: [serial]}": "grid.executor (line 1): no such field",
    "common: {workers: 2}\ngrid: {robot: [irp6]}": "common.workers (line 1): no such field",
    "grid: {seed: [0]}": "cell seed=0 has no robot; state one in 'common' or 'grid'",
    "grid: {robot: [irp6], limits: {a b: {velocity: 1}}}": "labels are letters, digits and . _ + -, 40 at most",
    "grid: {robot: [irp6], limits: {a: {speed: 1}}}": "grid.limits.a.speed (line 1): no such field",
    "grid: {robot: [irp6], period: [-1]}": "grid.period[1] (line 1): ",
    "grid: {robot: [irp6]}\nexclude: [{robot: panda}]": "exclude[1].robot (line 2): is not a value of the grid",
    "grid: {robot: [irp6]}\nexclude: [{seed: 1}]": "exclude[1].seed (line 2): no such field",
    "grid: {robot: [irp6]}\nexclude: [{}]": "exclude[1] (line 2): names no option of the grid",
    "grid: {robot: [irp6]}\nexclude: [{robot: irp6}]": "has no cell",
    "include: [{robot: irp6}, {robot: irp6}]": "has two cells named 'robot=irp6'; give one of them another 'name'",
    "include: [{robot: irp6, name: A}, {robot: irp6, name: a}]": "has two cells named 'a'",
    "include: [{}]": "has no option",
    "grid: {robot: [irp6], rate: [0.1]}": "cell robot=irp6,rate=0.1: 10 s at 0.1 Hz is 1 samples",
    "grid: {robot: [irp6], criterion: [conditon]}": "cell robot=irp6,criterion=conditon: ",
    "grid: &a {robot: [irp6]}": "anchors and aliases",
    f"grid: {{robot: [irp6], seed: {list(range(101))}, harmonics: {list(range(1, 101))}}}":
        "10100 cells are more than the 10000 that a sweep may have",
}  # fmt: skip


@pytest.mark.parametrize("text", BAD)
def test_what_is_wrong_is_one_line(tmp_path: Path, text: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as raised:
        read_sweep_file(path)
    message = str(raised.value)
    assert BAD[text] in message
    assert message.startswith(str(path))
    assert "\n" not in message


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read sweep file .*none\.yaml: No such file"):
        read_sweep_file(tmp_path / "none.yaml")


plain = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=60)
values = st.recursive(plain, lambda each: st.lists(each, max_size=4) | st.dictionaries(st.text(), each, max_size=3))


@settings(max_examples=50)
@given(values, values)
def test_value_names_are_safe_and_tell_values_apart(one: object, other: object) -> None:
    name = value_name(one)
    assert name.isascii()
    assert set(name) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.+-")
    assert len(name) <= 41
    assert name not in (".", "..")
    if isinstance(one, str | float | list) and isinstance(other, type(one)) and repr(one) != repr(other):
        assert name != value_name(other) or str(one) == str(other) or _alike(one, other)


def _alike(one: object, other: object) -> bool:
    """Lists that are written alike: [1] and ["1"], ["a", "b"] and ["a+b"]."""
    return isinstance(one, list) and isinstance(other, list)


@given(st.dictionaries(st.sampled_from(["robot", "seed", "limits"]), st.text("ab1", min_size=1, max_size=90)))
def test_cell_names_fit_a_file_system(options: dict[str, str]) -> None:
    assert len(cell_name(options)) <= 169
