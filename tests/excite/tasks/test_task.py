"""A task and its seven parts: one place for every option, strict values, the same names everywhere."""

import dataclasses
import importlib.util
import pickle
from pathlib import Path

import click
import numpy as np
import pytest

import excite
from excite.cli.design_command import command
from excite.design.task_file import read_task_file, task_content, task_from_options
from excite.registry import OwnPart
from excite.tasks.criteria import Trace
from excite.tasks.option import options_of
from excite.tasks.task import PARTS, PLACE, Task
from regressors.errors import InputError, UnknownName

ROOT = Path(__file__).resolve().parents[3]


def test_an_option_has_one_place() -> None:
    names = [field.name for part in PARTS.values() for field in dataclasses.fields(part)]
    assert len(names) == len(set(names)) == len(PLACE)
    assert max(len(dataclasses.fields(part)) for part in PARTS.values()) <= 21


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


def test_old_names_are_read_with_a_warning() -> None:
    with pytest.warns(DeprecationWarning, match=r"task\.period is now task\.trajectory\.period"):
        assert Task("irp6", period=4.0).period == 4.0
    with pytest.raises(AttributeError, match="no attribute 'wheels'"):
        Task("irp6").wheels  # noqa: B018
    with pytest.raises(UnknownName, match="no option of a task named 'wheels'"):
        Task("irp6", wheels=3)


BAD = [
    ({"period": True}, "period: expected a number, given True"),
    ({"period": "8"}, "period: expected a number, given '8'"),
    ({"harmonics": 2.5}, "harmonics: expected a whole number, or auto, given 2.5"),
    ({"harmonics": True}, "harmonics: expected a whole number, or auto, given True"),
    ({"friction": 1.5}, "friction: expected all, none, or names or numbers of drives, given 1.5"),
    ({"noise": [0.1, True]}, "noise: expected a number, or a list of numbers, given [0.1, True]"),
    ({"noise": "0.1"}, "noise: expected a number, or a list of numbers, given '0.1'"),
    ({"position": [1.0, 2.0]}, "position: expected a list of pairs [lower, upper], given [1.0, 2.0]"),
    ({"position": [[1.0]]}, "position: expected a list of pairs [lower, upper], given [[1.0]]"),
    ({"sensor_xyz": 0.1}, "sensor_xyz: expected three numbers, given 0.1"),
    ({"joints": 3}, "joints: expected a list of names, given 3"),
    ({"joints": [1.5]}, "joints: expected a list of names, given [1.5]"),
    ({"seed": None}, "seed: expected a whole number, given nothing"),
    ({"via": [[0.0], "a"]}, "via: expected a list of poses, given [[0.0], 'a']"),
    ({"criterion": "mine"}, "no criterion named 'mine'; available: condition, frobenius, sigma-min, logdet, trace"),
    ({"window": "wide"}, "no window named 'wide'"),
    ({"joints": ("1",), "drives": ("1",)}, "`joints` and `drives` exclude each other"),
]


@pytest.mark.parametrize(("options", "message"), BAD, ids=[str(options) for options, _ in BAD])
def test_values_of_another_type_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as refused:
        Task("irp6", **options)
    assert message in str(refused.value)


BAD_FILES = [
    ("period: true\n", "period (line 1): "),
    ("period: 1_0\n", "period (line 1): '1_0' is not a number: write it without underscores"),
    ("harmonics: 5.5\n", "harmonics (line 1): "),
    ("friction: 1.5\n", "friction (line 1): "),
    ("noise: [0.5, yes please]\n", "noise[2] (line 1): "),
    ("limits: {velocity: true}\n", "limits.velocity"),
    ("limits: {speed: 1}\n", "limits.speed (line 1): "),
    ("starts: '12'\n", "starts (line 1): "),
]


@pytest.mark.parametrize(("text", "message"), BAD_FILES, ids=[text.strip() for text, _ in BAD_FILES])
def test_task_files_are_strict(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "task.yaml").write_text(text)
    with pytest.raises(InputError) as refused:
        read_task_file(tmp_path / "task.yaml")
    assert message in str(refused.value)


def test_every_option_is_a_flag_a_key_and_a_row_of_the_page(tmp_path: Path) -> None:
    flags = {parameter.name for parameter in command.params if isinstance(parameter, click.Option)}
    described = [option for part in PARTS.values() for option in options_of(part)]
    assert {field.name for field, option in described if not option.hidden} <= flags
    content = task_content(Task("irp6"))
    assert {field.name for field, option in described if not option.late} <= set(content) | set(content["limits"])
    spec = importlib.util.spec_from_file_location("list_task_options", ROOT / "docs" / "list_task_options.py")
    assert spec is not None
    assert spec.loader is not None
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    assert (ROOT / "docs" / "task_options.md").read_text() == page.text()  # docs/list_task_options.py writes it anew


def test_defaults_are_stated_once() -> None:
    stated = {parameter.name: parameter.default for parameter in command.params if isinstance(parameter, click.Option)}
    for part in PARTS.values():
        for field, option in options_of(part):
            if option.kind in ("number", "integer", "flag") and field.default is not None:
                assert stated[field.name] == field.default


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
    assert task.trajectory.period == 6.0
    assert task.trajectory.harmonics == 4
    assert isinstance(task.objective.criterion, Trace)
    assert task_content(task)["criterion"] == "trace"
    assert task_content(task)["trajectory"] == "fourier"
    np.testing.assert_equal(task.trajectory.family().duration, 6.0)


def test_a_task_of_another_robot_is_refused() -> None:
    panda = excite.load_robot("panda")
    with (
        pytest.warns(DeprecationWarning, match=r"design_trajectory\(robot, task\) is now design_trajectory\(task\)"),
        pytest.raises(InputError, match="the task is for irp6, not for panda"),
    ):
        excite.design_trajectory(panda, Task("irp6"))


def test_angles_as_printed_are_an_option_of_a_task(tmp_path: Path) -> None:
    """What is stored without saying so was made of the angles as printed."""
    (tmp_path / "task.yaml").write_text("robot: arm.urdf\nsnap_angles: false\n")
    options = read_task_file(tmp_path / "task.yaml")
    task = task_from_options(options)
    assert (task.snap_angles, task.changed(period=20).snap_angles) == (False, False)
    assert task_content(task)["snap_angles"] is False
    content = {name: value for name, value in task_content(Task("arm.urdf")).items() if name != "snap_angles"}
    assert task_from_options(content).snap_angles is True
    assert task_from_options(content, stored=True).snap_angles is False


def test_expanding_a_file_is_an_option_of_a_task(tmp_path: Path) -> None:
    """It is written where it is asked for, and not asked for by what is stored without it."""
    (tmp_path / "task.yaml").write_text("robot: arm.urdf\nxacro: true\n")
    task = task_from_options(read_task_file(tmp_path / "task.yaml"))
    assert (task.xacro, task.changed(period=20).xacro) == (True, True)
    assert task_from_options(task_content(task), stored=True).xacro is True
    assert "xacro" not in task_content(Task("arm.urdf"))
    with pytest.raises(InputError, match="`xacro=True` says how to read the file of a robot, but no file is named"):
        excite.identify(excite.load_robot("irp6"), [], xacro=True)
