"""Files of results are data from anywhere: nothing that they name is opened, and what was edited is found."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from written_files import text_file

import excite
from excite.design.formulation import formulate
from excite.design.problem_identity import NotComparable, ProblemIdentity, plain_value
from excite.storage.manifest import entry_sha256
from excite.tasks.criteria import ConditionNumber
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot

_BODY = (
    '<link name="{0}"><inertial><origin xyz="0.1 0.02 0.03"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" '
    'iyy="0.1" iyz="0" izz="0.1"/></inertial><collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.03" '
    'length="0.2"/></geometry></collision></link><joint name="{1}" type="revolute"><parent link="{2}"/>'
    '<child link="{0}"/><origin xyz="0 0 0.3"/><axis xyz="{3}"/><limit lower="-2" upper="2" velocity="2" effort="80"/>'
    "</joint>"
)
_BODIES = (("l1", "q1", "base", "0 0 1"), ("l2", "q2", "l1", "0 1 0"), ("l3", "q3", "l2", "0 1 0"))
URDF = f'<robot name="arm"><link name="base"/>{"".join(_BODY.format(*each) for each in _BODIES)}</robot>'
SMALL: dict[str, Any] = {"period": 5.0, "harmonics": 3, "starts": 1, "executor": "serial", "acceleration": (8.0,)}
_opened: list[str] | None = None


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if _opened is not None and event == "open":
        _opened.append(str(arguments[0]))


sys.addaudithook(_note)


@contextmanager
def files_opened() -> Iterator[list[str]]:
    """Names of all files that are opened in the block, as Python itself counts them."""
    global _opened
    _opened = []
    try:
        yield _opened
    finally:
        _opened = None


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two designs of a URDF with shapes, the second of which began with the first; the URDF is gone."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "arm.urdf").write_text(URDF, encoding="utf-8")
    task = excite.Task(str(folder / "arm.urdf"), **SMALL, speed=(0.5,))
    excite.design_trajectory(task).save(folder / "first")
    excite.design_trajectory(task.changed(begin=str(folder / "first"))).save(folder / "second")
    (folder / "arm.urdf").unlink()
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made / "second", tmp_path / "design"))


def edit(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    content = json.loads((folder / "design.json").read_text(encoding="utf-8"))
    change(content)
    (folder / "design.json").write_text(json.dumps(content), encoding="utf-8")
    (folder / "manifest.json").unlink(missing_ok=True)  # as in a folder of an older version


@pytest.mark.parametrize("option", ["world", "support", "friction_curves", "payload", "begin", "robot"])
def test_nothing_that_a_design_names_is_opened(folder: Path, option: str) -> None:
    secret = text_file(folder / "secret.yaml", "password: 12345")
    edit(folder, lambda content: content["task"].update({option: str(secret)}))
    with files_opened() as opened:
        stored = excite.load_design(folder)
        assert excite.simulate(stored, rate=50.0).log.count > 0
        if option in ("robot", "begin"):  # which the design holds itself
            excite.design_trajectory(stored.task)
        elif option != "payload":  # which is a part of the stored robot
            with pytest.raises(InputError, match=f"give `{option}`"):
                excite.design_trajectory(stored.task)
    assert any(name.endswith("design.json") for name in opened)
    assert not [name for name in opened if "secret" in name]


def test_the_caller_may_name_the_file(folder: Path) -> None:
    world = text_file(folder / "own.yaml", "robot: [{link: l3, from: [0, 0, 0], to: [0, 0, 0.2], radius: 0.03}]\n")
    edit(folder, lambda content: content["task"].update(world="gone.yaml"))
    with pytest.raises(InputError, match=r"only named in this file of results \('gone.yaml'\).* give `world`"):
        excite.load_design(folder).task.limits.imposed()
    assert len(excite.load_design(folder, world=str(world)).task.limits.imposed()) == 1


def test_a_design_is_run_again_without_the_files_that_it_was_made_of(made: Path) -> None:
    for name in ("first", "second"):
        stored = excite.load_design(made / name)
        again = excite.design_trajectory(stored.task)
        np.testing.assert_allclose(again.trajectory.x, stored.trajectory.x, rtol=0, atol=1e-12)
        assert "self-collision" not in {each.limit for each in again.unchecked}


def test_edited_coefficients_are_refused(folder: Path) -> None:
    def change(content: dict[str, Any]) -> None:
        content["trajectory"]["cosine"][0][0] += 1e-9

    edit(folder, change)
    with pytest.raises(InputError, match=r"design.json: the coefficients .*'trajectory'.* design the motion again"):
        excite.load_design(folder)


@pytest.mark.parametrize("name", ["trajectory.csv", "trajectory-0.5.csv"])
def test_an_edited_table_is_refused(folder: Path, name: str) -> None:
    text = (folder / name).read_text(encoding="utf-8")
    (folder / name).write_text(text.replace("0.1", "0.2", 1), encoding="utf-8")
    with pytest.raises(InputError, match=rf"{name} beside it was changed"):
        excite.load_design(folder)
    alone = folder / "alone"
    alone.mkdir()
    shutil.copy(folder / "design.json", alone)
    excite.load_design(alone)


def test_a_design_without_hashes_and_one_written_anew_by_another_tool_are_read(folder: Path) -> None:
    edit(folder, lambda content: None)
    excite.load_design(folder)
    edit(folder, lambda content: content.pop("sha256"))
    excite.load_design(folder)


def test_hashes_of_another_form_are_refused(folder: Path) -> None:
    null, part, outside = {"trajectory": None}, {"trajectory": "0", "files": []}, {"files": {"../x": "0"}}
    for hashes in (3, [], "x", {}, null, part, outside):
        edit(folder, lambda content, hashes=hashes: content.update(sha256=hashes))
        with pytest.raises(InputError, match=r"design\.json"):
            excite.load_design(folder)


def test_files_outside_the_folder_are_not_hashed(folder: Path) -> None:
    outside = {"../secret.csv": "0", str(folder / "trajectory.csv"): "0", "..": "0"}
    edit(folder, lambda content: content["sha256"].update(files=outside))
    text_file(folder.parent / "secret.csv", "x")
    with files_opened() as opened:
        excite.load_design(folder)
    assert not [name for name in opened if name.endswith(".csv")]


def test_the_hash_depends_on_numbers_and_not_on_their_form() -> None:
    assert entry_sha256({"b": [1, 2.5], "a": None}) == entry_sha256({"a": None, "b": [1.0, 2.5]})
    assert entry_sha256({"a": True}) != entry_sha256({"a": 1})
    assert entry_sha256([0.1]) != entry_sha256([np.nextafter(0.1, 1.0)])


def test_names_that_break_lines_and_terminals_are_refused(folder: Path) -> None:
    for name in ("a\x1b[31mb", "a\nb", 3, None, ["a"], "a\u202eb"):
        edit(folder, lambda content, name=name: content["robot"]["description"]["joints"][0].update(name=name))
        with pytest.raises(InputError, match="printable text") as refused:
            excite.load_design(folder)
        assert str(refused.value).isprintable()


TASK = Task("irp6", harmonics=3, starts=2)


def identity(task: Task) -> ProblemIdentity:
    return formulate(load_robot("irp6"), task).identity


@pytest.fixture(scope="module")
def first() -> ProblemIdentity:
    return identity(TASK)


def test_what_a_start_depends_on_changes_the_identity_and_is_named(first: ProblemIdentity) -> None:
    for options, told in (
        ({"seed": 1}, "search.seed 0 -> 1"),
        ({"rate": 50.0}, "output.rate 100.0 -> 50.0"),
        ({"harmonics": 4}, "trajectory.harmonics 3 -> 4"),
        ({"velocity": (0.5,)}, "limits.velocity null -> [0.5]"),
        ({"criterion": ConditionNumber()}, ""),
    ):
        other = identity(TASK.changed(**options))
        assert other.sha256 != first.sha256
        assert told in other.differences(first.content)
    for options in ({"starts": 9}, {"workers": 3}, {"executor": "serial"}, {"speed": (0.5,)}):  # nothing of a start
        assert identity(TASK.changed(**options)).sha256 == first.sha256


def test_untrusted_content_is_not_echoed(first: ProblemIdentity) -> None:
    content = {**first.content, "search": {"seed": "\x1b[31m" * 9, "y" * 900: 1}, "own": 3}
    told = first.differences(content)
    assert told.isprintable()
    assert len(told) < 300


def test_a_part_without_source_is_a_doubt() -> None:
    hidden: dict[str, Any] = {"__name__": "nowhere"}
    exec("from excite import ConditionNumber\nclass Mine(ConditionNumber): pass", hidden)
    found = identity(TASK.changed(criterion=hidden["Mine"]()))
    assert found.sha256 is None
    assert found.doubt == "the source of Mine is not accessible"


@dataclasses.dataclass
class Part:
    size: float
    table: Any = None


class Plain:
    def __init__(self, size: float) -> None:
        self.size = size

    @cached_property
    def double(self) -> float:
        return 2 * self.size


class Cyclic:
    def __init__(self) -> None:
        self.me = self


OTHERS = (
    (1, 2), (1.0, 1.0 + 2**-52), (float("nan"), float("inf")), ("1", 1), (b"a", b"b"), (Path("a"), Path("b")),
    (np.arange(3), np.arange(4)), (np.arange(100), np.arange(100) + 1), (np.arange(100), np.arange(100.0)),
    (Part(1.0), Part(2.0)), (Plain(1.0), Plain(2.0)), (Part(1.0), Plain(1.0)), (Part, Plain),
    ({"a": 1}, {"a": 2}), ((1, 2), (2, 1)),
)  # fmt: skip


def test_other_values_are_others_and_what_is_computed_from_the_rest_does_not_count() -> None:
    for a, b in OTHERS:
        assert plain_value(a) == plain_value(a)
        assert plain_value(a) != plain_value(b)
    one, other = Plain(1.0), Plain(1.0)
    assert one.double == 2.0
    assert plain_value(one) == plain_value(other)
    assert plain_value({"b", "a", "c"}) == plain_value({"c", "b", "a"})


@pytest.mark.parametrize("value", [Cyclic(), (each for each in ())])
def test_what_cannot_be_compared_is_said(value: Any) -> None:
    with pytest.raises(NotComparable):
        plain_value(value)
