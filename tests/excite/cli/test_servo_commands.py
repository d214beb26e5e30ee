"""``excite identify --model servo`` and ``verify`` of its servos: exit status, files, words, and a real desktop arm."""

from __future__ import annotations

import json

import numpy as np
import pytest
from commands import Here, table_of
from recordings import so101_folder
from servo_arm import URDF, servo_log, true_servos

from excite.logs.log_reading import write_log


@pytest.fixture
def here(here: Here) -> Here:
    """A folder with the small arm, and with what its servos are."""
    (here.cwd / "small.urdf").write_text(URDF, encoding="utf-8")
    true_servos().save(here.cwd / "truth")
    return here


def with_logs(here: Here) -> Here:
    """The same with two logs of its servos."""
    write_log(servo_log(0, 30.0), here.cwd / "run.csv")
    write_log(servo_log(1, 12.0), here.cwd / "other.csv")
    return here


@pytest.mark.slow
def test_servos_are_identified_and_verified_end_to_end(here: Here) -> None:
    ended = with_logs(here).run("identify", "small.urdf", "run.csv", "--model", "servo", "--out", "servos", status=0)
    assert ended.stdout.startswith("Identified 3 servos of small: the logs show ")
    assert "roll: the known masses hardly load the joint" in " ".join(ended.stdout.split())
    stated = json.loads((here.cwd / "servos" / "servos.json").read_text(encoding="utf-8"))["servos"]
    assert stated["lift"]["stiffness"]["value"] == pytest.approx(15.0, rel=0.1)
    again = ("identify", "small.urdf", "run.csv", "--model", "servo", "--out", "servos")
    assert "already holds servos" in here.refused(*again)
    ended = here.run("verify", "servos", "other.csv", status=0)
    assert ended.stdout.startswith("The servos of lift, elbow, roll predict this motion")
    errors = json.loads((here.cwd / "servos" / "verification-other.json").read_text(encoding="utf-8"))["position_error"]
    assert errors.keys() == {"lift", "elbow", "roll"}
    assert max(errors.values()) < 1.6e-3
    assert (here.cwd / "servos" / "verification-other_motion.png").exists()
    refused = here.refused("verify", "servos", "run.csv")
    assert "is a log that the servos were identified from" in refused
    assert "--training-too" in refused


def test_servos_are_judged_on_several_logs_in_one_table(here: Here) -> None:
    write_log(servo_log(1, 12.0), here.cwd / "one.csv")
    write_log(servo_log(2, 12.0), here.cwd / "two.csv")
    shown = here.run("verify", "truth", "one.csv", "two.csv", "--figures", "none", status=0).stdout
    assert shown.startswith("The servos predict each of 2 logs")
    rows = [line.split()[:2] for line in shown.splitlines() if ".csv" in line]
    assert rows == [["one.csv", "holds"], ["two.csv", "holds"]]
    ended = here.run("verify", "truth", "one.csv", "two.csv", "--json", "--out", "again")
    assert [each["holds"] for each in json.loads(ended.stdout)] == [True, True]


@pytest.mark.slow
def test_the_masses_of_a_result_set_the_scale_of_servos(here: Here) -> None:
    (with_logs(here).cwd / "heavy.urdf").write_text(URDF.replace('"0.4"', '"0.6"').replace('"0.3"', '"0.45"'))
    known = ("identify", "heavy.urdf", "run.csv")
    here.run(*known, "--joint-rotors", "--out", "arm", status=0)
    ended = here.run(*known, "--model", "servo", "--result", "arm", "--out", "servos", status=0)
    stated = json.loads((here.cwd / "servos" / "servos.json").read_text(encoding="utf-8"))["servos"]
    for joint, stiffness in (("lift", 15.0), ("elbow", 12.0)):  # half as much more by the masses of the file
        assert stated[joint]["stiffness"]["value"] == pytest.approx(stiffness, rel=0.1), joint
    assert "excite: note: the bodies reproduce the identified base parameters" in ended.stderr
    refused = here.refused("identify", "so101", "run.csv", "--model", "servo", "--result", "arm", "--out", "other")
    assert "the result in arm is of lift, elbow, roll, and so101 has shoulder_pan" in refused


def test_a_result_is_for_servos_alone(here: Here) -> None:
    refused = here.refused("identify", "so101", "run.csv", "--result", "arm", "--out", "other")
    assert refused.startswith("excite: --result is for servos: give --model servo too")


