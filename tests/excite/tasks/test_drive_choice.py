"""Further friction parameters of some drives: names and numbers, stored tasks, files and the command line."""

from __future__ import annotations

import json
from pathlib import Path

import click
import pytest

from excite.cli.design_command import command
from excite.cli.option_types import DriveNames
from excite.files.task_file import read_task_file, task_content, task_from_options
from excite.information.friction_notes import left_out_notes
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.friction.curves import CoulombViscous, FrictionCurves
from regressors.readers.library import built_in
from regressors.robot.locked_joints import with_locked_joints

FURTHER = ("load_share", "root_friction", "asymmetric_friction", "stribeck", "stribeck_speed", "carried")
CHOICES = {
    "none": (False, ()),
    "all": (True, (1, 2, 3)),
    "[1, z3]": (("1", "z3"), (1, 3)),
    "[1, z5]": (("1", "z5"), (1,)),  # joint 5 is locked in the form of three axes
    "2": (("2",), (2,)),
    "false": (False, ()),
}


@pytest.mark.parametrize("text", CHOICES)
def test_drives_are_chosen_by_name_or_number(text: str, tmp_path: Path) -> None:
    (tmp_path / "task.yaml").write_text(f"robot: irp6\nroot_friction: {text}\noffset: {text}\n")
    task = task_from_options(read_task_file(tmp_path / "task.yaml"))
    chosen, numbers = CHOICES[text]
    assert (task.model.root_friction, task.model.offset) == (chosen, chosen)
    columns = target_of(built_in("irp6"), task).model.columns
    for kind in ("root", "offset"):
        assert tuple(c.owner for c in columns if c.kind == kind) == numbers
    typed = "none" if text == "false" else text.strip("[]").replace(" ", "")
    assert DriveNames().convert(typed, None, None) == chosen


def test_a_stored_task_has_new_keys_only_where_they_differ() -> None:
    assert not set(FURTHER) & set(task_content(Task("irp6")))
    assert task_content(Task("irp6"))["offset"] is False
    values = {
        "load_share": ("1", "z2"),
        "stribeck": True,
        "stribeck_speed": 0.3,
        "offset": ("2",),
        "carried": {"m1": -1.5},
    }
    task = Task("irp6", **values)
    content = json.loads(json.dumps(task_content(task)))
    assert set(FURTHER) & set(content) == {"load_share", "stribeck", "stribeck_speed", "carried"}
    again = task_from_options(content, stored=True)
    assert again.model == task.model
    assert {name: getattr(again.model, name) for name in values} == values


def test_what_is_carried_is_no_option_of_the_command_line() -> None:
    names = {parameter.name for parameter in command.params}
    assert {"load_share", "root_friction", "asymmetric_friction", "stribeck", "stribeck_speed"} <= names
    assert "carried" not in names


BAD = [
    ({"load_share": 1.5}, "load_share: expected all, none, or names or numbers of drives, given 1.5"),
    ({"root_friction": [True]}, "root_friction: expected all, none, or names or numbers of drives, given [True]"),
    ({"stribeck": {"1": 2}}, "stribeck: expected all, none, or names or numbers of drives, given {'1': 2}"),
    ({"stribeck_speed": 0.0}, "`stribeck_speed` must be a number from 1e-09 to 1000000 rad/s or m/s, given 0"),
    ({"carried": {"m1": "a"}}, "carried: expected standard parameters, each with a finite number"),
    ({"carried": {"m1": float("nan")}}, "carried: expected standard parameters, each with a finite number"),
]


@pytest.mark.parametrize(("options", "message"), BAD, ids=[str(options) for options, _ in BAD])
def test_other_values_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as refused:
        Task("irp6", **options)
    assert message in str(refused.value)


def test_a_drive_that_the_robot_lacks_is_refused_with_those_it_has() -> None:
    with pytest.raises(InputError, match=r"no drive named 'z9'; available: 1 \(z1\)"):
        target_of(built_in("irp6"), Task("irp6", load_share=("z9",)))
    with pytest.raises(click.BadParameter, match="such as 1,3"):
        DriveNames().convert("1,,3", None, None)


def test_known_drives_have_none_of_the_further_columns_either() -> None:
    known = FrictionCurves({"z1": CoulombViscous(1.0)})
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    task = Task("irp6", friction=("1", "z2"), offset=True, stribeck=("1",), friction_curves=known)
    terms = task.model.terms_of(robot)
    assert (terms.coulomb, terms.viscous, terms.offset, terms.stribeck) == ((2,), (2,), (2, 3), False)
    notes = left_out_notes(task.model, target_of(built_in("irp6"), task), known)
    assert notes == ("stribeck columns are left out: friction is known",)
