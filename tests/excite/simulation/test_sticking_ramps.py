"""Ramps of a drive's torque: open loop until the drive breaks loose, then the position controller catches it."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from breakaway_ramps import STICKING
from commands import Here
from pinocchio_chains import chain_model
from refused import refusal
from written_files import text_file

from excite.logs.log_reading import read_log, read_sidecar
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.simulation.simulation_files import read_torque
from excite.tasks.reference import GivenTorque, SampledMotion
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in
from regressors.samples import Array, Samples

POSE = np.array([0.2, -0.3, 0.25, 0.1, 0.0])
RATE = 1000.0
REST, RISE = 0.5, 1.0


def ramps(drive: str, largest: tuple[float, ...]) -> GivenTorque:
    """Rests of half a second, and ramps of one second to some torques."""
    time = np.arange(round(len(largest) * (REST + RISE) * 250) + 1) / 250
    number, torque = np.zeros(time.size, dtype=int), np.zeros(time.size)
    for k, end in enumerate(largest):
        start = k * (REST + RISE) + REST
        inside = (time >= start) & (time < start + RISE - 1e-9)
        number[inside], torque[inside] = k + 1, end * (time[inside] - start) / RISE
    return GivenTorque(drive, time, torque, number)


@cache
def of(drive: str, largest: tuple[float, ...], controller: str = "pd") -> Simulation:
    given = ramps(drive, largest)
    still = np.zeros((2, 5))
    motion = SampledMotion(Samples(given.time[[0, -1]], still + POSE, still, still, still))
    settings = SimulationSettings(rate=RATE, controller=controller, bandwidth=8.0, breakaway="auto")
    task = Task("irp6", joints=("1", "2", "3", "4", "5"))
    return simulate_motion(built_in("irp6"), task, motion, settings, friction=STICKING, ramps=given)


def drives(found: Simulation, values: Array) -> Array:
    """Joint positions as coordinates of drives."""
    return np.asarray(values @ found.robot.transmission.coupling.T)


def torques(found: Simulation) -> Array:
    """Torques of the drives less what gravity asks of them, by Pinocchio."""
    run, model = found.run, chain_model(built_in("irp6"))
    still = np.zeros(5)
    weight = np.array([pin.rnea(model, model.createData(), q, still, still) for q in run.samples.q])
    return np.asarray((run.effort - weight) @ np.linalg.inv(found.robot.transmission.coupling))


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["pd", "computed-torque"])
@pytest.mark.parametrize(("drive", "forward", "backward"), [("z2", 16.8, 10.6), ("z3", 18.0, 14.1)])
def test_a_drive_follows_the_ramp_until_it_breaks_loose(
    drive: str, forward: float, backward: float, controller: str
) -> None:
    found = of(drive, (25.0, -25.0), controller)
    j, time = int(drive[1]) - 1, found.run.samples.time
    z, tau = drives(found, found.run.samples.q), torques(found)
    for k, stiction in enumerate((forward, -backward)):
        start = k * (REST + RISE) + REST
        first, last = np.searchsorted(time, [start - 1e-9, start + RISE - 1e-9])
        way = np.abs(z[first:last, j] - z[first, j])
        caught = first + int(np.argmax(way > 2e-3))
        sign = 1 if k == 0 else -1
        np.testing.assert_allclose(
            tau[first + 1 : caught, j], sign * 25.0 * (time[first + 1 : caught] - start), atol=1e-6
        )
        loose = first + int(np.argmax(way > 1e-4))
        assert tau[loose, j] == pytest.approx(stiction, abs=1.5)  # the ramp goes on while the drive speeds up
        assert np.all(sign * tau[first + 1 : loose - 30, j] < abs(stiction) + 0.2)
        # afterwards position is controlled: the torque is not the ramp's, and the drive stays about
        assert abs(tau[caught + 100, j] - sign * 25.0 * (time[caught + 100] - start)) > 2.0
        assert way.max() < 6e-3
        others = np.delete(z, j, axis=1)
        assert np.abs(others[first:last] - others[first]).max() < 3e-3


def test_a_ramp_that_is_too_low_moves_nothing_and_is_said() -> None:
    found = of("z1", (8.0, 20.0))
    z = drives(found, found.run.samples.q)[:, 0]
    second = int((2 * REST + RISE) * RATE)
    assert np.abs(z[:second] - z[0]).max() < 1e-4
    assert np.abs(z - z[0]).max() > 2e-3
    assert any("z1 was given 2 ramps of torque" in note and "it moved in 1 of them" in note for note in found.notes)


def test_ramps_of_one_period_and_of_a_drive_only() -> None:
    given, still, task = ramps("z1", (1.0,)), np.zeros((2, 5)), Task("irp6", joints=tuple("12345"))
    motion = SampledMotion(Samples(given.time[[0, -1]], *(still for _ in range(4))))
    with pytest.raises(InputError, match="torque ramps are played once, given 2 periods"):
        simulate_motion(built_in("irp6"), task, motion, SimulationSettings(periods=2), ramps=given)
    with pytest.raises(UnknownName, match="no drive named 'z7'"):
        simulate_motion(built_in("irp6"), task, motion, ramps=ramps("z7", (1.0,)))


# --- files -----------------------------------------------------------------------------------------------------------


def test_a_file_says_where_ramps_are(tmp_path: Path) -> None:
    up, down = "z1 stiction +", "z1 stiction -"
    rows = [(0.0, "rest"), (0.0, up), (5.0, up), (0.0, down), (-5.0, down), (9.0, "rest"), (0.0, down)]
    lines = [f"{k / 10},0,{tau},{name}\n" for k, (tau, name) in enumerate(rows)]
    path = text_file(tmp_path / "z1.stiction.csv", "time,q1.position,z1.effort,segment\n" + "".join(lines))
    found = read_torque(path, built_in("irp6"))
    assert (found.drive, found.count, found.number.tolist()) == ("z1", 3, [0, 1, 1, 2, 2, 0, 3])
    np.testing.assert_allclose(found.delayed(2.0).at(np.array([1.9, 2.15, 2.4])), [[0, 0], [2.5, 1], [-5, 2]])


def test_bad_files_are_refused_and_files_without_ramps_have_none(tmp_path: Path) -> None:
    path = tmp_path / "ramps.csv"
    for text, message in (
        ("time,z9.effort,segment\n0,0,z9 stiction +\n", "column z9.effort of .* named 'z9'; available: z1"),
        ("time,z1.effort,z2.effort,segment\n0,0,0,stiction\n", "one drive at a time .* columns z1.effort, z2.effort"),
        ("time,z1.effort,segment\n0,much,stiction\n", "line 2: 'much' is not a number"),
    ):
        path.write_text(text)
        assert re.search(message, refusal(read_torque, path, built_in("irp6")))
    for text in ("time,z1.effort,segment\n0,0,rest\n", "time,q1.position,segment\n0,0,z1 stiction +\n"):
        path.write_text(text)
        assert read_torque(path, built_in("irp6")) is None


# --- the command -----------------------------------------------------------------------------------------------------


def planned(here: Here) -> Path:
    """A friction plan of which only one file is kept, with ramps of its own."""
    options = ("--drives", "z1", "--speeds", "50", "--warm-up", "0", "--breakaways", "0", "--longest", "0.5")
    here.run("friction", "plan", "irp6", *options, "--out", "plan", status=0)
    given, joints = ramps("z1", (20.0, -20.0)), [f"q{k}" for k in range(1, 6)]
    header = ["time", *(f"{q}.{rate}" for q in joints for rate in ("position", "velocity", "acceleration"))]
    names = np.array(["rest", "z1 stiction +", "z1 stiction -"])[given.number]
    held = ",".join(f"{q:.17g},0,0" for q in POSE)
    lines = [f"{t:.17g},{held},{tau:.17g},{name}" for t, tau, name in zip(given.time, given.torque, names, strict=True)]
    path = here.cwd / "plan" / "z1.stiction.csv"
    path.write_text("\n".join([",".join([*header, "z1.effort", "segment"]), *lines]) + "\n")
    return path


def test_files_of_a_friction_plan_are_played(here: Here) -> None:
    planned(here)
    plan = json.loads((here.cwd / "plan" / "plan.json").read_text(encoding="utf-8"))
    for name in ("z1", "z1.stiction"):
        ended = here.run(
            "simulate", f"plan/{name}.csv", "--out", f"{name}.log.csv", "--controller", "pd", "--rate", "500"
        )
        assert (ended.returncode, ended.stderr) == (0, "")
        beside = read_sidecar(here.cwd / f"{name}.log.csv")
        assert beside["robot"]["sha256"] == plan["robot"]["sha256"]
        assert (beside["design"], beside["friction_plan"]["folder"]) == (None, "plan")
        assert beside["trajectory"]["file"] == f"{name}.csv"
        assert beside["settings"]["sign_width"] is None
        assert 1e-5 <= beside["settings"]["breakaway"] < 2e-4
        assert any("friction is presliding" in note for note in beside["notes"])
    log = read_log(here.cwd / "z1.stiction.log.csv")
    assert log.joints == ("q1", "q2", "q3", "q4", "q5")
    assert "z1 was given 2 ramps of torque" in ended.stdout.replace("\n", " ")
    ramping = (log.time > REST + 0.1) & (log.time < REST + 0.5)
    np.testing.assert_allclose(log.effort[ramping, 0], 20.0 * (log.time[ramping] - REST), atol=1e-6)


@pytest.mark.slow
def test_bad_input_is_one_line_and_writes_nothing(here: Here) -> None:
    planned(here)
    (here.cwd / "alone.csv").write_text("time\n0\n")
    both, catch = ("--breakaway", "1e-4", "--sign-width", "0.1"), ("plan/z1.stiction.csv", "--catch", "-1")
    for arguments, message in (
        (("plan",), "plan holds a friction plan: name the file to play, such as plan/z1.csv"),
        (("alone.csv",), "there is no plan.json of a friction plan in its folder; to play a file with a design"),
        (("plan/none.csv",), "cannot read plan/none.csv: No such file"),
        (("plan/z1.csv", "--trajectory", "alone.csv"), "two files to play are given: plan/z1.csv and alone.csv"),
        (("plan/z1.csv", *both), "give --sign-width or --breakaway, not both"),
        (("plan/z1.csv", "--breakaway", "soft"), "expected auto or a number, given 'soft'"),
        (catch, "'--catch': must be a number from 1e-09 to 10000 rad or m, given -1"),
        (("plan/z1.stiction.csv", "--periods", "2"), "torque ramps are played once, given 2 periods"),
    ):
        assert message in here.refused("simulate", *arguments, "--out", "log.csv")
