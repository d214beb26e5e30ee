"""A task and its seven parts, options of models among them: one place for every option, strict values."""

from __future__ import annotations

import dataclasses
import json
import pickle
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from commands import module_of
from refused import refusal
from written_files import saved, text_file

import excite
from excite.cli.design_commands import design
from excite.cli.option_types import ALL_OR_NONE, Names
from excite.design.task_file import read_task_file, task_content, task_from_options
from excite.information.target import left_out_notes, target_of
from excite.registry import OwnPart
from excite.tasks.criteria import Trace
from excite.tasks.model_options import options_of_model
from excite.tasks.option import options_of
from excite.tasks.task import PARTS, PLACE, Task
from regressors.errors import InputError, UnknownName
from regressors.models.load import LoadIntegralModel, Sensor
from regressors.models.model import RegressorModel
from regressors.models.windows import Window
from regressors.readers.library import built_in
from regressors.robot.columns import Terms
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.locked_joints import with_locked_joints

# A task and its seven parts: one place for every option, strict values, the same names everywhere.


ROOT = Path(__file__).resolve().parents[3]


def test_an_option_has_one_place() -> None:
    names = [field.name for part in PARTS.values() for field in dataclasses.fields(part)]
    assert len(names) == len(set(names)) == len(PLACE)
    assert max(len(dataclasses.fields(part)) for part in PARTS.values()) <= 22


def test_motions_for_servos_are_quick_and_of_much_information_where_nothing_else_is_asked_for() -> None:
    def chosen(task: Task) -> tuple[object, object]:
        return task.objective.criterion, task.trajectory.harmonics

    plain, robot = Task("so101", model="servo"), built_in("so101")
    assert chosen(plain) == ("logdet", 15)
    assert plain.limits.applied(robot).limits.velocity == pytest.approx(0.4 * robot.limits.velocity)
    assert Task("so101", model="servo", velocity=(2.0,)).limits.applied(robot).limits.velocity == pytest.approx(2.0)
    assert Task("so101").limits.applied(robot).limits == robot.limits
    assert Task("so101").changed(model="servo", period=8).changed(starts=3) == plain.changed(period=8, starts=3)
    assert chosen(plain.changed(harmonics=5)) == ("logdet", 5)
    given = Task("so101", model="servo", criterion="condition", harmonics=5)
    assert chosen(given) == chosen(given.changed(starts=3)) == chosen(Task("so101")) == ("condition", 5)
    older = task_from_options(task_content(given.changed(velocity_scaling=1.0)), stored=True)
    assert older.limits.velocity_scaling == 1.0
    assert task_from_options(task_content(given), stored=True) == given


def test_options_and_parts_say_the_same() -> None:
    flat = Task("irp6", period=8, starts=3, model="energy", joints=["1", 3], noise=0.5)
    parts = Task(
        "irp6",
        trajectory=excite.TrajectoryChoice(period=8.0),
        search=excite.Search(starts=3),
        model=excite.ModelChoice(model="energy", joints=("1", "3")),
        objective=excite.Objective(noise=(0.5,)),
    )
    assert flat == parts
    assert flat.changed(model="differential").model.joints == ("1", "3")  # other options of the part stay
    assert flat.changed(search=excite.Search(seed=4)).search == excite.Search(seed=4)
    assert flat.changed(robot="panda").robot_name == "panda"
    assert pickle.loads(pickle.dumps(flat)) == flat
    with pytest.raises(UnknownName, match="no option of a task named 'wheels'"):
        Task("irp6", wheels=3)


BAD = [
    ({"period": True}, "period: expected a number, given True"),
    ({"harmonics": 2.5}, "harmonics: expected a whole number, or auto, given 2.5"),
    ({"friction": 1.5}, "friction: expected all, none, or names or numbers of drives, given 1.5"),
    ({"noise": [0.1, True]}, "noise: expected a number, or a list of numbers, given [0.1, True]"),
    ({"position": [1.0, 2.0]}, "position: expected a list of pairs [lower, upper], given [1.0, 2.0]"),
    ({"sensor_xyz": 0.1}, "sensor_xyz: expected three numbers, given 0.1"),
    ({"joints": 3}, "joints: expected a list of names, given 3"),
    ({"joints": [["q1"]]}, "joints: expected a list of names, given [['q1']]"),
    ({"world": 3}, "world: expected the name of a file, or its content, given 3"),
    ({"support": [1]}, "support: expected the name of a file, or its content, given [1]"),
    ({"seed": None}, "seed: expected a whole number, given nothing"),
    ({"via": [[0.0], "a"]}, "via: expected a list of poses, given [[0.0], 'a']"),
    ({"criterion": "mine"}, "no criterion named 'mine'; available: condition, frobenius, sigma-min, logdet, trace"),
    ({"window": "wide"}, "no window named 'wide'"),
    ({"joints": ("1",), "drives": ("1",)}, "`joints` and `drives` exclude each other"),
    ({"root_friction": [True]}, "root_friction: expected all, none, or names or numbers of drives, given [True]"),
    ({"stribeck": {"1": 2}}, "stribeck: expected all, none, or names or numbers of drives, given {'1': 2}"),
    ({"stribeck_speed": 0.0}, "`stribeck_speed` must be a number from 1e-09 to 1000000 rad/s or m/s, given 0"),
    ({"carried": {"m1": "a"}}, "carried: expected standard parameters, each with a finite number"),
    ({"carried": {"m1": float("nan")}}, "carried: expected standard parameters, each with a finite number"),
]


