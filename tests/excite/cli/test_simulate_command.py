"""``excite simulate``: the logs that it writes, and what it refuses."""

from __future__ import annotations

import json
import re
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from commands import Here, files_below, table_of

from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.optimisation import design_trajectory
from excite.logs.log_reading import read_log, read_sidecar
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation_files import read_motion
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import load_robot

RATE = ("--rate", "200")
IMPACTS = ("--impact", "q2:1.5:60", "--impact", "q1:2:-50:0.02")
LOAD = "1.76,0,0.01,0.16,0.02,0,0,0.02,0,0.001"


@pytest.fixture(scope="module")
def designs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("designs")
    robot = load_robot("irp6")
    for name, model, period in (("irp6", "differential", 4.0), ("load", "load", 3.0)):
        task = Task("irp6", model=model, period=period, harmonics=3, starts=1, executor="serial")
        save_design(design_trajectory(task.changed(robot=robot)), folder / name)
    return folder


@pytest.fixture
def here(designs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    for name in ("irp6", "load"):
        (tmp_path / name).symlink_to(designs / name)
    return Here(tmp_path, monkeypatch, capfd)


def simulated(here: Here, *arguments: str) -> str:
    return here.run("simulate", "-v", *arguments, status=0, stderr="").stdout


def test_the_log_is_that_of_the_library(here: Here) -> None:
    out = simulated(here, "irp6", "--out", "logs/run.csv", *RATE)
    header, table = table_of(here.cwd / "logs" / "run.csv")
    channels = ("position", "velocity", "effort")
    assert header == ["time", *(f"{q}.{what}" for q in ("q1", "q2", "q3") for what in channels)]
    design = load_design(here.cwd / "irp6")
    found = simulate_motion(design.robot, design.task, design.trajectory, SimulationSettings(rate=200.0))
    samples = found.run.samples
    np.testing.assert_array_equal(table[:, 0], samples.time)
    for k in range(3):
        expected = np.column_stack([samples.q[:, k], samples.dq[:, k], found.run.effort[:, k]])
        np.testing.assert_array_equal(table[:, 1 + 3 * k : 4 + 3 * k], expected)
    read = read_log(here.cwd / "logs" / "run.csv", ["q1", "q2", "q3"])
    np.testing.assert_array_equal(read.effort, found.log.effort)
    said = ("Tracking error", "drive z2", "samples at the limit", "energy: the torques did")
    for text in (*said, "friction changes sign within"):
        assert text in out
    assert files_below(here.cwd / "logs") == {"run.csv", "run.json"}
    beside = json.loads((here.cwd / "logs" / "run.json").read_text(encoding="utf-8"))
    assert (beside["holds"], beside["against"], beside["saturated"]) == (True, [], [])


def test_beside_the_log_stands_the_truth(here: Here) -> None:
    sensors = ("--encoder", "4000", "--torque-noise", "1,2,3", "--position-noise", "1e-5", "--model-error", "0.1")
    for name in ("run.csv", "again.csv"):
        simulated(here, "irp6", "--out", name, *RATE, "--seed", "7", *sensors, *IMPACTS)
    assert (here.cwd / "again.csv").read_bytes() == (here.cwd / "run.csv").read_bytes()
    beside = read_sidecar(here.cwd / "run.csv")
    design = json.loads((here.cwd / "irp6" / "design.json").read_text(encoding="utf-8"))
    assert beside["robot"] == {"name": "irp6", "sha256": design["robot"]["sha256"]}
    assert beside["design"]["folder"] == "irp6"
    assert len(beside["design"]["sha256"]) == 64
    settings = [beside["settings"][name] for name in ("encoder", "torque_noise", "position_noise", "model_error")]
    assert (beside["seed"], settings) == (7, [[4000.0], [1.0, 2.0, 3.0], [1e-5], 0.1])
    assert (beside["truth"]["F2c"], beside["truth"]["Ia1"]) == (28.75, 7.658e-5)
    assert any("friction changes sign" in note for note in beside["notes"])
    assert beside["settings"]["impact"] == [
        {"joint": "q2", "time": 1.5, "torque": 60.0, "duration": 0.01},
        {"joint": "q1", "time": 2.0, "torque": -50.0, "duration": 0.02},
    ]


def test_a_load_also_of_a_file_has_a_wrench_log(here: Here) -> None:
    simulated(here, "load", "--out", "run.csv", *RATE, "--wrench-rate", "50", "--load", LOAD)
    written = {"run.csv", "run.json", "run.wrench.csv", "run.wrench.json"}
    assert {name for name in files_below(here.cwd) if name.startswith("run")} == written
    log = read_log(here.cwd / "run.wrench.csv")
    assert log.joints == ("q1", "q2", "q3", "q4", "q5")
    assert (log.count, log.rate) == (151, pytest.approx(50.0))
    # at rest at the start, the force is the weight
    assert np.linalg.norm(log.wrench[0, :3]) == pytest.approx(1.76 * 9.81, rel=0.01)
    (here.cwd / "load.yaml").write_text("m: 1.76\nmcy: 0.01\nmcz: 0.16\nIxx: 0.02\nIyy: 0.02\nIzz: 0.001\n")
    simulated(here, "load", "--out", "filed.csv", *RATE, "--wrench-rate", "50", "--load", "load.yaml")
    assert (here.cwd / "filed.wrench.csv").read_bytes() == (here.cwd / "run.wrench.csv").read_bytes()
    beside = read_sidecar(here.cwd / "run.wrench.csv")
    assert (beside["truth"]["m"], beside["truth"]["mcz"], beside["truth"]["Izz"]) == (1.76, 0.16, 0.001)


def test_a_file_is_played_as_the_design_is(here: Here) -> None:
    simulated(here, "irp6", "--out", "a.csv", *RATE)
    simulated(here, "irp6", "--out", "b.csv", *RATE, "--trajectory", "irp6/trajectory.csv")
    a, b = (read_log(here.cwd / f"{name}.csv") for name in "ab")
    np.testing.assert_allclose(b.q, a.q, atol=1e-6)
    np.testing.assert_allclose(b.effort, a.effort, atol=0.2)
    beside = read_sidecar(here.cwd / "b.csv")
    assert beside["trajectory"]["file"] == "trajectory.csv"
    assert beside["trajectory"]["sha256"] == sha256((here.cwd / "irp6" / "trajectory.csv").read_bytes()).hexdigest()
    assert read_sidecar(here.cwd / "a.csv")["trajectory"] is None


HEADER = "time,q1.position,q1.velocity,q1.acceleration,q2.position,note"


MOTIONS = (
    ("", "no column in .* named 'time'; available: none"),
    ("time,q1.position\n0,1\n", "no column in .* named 'q1.velocity'; available: time, q1.position"),
    (f"{HEADER}\n0,0,0,0,0\n", "line 2: 5 cells under 6 names"),
    (f"{HEADER}\n0,0,0,0,0,\n1,0,zero,0,0,\n", "line 3: 'zero' is not a number"),
    (f"{HEADER}\n0,0,nan,0,0,\n", "line 2: a value is not finite"),
    (f"{HEADER}\n0,0,0,0,0,\n0,0,0,0,0,\n", "two samples or more at increasing times"),
    (f"{HEADER}\n0,0,0,0,0,\n1,0,0,0,0.1,\n", "q2 moves, but the design holds it still and moves q1"),
)


def test_bad_motions_are_refused(tmp_path: Path) -> None:
    for text, message in MOTIONS:
        (tmp_path / "motion.csv").write_text(text)
        with pytest.raises(InputError, match=message):
            read_motion(tmp_path / "motion.csv", ["q1"])


def test_a_folder_without_servos_is_named(here: Here) -> None:
    ended = here.run("simulate", "irp6", "--servos", "irp6", "--out", "run.csv")
    assert (ended.returncode, ended.stderr) == (2, "excite: cannot read irp6/servos.json: No such file or directory\n")


def test_friction_from_a_file(here: Here) -> None:
    curve = "z2: {model: table, speed: [0.05, 1], torque: [20, 40]}"
    (here.cwd / "friction.yaml").write_text(f"schema: excite.friction/1\ndrives:\n  {curve}\n")
    simulated(here, "irp6", "--out", "a.csv", *RATE)
    simulated(here, "irp6", "--out", "b.csv", *RATE, "--friction", "friction.yaml", "--periods", "2")
    a, b = (read_log(here.cwd / f"{name}.csv") for name in "ab")
    assert (a.count, b.count) == (801, 1601)
    np.testing.assert_allclose(a.effort[:, [0, 2]], b.effort[:801, [0, 2]], atol=0.5)
    assert np.abs(a.effort[:, 1] - b.effort[:801, 1]).max() > 5.0
    assert "F2c" not in read_sidecar(here.cwd / "b.csv")["truth"]


def test_nothing_is_replaced_unless_forced(here: Here) -> None:
    for name in ("run.csv", "run.wrench.csv"):
        (here.cwd / name).write_text("mine")
    for options in ((), ("--load", LOAD)):
        said = here.refused("simulate", "irp6", "--out", "run.csv", *RATE, *options)
        assert "run.csv" in said
        assert "already there; --force replaces" in said
    assert (here.cwd / "run.csv").read_text() == "mine"
    simulated(here, "irp6", "--out", "run.csv", *RATE, "--force")
    assert (here.cwd / "run.csv").read_text().startswith("time,")
    assert (here.cwd / "run.wrench.csv").read_text() == "mine"


BAD = {
    "--controller lqr": "'lqr' is not one of 'computed-torque', 'pd'",
    "--load bad.yaml": "mass (line 1): no such field; available: m, mcx",
    "--load light.yaml": "light.yaml: load: no body has these parameters",
    "--friction bad.yaml": "bad.yaml: schema (line 1): is missing",
    "--impact q2:1:x": "expected JOINT:TIME:TORQUE",
    "--impact q7:1:5": "no moving joint for an impact named 'q7'",
    "--position-step 0.1,0.2": "position_step needs one value, or 3",
}


def test_bad_input_is_one_line_and_writes_nothing(here: Here) -> None:
    (here.cwd / "bad.yaml").write_text("mass: 1\n")
    (here.cwd / "light.yaml").write_text("m: 1\nmcx: 1\n")
    for options, message in BAD.items():
        assert message in here.refused("simulate", "irp6", "--out", "run.csv", *options.split())
    assert "none holds no design" in here.refused("simulate", "none", "--out", "run.csv")
    assert "expected a name that ends in .csv" in here.refused("simulate", "irp6", "--out", "run.txt")


def test_a_robot_that_is_not_held_ends_with_status_one(here: Here) -> None:
    curve = "z1: {model: coulomb-viscous, coulomb: 0, viscous: -5000}"
    (here.cwd / "friction.yaml").write_text(f"schema: excite.friction/1\ndrives:\n  {curve}\n")
    options = ("--friction", "friction.yaml", "--controller", "pd", "--no-torque-limits", "--rate", "1000")
    said = here.refused("simulate", "irp6", "--out", "run.csv", *options, status=1)
    assert "the simulated motion diverges at" in said


@pytest.mark.slow
def test_a_motion_that_is_too_fast_ends_with_status_one_and_identify_leaves_those_rows_out(here: Here) -> None:
    header, table = table_of(here.cwd / "irp6" / "trajectory.csv")
    factors = {"time": 1 / 3.5, "position": 1.0, "velocity": 3.5, "acceleration": 3.5**2}
    table = table * np.array([factors[name.split(".")[-1]] for name in header])
    np.savetxt(here.cwd / "fast.csv", table, fmt="%.17g", delimiter=",", header=",".join(header), comments="")
    fast = ("simulate", "irp6", "--trajectory", "fast.csv", "--periods", "4", "--out", "run.csv", *RATE)
    refused = here.run(*fast)
    assert (refused.returncode, refused.stdout, (here.cwd / "run.csv").exists()) == (1, "", False)
    assert re.search(r"a limit: drive z[123] acceleration is .*% of what is allowed.*--beyond-limits", refused.stderr)
    ended = here.run(*fast, "--beyond-limits", "-v", status=1, stderr="")
    assert "does not hold: the torque of drive z" in ended.stdout
    assert "design the motion with --torque-margin" in ended.stdout
    assert "does not hold: the velocity of drive z" in ended.stdout
    content = json.loads((here.cwd / "run.json").read_text(encoding="utf-8"))
    assert (content["holds"], content["against"] != []) == (False, True)
    assert all(one["torque"].startswith("drive z") and one["spans"] for one in content["saturated"])
    ended = here.run("identify", "irp6", "run.csv", "-v", "--out", "result")
    assert (ended.returncode, (here.cwd / "result" / "result.json").exists()) == (0, True)  # what is left out is told
    assert "of the exciting rows of run.csv are left out, more than 5 %" in ended.stdout
    assert "left out: " in ended.stdout


def test_a_load_design_without_a_load_is_told(here: Here) -> None:
    ended = here.run("simulate", "load", "--out", "run.csv", *RATE, status=0)
    assert ended.stderr == "excite: note: the design is for a load, but none is simulated; give one with --load\n"
    assert not (here.cwd / "run.wrench.csv").exists()
