"""Whole experiments: a plan by its commands, its runs simulated, the truth fitted, and the plan however it is given."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Here
from designed import planar
from refused import refusal

import excite
from excite.identification.result_json import load_result, result_content
from excite.logs.log_reading import read_log, write_log
from excite.simulation.simulate import motion_source
from excite.tasks.friction_file import read_friction, write_friction
from regressors.errors import InputError, UnknownName
from regressors.robot.friction.curve import CoulombViscous, Stribeck
from regressors.robot.friction.curves import FrictionCurves, Side

TRUTH = Stribeck(Side(11.0, 26.0, 16.8, 0.12, 1.0), Side(7.0, 26.0, 10.6, 0.12, 1.0))
PLAN = ("--speeds", "5,12,25,50,90", "--longest", "0.5", "--warm-up", "0", "--breakaways", "1")
SLOW = ("--creeping", "3", "--ramping", "2", "--torque-ramp", "30")
MEASURED = ("--rate", "400", "--encoder", "4000", "--torque-noise", "0.3", "--friction", "truth.yaml")
FIT = ("--model", "stribeck", "--exponent", "1", "--gravity", "none", "--plan", "plan", "--json")


@pytest.mark.slow
def test_a_plan_that_is_played_shows_the_friction_that_was_there(here: Here) -> None:
    """Gravity, up to three times the friction at rest, cancels over the plan's windows."""
    write_friction(FrictionCurves({"z2": TRUTH}), here.cwd / "truth.yaml")
    for command in (
        ("friction", "plan", "irp6", "--drives", "z2", *PLAN, *SLOW, "--out", "plan"),
        ("simulate", "plan/z2.csv", "--out", "runs.csv", "--controller", "pd", *MEASURED),
        ("simulate", "plan/z2.stiction.csv", "--out", "ramps.csv", "--seed", "1", *MEASURED),
    ):
        here.run(*command, status=0)
    later = read_log(here.cwd / "runs.csv")
    write_log(later.rows(slice(37, None)), here.cwd / "runs.csv")
    ended = here.run("friction", "fit", "irp6", "runs.csv", "ramps.csv", *FIT, "--out", "fit", status=0)
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


STEPS = (  # shorter than the README's, for time
    "friction plan irp6 --drives 2 --speeds 5,20,50,100 --warm-up 0 --breakaways 0 --out plans/irp6",
    "simulate plans/irp6/z2.csv --controller pd --bandwidth 10 --torque-noise 0.5 --rate 500 --out run.csv",
    "friction fit irp6 run.csv --plan plans/irp6 --out friction/irp6",
    "design irp6 --friction-curves friction/irp6/friction.yaml --period 4 --harmonics 3 --starts 1 --executor serial "
    "--out designs/masses",
    "simulate designs/masses --encoder 4000 --torque-noise 1 --seed 1 --rate 200 --out masses.csv",
    "identify irp6 masses.csv --design designs/masses --choose none --out results/masses",
    "identify irp6 masses.csv --friction-curves friction/irp6/friction.yaml --out results/named",
)


@pytest.mark.slow
def test_masses_are_within_their_intervals_by_the_recipe_of_the_readme(here: Here) -> None:
    """One drive's friction on its own, then a design and an identification with its curve."""
    for step in STEPS:
        here.run(*step.split(), status=0)
    curve = read_friction(here.cwd / "friction" / "irp6" / "friction.yaml").curve("z2")
    speed = np.array([-1.0, -0.3, -0.06, 0.06, 0.3, 1.0])
    np.testing.assert_allclose(curve.torque(speed), CoulombViscous(28.75, 26.0).torque(speed), rtol=1e-3)
    for folder in ("masses", "named"):
        content = result_content(load_result(here.cwd / "results" / folder))
        names = [p["name"] for p in content["parameters"]]
        assert names == [*(f"X{k}" for k in range(1, 8)), "F1c", "F3c", "F1v", "F3v"]
        assert content["reference"] == "truth"
        assert content["relative_error"] < 0.05
        for p in content["parameters"]:
            if p["name"].startswith("X"):
                assert p["interval"][0] <= p["reference"] <= p["interval"][1], p["name"]
            else:  # the width over which friction changes its sign is taken as exact
                assert p["value"] == pytest.approx(p["reference"], rel=0.01), p["name"]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path, Any]:
    """A plan of drive z1, its folder, and the simulation of its file."""
    folder = tmp_path_factory.mktemp("plan")
    schedule = excite.Schedule(percent=(20.0, 60.0), warm_up=0.0, longest=0.8, breakaways=0)
    plan = excite.plan_friction("irp6", schedule, drives=["z1"], torque_ramp=[0.0])
    plan.save(folder)
    simulation = excite.simulate(folder / "z1.csv", noise=0.1, seed=1, controller="pd", rate=100.0)
    return plan, folder, simulation


def curve(plan: Any, simulation: Any) -> np.ndarray:
    fit = excite.fit_friction("irp6", simulation, plan=plan, model="coulomb-viscous")
    (found,) = fit.characteristics
    assert found.drive == "z1"
    return np.asarray(found.fit.values)


@pytest.mark.slow
def test_every_form_of_a_plan_gives_the_same_curve(simulated: tuple[Any, Path, Any], tmp_path: Path) -> None:
    plan, folder, simulation = simulated
    expected = curve(folder, simulation)
    for given in (plan, str(folder), simulation, motion_source(folder / "z1.csv")):
        np.testing.assert_allclose(curve(given, simulation), expected, rtol=1e-12)
    assert expected[0] == pytest.approx(28.0, rel=0.2)
    again = excite.simulate(plan.motion("z1"), noise=0.1, seed=1, controller="pd", rate=100.0)  # without its folder
    np.testing.assert_allclose(again.log.q, simulation.log.q, atol=1e-9)
    np.testing.assert_allclose(again.log.effort, simulation.log.effort, atol=1e-6)
    again.save(tmp_path / "run.csv")
    np.testing.assert_allclose(curve(plan, tmp_path / "run.csv"), expected, rtol=1e-6)


@pytest.mark.slow
def test_what_is_no_plan_is_refused(simulated: tuple[Any, Path, Any]) -> None:
    plan, _, simulation = simulated
    other = excite.simulate(planar("fourier"), rate=100.0)
    with pytest.raises(InputError, match="expected a friction plan, given a motion that comes from none"):
        excite.fit_friction("irp6", simulation, plan=other)
    assert "the plan is a plan for irp6, not for panda" in refusal(excite.fit_friction, "panda", [], plan=plan)
    with pytest.raises(UnknownName, match="no coordinate of the plan named 'q1'; available: z1"):
        plan.motion("q1")
    with pytest.raises(UnknownName, match="no drive in the plan named 'z2'; available: z1"):
        excite.fit_friction("irp6", simulation, plan=plan, drives=["z2"])
