"""Constraints by name and as objects: what a file keeps of them, and built-in ones that need numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import run

import excite
from excite.registry import OwnPart
from regressors.errors import InputError

TASK = excite.Task("irp6", harmonics=2, friction=False, starts=1, executor="serial")


def test_a_constraint_by_name_is_found_again(tmp_path: Path) -> None:
    design = excite.design_trajectory(TASK.changed(constraints=("torque",)))
    design.save(tmp_path / "design")
    stored = excite.load_design(tmp_path / "design")
    assert stored.task == design.task
    again = excite.design_trajectory(stored.task)
    assert again.trajectory.x.tobytes() == design.trajectory.x.tobytes()
    assert "drive z1 torque" in {use.label for use in again.limits}


def test_numbers_of_an_object_are_not_in_the_file_so_it_is_given_again(tmp_path: Path) -> None:
    limit = excite.TorqueLimit(margin=0.2)
    design = excite.design_trajectory(TASK.changed(constraints=(limit,)))
    design.save(tmp_path / "design")
    place = "constraints.torque:TorqueLimit"
    stored = excite.load_design(tmp_path / "design")
    (named,) = stored.task.limits.constraints
    assert isinstance(named, OwnPart)
    assert named.name == place
    with pytest.raises(InputError, match=r"not built in.*such as constraints=\[TorqueLimit\]"):
        excite.design_trajectory(stored.task)
    assert excite.load_design(tmp_path / "design", constraints=[limit]).task == design.task


@pytest.mark.slow
@pytest.mark.parametrize(("name", "missing"), [("tool-box", "lower, upper"), ("tool-speed", "speed")])
def test_a_built_in_limit_that_needs_numbers_says_so(name: str, missing: str, tmp_path: Path) -> None:
    ended = run("design", "irp6", "--constraint", name, "--out", "out", cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert f"constraint {name} needs its {missing}: in Python give an object with them" in ended.stderr
    assert list(tmp_path.iterdir()) == []