def test_a_design_is_played_as_its_servos_follow_it(here: Here) -> None:
    chosen = ("--period", "4", "--harmonics", "3", "--starts", "1", "--executor", "serial", "--figures", "none")
    assert here.run("design", "small.urdf", *chosen, "--out", "design").returncode == 0
    ended = here.run("simulate", "design", "--servos", "truth", "--rate", "100", "--out", "run.csv", "-v")
    out = " ".join(ended.stdout.split())
    assert "401 samples at 100 Hz; identified servos; condition number " in out
    header, table = table_of(here.cwd / "run.csv")
    assert header[1:5] == ["lift.position", "lift.velocity", "lift.effort", "lift.command"]
    assert 0.01 < np.abs(table[:, 1] - table[:, 4]).max() < 0.5
    tracked = json.loads((here.cwd / "run.json").read_text(encoding="utf-8"))["tracked"]
    own = json.loads((here.cwd / "design" / "design.json").read_text(encoding="utf-8"))["criteria"]
    assert tracked["commanded"]["condition_number"] == pytest.approx(own["condition_number"], rel=1e-3)
    assert tracked["tracked"].keys() == tracked["commanded"].keys()
    assert tracked["tracked"]["condition_number"] != pytest.approx(own["condition_number"], rel=1e-3)
    refused = here.refused("simulate", "design", "--servos", "truth", "--bandwidth", "9", "--out", "other.csv")
    assert "--bandwidth is for a simulated controller, whose place servos take: leave it out" in refused


def test_settings_of_torques_are_refused_in_words(here: Here) -> None:
    words = "is not for servos: their model has no such setting; see"
    for option in ("--cutoff 5", "--repeat 3", "--offset", "--gains each"):
        typed = ("identify", "small.urdf", "run.csv", "--model", "servo", *option.split(), "--out", "servos")
        assert here.refused(*typed).startswith(f"excite: {option.split()[0]} {words}")


def test_logs_without_commands_are_refused_in_words(here: Here) -> None:
    time = np.arange(500) / 50
    rows = "\n".join(f"{t:.3f},0.1,0.2,0.3" for t in time)
    (here.cwd / "run.csv").write_text(f"time,lift.position,elbow.position,roll.position\n{rows}\n", encoding="utf-8")
    refused = here.refused("identify", "small.urdf", "run.csv", "--model", "servo", "--out", "servos")
    assert "run.csv has no commanded positions, which the model servo needs: columns NAME.command" in refused


SERVO_FORMATS = ("mjcf", "urdf", "drake", "isaac", "yaml", "bam")


def test_servos_are_exported(here: Here) -> None:
    for form in SERVO_FORMATS:
        ended = here.run("export", "truth", "--format", form, "--out", f"arm.{form}", status=0)
        assert ended.stdout.startswith(f"3 servos exported as {form}\nservos: lift, elbow, roll\n")
        assert (here.cwd / f"arm.{form}").exists()
    for options, words in {
        "--format krl": "krl is a format of motions",
        "--format mjcf --rate 50": "--rate",
        "--format mjcf --samples 3": "--samples is for the result of torques, and DIR holds servos",
        "--format mjcf --robot-file a.urdf": "takes one that ends in .xml, .mjcf",
    }.items():
        assert words in here.refused("export", "truth", *options.split(), "--out", "new.xml")
    (here.cwd / "truth" / "result.json").write_text("{}", encoding="utf-8")
    mjcf = ("--format", "mjcf", "--out", "new.xml")
    assert "name truth/result.json or truth/servos.json" in here.refused("export", "truth", *mjcf)
    here.run("export", "truth/servos.json", *mjcf, status=0)


@pytest.mark.slow
def test_servos_of_a_real_desktop_arm_follow_unseen_commands(here: Here) -> None:
    for name in ("chirp_sweep", "hold_under_gravity"):
        so101_folder(name, here.cwd)
    for path in (here.cwd / "chirp_sweep").iterdir():  # half of it is enough
        path.write_text("".join(path.read_text().splitlines(keepends=True)[:3001]))
    here.run("identify", "so101", "chirp_sweep", "--model", "servo", "--figures", "none", "--out", "servos", status=0)
    here.run("verify", "servos", "hold_under_gravity", "--figures", "none")
    path = here.cwd / "servos" / "verification-hold_under_gravity.json"
    errors = json.loads(path.read_text(encoding="utf-8"))["position_error"]
    assert errors.pop("gripper") < 0.01
    assert len(errors) == 5
    assert np.mean(list(errors.values())) < 0.025