@pytest.mark.parametrize(("options", "message"), BAD, ids=[str(options) for options, _ in BAD])
def test_values_of_another_type_are_refused(options: dict[str, object], message: str) -> None:
    assert message in refusal(Task, "irp6", **options)


def test_task_files_are_strict(tmp_path: Path) -> None:
    for text, message in (
        ("period: true", "period (line 1): "),
        ("period: 1_0", "period (line 1): '1_0' is not a number: write it without underscores"),
        ("noise: [0.5, yes please]", "noise (line 1): should be a number, or a list of numbers, given [0.5, 'yes"),
        ("friction: 1.5", "friction (line 1): "),
        ("limits: {velocity: true}", "limits.velocity"),
        ("limits: {speed: 1}", "limits.speed (line 1): "),
    ):
        assert message in refusal(read_task_file, text_file(tmp_path / "task.yaml", text))


def test_every_option_is_a_flag_with_its_default_a_key_and_a_row_of_the_page() -> None:
    flags = {parameter.name: parameter.default for parameter in design.params if isinstance(parameter, click.Option)}
    described = [option for part in PARTS.values() for option in options_of(part)]
    assert {field.name for field, option in described if not option.hidden} <= flags.keys()
    assert set(FURTHER) - flags.keys() == {"carried"}
    for field, option in described:
        if option.kind in ("number", "integer", "flag") and field.default is not None and not option.hidden:
            assert flags[field.name] == field.default
    content = task_content(Task("irp6"))
    assert {field.name for field, option in described if not option.late} <= set(content) | set(content["limits"])
    page = module_of(ROOT / "docs" / "list_task_options.py")
    assert (ROOT / "docs" / "task_options.md").read_text() == page.text()  # docs/list_task_options.py writes it anew


def test_what_a_result_names_is_not_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("raise RuntimeError('imported')\n")
    content = {**task_content(Task("irp6")), "criterion": "mine:Mine", "solver": "mine:Solver"}
    task = task_from_options(content, stored=True)
    assert task.objective.criterion == OwnPart("criterion", "mine:Mine")
    assert task_content(task)["criterion"] == "mine:Mine"
    given = task_from_options(content, stored=True, criterion="trace")
    assert given.objective.criterion == "trace"


def test_objects_are_kept_and_named() -> None:
    task = Task("irp6", criterion=Trace(), trajectory=excite.Fourier(6.0, 4), solver="sqp")
    assert (task.trajectory.period, task.trajectory.harmonics) == (6.0, 4)
    assert isinstance(task.objective.criterion, Trace)
    assert (task_content(task)["criterion"], task_content(task)["trajectory"]) == ("trace", "fourier")
    assert task.trajectory.family().duration == 6.0


def test_how_a_file_is_read_is_an_option_of_a_task(tmp_path: Path) -> None:
    """What is stored without saying so was made of the angles as printed, and not expanded."""
    file = text_file(tmp_path / "task.yaml", "robot: arm.urdf\nsnap_angles: false\nxacro: true")
    task = task_from_options(read_task_file(file))
    for one in (task, task.changed(period=20), task_from_options(task_content(task), stored=True)):
        assert (one.snap_angles, one.xacro) == (False, True)
    content = task_content(Task("arm.urdf"))
    assert content.pop("snap_angles") is True
    assert "xacro" not in content
    for stored in (False, True):
        one = task_from_options(content, stored=stored)
        assert (one.snap_angles, one.xacro) == (not stored, False)
    with pytest.raises(InputError, match="`xacro=True` says how to read the file of a robot, but no file is named"):
        excite.identify(excite.load_robot("irp6"), [], xacro=True)


# Further friction parameters of some drives, and options of model objects, in tasks, files and the command line.


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
    file = text_file(tmp_path / "task.yaml", f"robot: irp6\nroot_friction: {text}\noffset: {text}")
    task = task_from_options(read_task_file(file))
    chosen, numbers = CHOICES[text]
    assert (task.model.root_friction, task.model.offset) == (chosen, chosen)
    columns = target_of(built_in("irp6"), task).model.columns
    for kind in ("root", "offset"):
        assert tuple(c.owner for c in columns if c.kind == kind) == numbers
    typed = "none" if text == "false" else text.strip("[]").replace(" ", "")
    assert Names(ALL_OR_NONE).convert(typed, None, None) == chosen


