"""``excite design``: the files of one command, repeatability, joints, task files, limits, and folders in use."""

import json
from pathlib import Path

import numpy as np
import pytest
from commands import QUICK, SCRIPT, Here, content_of, designed, files_below, run, table_of
from designed import PLANAR
from ruamel.yaml import YAML

import excite
from excite.tasks.robot_of_task import robot_and_task
from regressors.errors import InputError

CHANNELS = ("position", "velocity", "acceleration")
FIGURES = {"motion.png", "phase.png", "spectrum.png", "workspace.png", "convergence.png"}


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Folder and terminal output of one design with a pool of one process."""
    cwd = tmp_path_factory.mktemp("first")
    ended = run("design", "irp6", "--starts", "2", "--harmonics", "3", "--workers", "1", "-v", "--out", "a/b", cwd=cwd)
    assert ended.returncode == 0, ended.stderr
    return cwd / "a" / "b", ended.stdout


def test_one_command_writes_all_files_and_tells_what_matters(first: tuple[Path, str]) -> None:
    folder, shown = first
    starts = {"starts", "starts/start-0000.json", "starts/start-0001.json"}
    assert files_below(folder) == {"design.json", "trajectory.csv", "manifest.json", *FIGURES, *starts}
    assert files_below(folder.parents[1]) == {"a", "a/b", *(f"a/b/{name}" for name in files_below(folder))}
    for name in FIGURES:
        assert (folder / name).read_bytes().startswith(b"\x89PNG\r\n")
    content = content_of(folder)
    assert f"condition number {content['criteria']['condition_number']:.4g}" in shown
    assert "q1, q2, q3 move, 13 base parameters; 10 s, 3 harmonics; minimised: " in shown
    assert "drive z1 velocity" in shown  # binds
    assert all(parameter["name"] in shown for parameter in content["predicted"]["parameters"])
    assert f"written to {Path('a', 'b')}: " in shown
    assert "\x1b" not in shown  # no terminal, no colours
    stated = [content[name] for name in ("schema", "feasible", "interrupted")]
    assert (stated, content["robot"]["name"]) == (["excite.design/1", True, False], "irp6")
    assert (content["task"]["seed"], content["task"]["starts"], content["task"]["harmonics"]) == (0, 2, 3)
    assert set(content["criteria"]) == set(content["conventions"])
    assert all(limit["holds"] for limit in content["limits"])
    assert [parameter["name"] for parameter in content["predicted"]["parameters"]] == content["base"]["columns"]
    values = {start["index"]: start["value"] for start in content["solver"]["starts"]}
    best = content["solver"]["best_start"]
    assert values[best] == min(values.values())
    assert values[best] == pytest.approx(content["criteria"]["condition_number"], rel=1e-2)
    assert content["provenance"]["seed"] == 0


def same_motion(a: Path, b: Path) -> bool:
    coefficients = [content_of(folder)["trajectory"] for folder in (a, b)]
    same = (a / "trajectory.csv").read_bytes() == (b / "trajectory.csv").read_bytes()
    assert same == (coefficients[0] == coefficients[1])
    return same


@pytest.mark.slow
def test_same_seed_gives_the_same_bytes_however_it_is_run(first: tuple[Path, str], tmp_path: Path) -> None:
    two = designed("irp6", "--starts", "2", "--harmonics", "3", "--workers", "2", cwd=tmp_path, out="two")
    serial = designed("irp6", *QUICK, cwd=tmp_path, out="serial", command=SCRIPT)
    assert same_motion(first[0], two)
    assert same_motion(first[0], serial)
    assert not same_motion(first[0], designed("irp6", *QUICK, "--seed", "1", cwd=tmp_path, out="other"))


@pytest.mark.slow
def test_the_task_in_a_design_gives_the_design_again(first: tuple[Path, str], here: Here) -> None:
    task = content_of(first[0])["task"]
    YAML().dump(task, here.cwd / "again.yaml")
    (here.cwd / "again.json.yaml").write_text(json.dumps(task))  # JSON is YAML
    assert same_motion(first[0], here.designed("irp6", "--task", "again.yaml", out="a"))
    assert same_motion(first[0], here.designed("irp6", "--task", "again.json.yaml", out="b"))


@pytest.mark.slow
def test_json_on_stdout_and_progress_on_stderr(here: Here) -> None:
    ended = here.run("design", "irp6", *QUICK, "--out", "o", "--json", status=0)
    assert "excite: note: torques, computed from the known masses and friction, stay 10 % below" in ended.stderr
    assert "start 1 of 2: best so far " in ended.stderr
    shown = json.loads(ended.stdout)
    written = content_of(here.cwd / "o")
    assert shown.pop("out") == "o"
    assert shown.pop("verdict").startswith("Design within all 30 checked limits; condition number ")
    assert shown == {name: written[name] for name in shown}
    assert {"feasible", "criteria", "limits", "task", "trajectory", "predicted", "base"} <= set(shown)


@pytest.mark.slow
def test_only_the_named_joints_move_and_limits_typed_hold(here: Here) -> None:
    rates = ("--velocity-limit", "0.3", "--acceleration-limit", "0.5,0.6,0.7,0.8,0.9", "--jerk-limit", "1")
    ranges = ("--position-limit", "-1:1,-0.5:0.25,-0.3:0.2,0.4:0.9,-1:-0.25")
    folder = here.designed("irp6", "--joints", "q3, 2", *rates, *ranges, "--harmonics", "3", "--starts", "1")
    limits = {limit["label"]: limit for limit in content_of(folder)["limits"]}
    for k, acceleration in ((2, 0.6), (3, 0.7)):
        for quantity, bound in (("velocity", 0.3), ("acceleration", acceleration), ("jerk", 1.0)):
            limit = limits[f"joint q{k} {quantity}"]
            assert (limit["holds"], abs(limit["bound"])) == (True, bound)
            assert abs(limit["extreme"]) <= bound * (1 + 1e-9)
    header, table = table_of(folder / "trajectory.csv")
    q, dq, ddq = (table[:, [header.index(f"q{k}.{what}") for k in range(1, 6)]] for what in CHANNELS)
    for moves in (np.ptp(q, axis=0) > 0.0, np.any(dq, axis=0), np.any(ddq, axis=0)):
        assert moves.tolist() == [False, True, True, False, False]
    assert np.all((q >= [-1.0, -0.5, -0.3, 0.4, -0.25]) & (q <= [1.0, 0.25, 0.2, 0.4, -0.25]))


@pytest.mark.slow
def test_options_typed_win_over_the_task_file(here: Here) -> None:
    (here.cwd / "task.yaml").write_text(
        "harmonics: 3\nstarts: 7\nseed: 5\nfriction: false\nexecutor: serial\nnoise: 2\nperiod: 12.0\n"
        "joints: [1, q2]\nlimits: {velocity: 0.5, acceleration: [1, 1, 1, 1, 1]}\n"
    )
    typed = ("--starts", "1", "--seed", "0", "--acceleration-limit", "0.75")
    folder = here.designed("irp6", "--task", "task.yaml", *typed)
    task = content_of(folder)["task"]
    given = {"harmonics": 3, "starts": 1, "seed": 0, "friction": False, "executor": "serial", "period": 12.0}
    assert {name: task[name] for name in given} == given
    assert task["joints"] == ["1", "q2"]
    assert task["noise"] == [2.0]
    assert task["limits"] == {"position": None, "velocity": [0.5], "acceleration": [0.75], "jerk": None}
    assert task["rotor"] is True  # a default that neither says


ROUNDED = PLANAR.replace("1.5707963267948966", "1.5708")


@pytest.mark.slow
def test_a_urdf_goes_from_its_design_to_its_result(here: Here) -> None:
    """Notes of what was assumed, brackets in names, and the ends of the chain are kept."""
    gripper = '<joint name="gripper" type="revolute"><parent link="fore"/><child link="jaw"/></joint>'
    text = ROUNDED.replace("</robot>", f'<link name="jaw"/>{gripper}</robot>')
    (here.cwd / "arm.urdf").write_text(text.replace('"j2"', '"[red]elbow[/red][/]"'))
    ends = ("--base-link", "base")
    ended = here.run("design", "arm.urdf", *QUICK, *ends, "--base", "pivoted", "--out", "o[/b]", status=0)
    said = [line.removeprefix("excite: note: ") for line in ended.stderr.splitlines()]
    assert said[:2] == [
        "joint gripper: moves a gripper: held at zero and left out; --tip jaw includes it",
        "joint 'j1': took 1.5708 for pi/2; --no-snap-angles keeps the printed digits",
    ]
    none = "are not limited: none is stated; give one with --acceleration-limit"
    assert f"accelerations of j1, [red]elbow[/red][/] {none}" in said
    assert "[red]elbow[/red][/] position" in ended.stdout
    assert "written to o[/b]: " in ended.stdout
    content = content_of(here.cwd / "o[/b]")
    assert "joint 'j1': took 1.5708 for pi/2; `snap_angles=False` keeps the printed digits" in content["notes"]
    task = content["task"]
    assert (task["base"], task["base_link"], task["snap_angles"]) == ("pivoted", "base", True)
    assert here.run("simulate", "o[/b]", "--torque-noise", "0.1", "--out", "run.csv").returncode == 0
    for typed in (ends, ("--design", "o[/b]")):
        here.run("identify", "arm.urdf", "run.csv", *typed, "--out", "r", "--force", status=0)
        task = json.loads((here.cwd / "r" / "result.json").read_text())["task"]
        assert (task["robot"], task["base_link"]) == ("arm.urdf", "base")
    with pytest.raises(InputError, match="`base_link` and `tip` are the ends of what moves where"):
        excite.identify(excite.load_robot("irp6"), [], tip="hand")


@pytest.mark.slow
def test_a_design_of_printed_angles_is_identified_with_them(here: Here) -> None:
    """Also one that was written when there was no choice."""
    (here.cwd / "arm.urdf").write_text(ROUNDED)
    options = ("--acceleration-limit", "4", "--no-snap-angles", "--no-friction")
    assert here.run("design", "arm.urdf", *QUICK, *options, "--out", "o").returncode == 0
    content = content_of(here.cwd / "o")
    assert [note for note in content["notes"] if "took" in note] == []
    assert content["task"].pop("snap_angles") is False
    (here.cwd / "o" / "design.json").write_text(json.dumps(content))
    (here.cwd / "o" / "manifest.json").unlink()
    design = excite.load_design(here.cwd / "o")
    assert design.task.snap_angles is False
    robot, task = robot_and_task(design.task)
    assert (robot.sha256(), task) == (design.robot.sha256(), design.task)
    with pytest.raises(InputError, match=r"o is a design for planar .*, not for planar"):
        excite.identify(str(here.cwd / "arm.urdf"), ["x.csv"], design=design, snap_angles=True)
    with pytest.raises(InputError, match=r"x\.csv"):
        excite.identify(str(here.cwd / "arm.urdf"), ["x.csv"], design=design)
    with pytest.raises(InputError, match="`snap_angles=False` says how to read the file of a robot"):
        excite.identify(robot, ["x.csv"], snap_angles=False)
    with pytest.raises(InputError, match="its joints are j1, j2, here they are j1: choose what moves"):
        excite.identify(str(here.cwd / "arm.urdf"), ["x.csv"], design=design, tip="upper")
