"""The whole experiment by its commands: a plan, its runs simulated under friction that sticks, the truth fitted."""

from __future__ import annotations

import json

import pytest
from commands import Here

from excite.logs.log_reading import read_log, write_log
from excite.tasks.friction_file import write_friction
from regressors.robot.friction.curve import Stribeck
from regressors.robot.friction.curves import FrictionCurves, Side

TRUTH = Stribeck(Side(11.0, 26.0, 16.8, 0.12, 1.0), Side(7.0, 26.0, 10.6, 0.12, 1.0))
PLAN = ("--speeds", "5,12,25,50,90", "--longest", "0.5", "--warm-up", "0", "--breakaways", "1")
SLOW = ("--creeping", "3", "--ramping", "2", "--torque-ramp", "30")
MEASURED = ("--rate", "400", "--encoder", "4000", "--torque-noise", "0.3", "--friction", "truth.yaml")
FIT = ("--model", "stribeck", "--exponent", "1", "--gravity", "none", "--plan", "plan", "--format", "json")


@pytest.mark.slow
def test_a_plan_that_is_played_shows_the_friction_that_was_there(here: Here) -> None:
    """Gravity, up to three times the friction at rest, cancels over the plan's windows."""
    write_friction(FrictionCurves({"z2": TRUTH}), here.cwd / "truth.yaml")
    for command in (
        ("friction", "plan", "irp6", "--drives", "z2", *PLAN, *SLOW, "--out", "plan"),
        ("simulate", "plan/z2.csv", "--out", "runs.csv", "--controller", "pd", *MEASURED),
        ("simulate", "plan/z2.stiction.csv", "--out", "ramps.csv", "--seed", "1", *MEASURED),
    ):
        ended = here.run(*command)
        assert ended.returncode == 0, ended.stderr
    later = read_log(here.cwd / "runs.csv")
    write_log(later.rows(slice(37, None)), here.cwd / "runs.csv")
    ended = here.run("friction", "fit", "irp6", "runs.csv", "ramps.csv", *FIT, "--out", "fit")
    assert ended.returncode == 0, ended.stderr
    (drive,) = json.loads(ended.stdout)["characteristics"]
    best = next(one for one in drive["others"] if one["form"]["name"].startswith("asymmetric"))
    for side, truth in (("forward", TRUTH.forward), ("backward", TRUTH.backward)):
        for name in ("coulomb", "viscous", "stiction", "stribeck"):
            found = best["parameters"][f"{side}.{name}"]
            assert abs(found["value"] - getattr(truth, name)) < found["interval99"], (side, name)
    assert drive["fit"]["form"] == best["form"]
    assert len(drive["points"]) == 10
    assert [mean["count"] for mean in drive["break_away"]] == [2, 2]
    for mean, stiction in zip(drive["break_away"], (16.8, -10.6), strict=True):
        assert abs(mean["torque"] - stiction) < mean["interval99"]
        assert mean["torque"] == pytest.approx(stiction, rel=0.04)
    assert any("begins 0.0" in note and "before its first row" in note for note in drive["notes"])