def test_a_stored_task_has_new_keys_only_where_they_differ() -> None:
    assert not set(FURTHER) & set(task_content(Task("irp6")))
    assert task_content(Task("irp6"))["offset"] is False
    new = {"load_share": ("1", "z2"), "stribeck": True, "stribeck_speed": 0.3, "carried": {"m1": -1.5}}
    values = {**new, "offset": ("2",)}
    task = Task("irp6", **values)
    content = json.loads(json.dumps(task_content(task)))
    assert set(FURTHER) & set(content) == set(new)
    again = task_from_options(content, stored=True)
    assert again.model == task.model
    assert {name: getattr(again.model, name) for name in values} == values


def test_a_drive_that_the_robot_lacks_is_refused_with_those_it_has() -> None:
    with pytest.raises(InputError, match=r"no drive named 'z9'; available: 1 \(z1\)"):
        target_of(built_in("irp6"), Task("irp6", load_share=("z9",)))
    with pytest.raises(click.BadParameter, match="such as 1,3"):
        Names(ALL_OR_NONE).convert("1,,3", None, None)


def test_known_drives_have_none_of_the_further_columns_either() -> None:
    known = FrictionCurves({"z1": CoulombViscous(1.0)})
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    task = Task("irp6", friction=("1", "z2"), offset=True, stribeck=("1",), friction_curves=known)
    terms = task.model.terms_of(robot)
    assert (terms.coulomb, terms.viscous, terms.offset, terms.stribeck) == ((2,), (2,), (2, 3), False)
    notes = left_out_notes(task.model, target_of(built_in("irp6"), task), known)
    assert notes == ("stribeck columns are left out: friction is known",)


IRP6 = built_in("irp6")
SENSOR = Sensor("2", rotation_from_rpy((0.3, -0.4, 2.0)), np.array([0.1, 0.0, -0.2]), ("fx", "nz"))
MODELS: dict[str, RegressorModel] = {
    "defaults": excite.DifferentialModel(IRP6),
    "terms": excite.DifferentialModel(IRP6, Terms(rotor=False, offset=(1, 3), reflected=False, stribeck=True)),
    "no friction": excite.DifferentialModel(IRP6, Terms.inertial_only()),
    "window": excite.EnergyModel(IRP6, window=Window("short", 0.02)),
    "long windows": LoadIntegralModel(IRP6, SENSOR, Window("long")),
    "sensor": excite.LoadModel(IRP6, SENSOR),
}
UNTOLD: dict[str, RegressorModel] = {
    "two kinds of friction": excite.DifferentialModel(IRP6, Terms(viscous=False)),
    "smooth signs": excite.DifferentialModel(IRP6, sign_width=0.1),
    "steps of windows": excite.EnergyModel(IRP6, window=Window("short", 0.02, 0.01)),
}


def same(found: Any, expected: Any) -> bool:
    if isinstance(expected, Sensor):
        told = (found.link, tuple(found.equations)) == (expected.link, tuple(expected.equations))
        close = np.allclose(found.rotation, expected.rotation, rtol=0, atol=1e-12)
        return bool(told and close and np.allclose(found.translation, expected.translation, rtol=0, atol=0))
    return bool(found == expected)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_the_task_in_a_file_builds_the_same_model(model: RegressorModel) -> None:
    task = excite.Task(IRP6, model=model)
    again = task_from_options(json.loads(json.dumps(task_content(task))))
    built = again.model.built(IRP6)
    assert type(built) is type(model)
    assert built.names == model.names
    for name, value in model.options.items():
        assert same(built.options[name], value), name


@pytest.mark.parametrize("model", UNTOLD.values(), ids=UNTOLD)
def test_what_a_task_cannot_say_is_named_by_its_class(model: RegressorModel) -> None:
    assert options_of_model(model) is None
    stored = task_content(excite.Task(IRP6, model=model))["model"]
    assert stored == f"{type(model).__module__}:{type(model).__name__}"


@pytest.mark.slow
def test_a_loaded_design_has_the_columns_that_it_was_made_for(tmp_path: Path) -> None:
    search = {"starts": 1, "harmonics": 3, "executor": "serial"}
    design = excite.design_trajectory(MODELS["terms"], **search)
    assert excite.load_design(saved(tmp_path / "told", design)).task.model.built(IRP6).names == MODELS["terms"].names
    other = UNTOLD["two kinds of friction"]
    excite.design_trajectory(other, **search).save(tmp_path / "untold")
    assert isinstance(excite.load_design(tmp_path / "untold").task.model.model, OwnPart)
    given = excite.load_design(tmp_path / "untold", model=other)
    assert given.task.model.built(IRP6).names == other.names
