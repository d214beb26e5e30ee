"""Friction that depends on temperature, from simulation over the fit of its curves to identification."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import Here
from friction_runs import pieces
from played import TASK, curves, described, found, irp6, played, three_joints
from refused import refusal
from written_files import text_file

from excite.friction.constant_speed_windows import FitSettings
from excite.friction.curve_fit import chosen_fit
from excite.friction.friction_equations import Form, forms
from excite.friction.friction_fit import Characteristic, characteristics
from excite.friction.points import Point, described_model
from excite.identification.identification import Identification
from excite.identification.prediction import prediction
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.logs.log_reading import read_log, write_log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.friction_file import read_friction, write_friction
from excite.tasks.reference import SampledMotion
from excite.tasks.task import Task
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, TableFriction
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.samples import Array, Samples

RATE = 250.0
TRUTH = Warm(CoulombViscous(20.0, 26.0, 0.5), 32.3, Slope(-0.5, -0.4))
ARM = Task("irp6", drives=("2",))


def motion(*runs: tuple[float, float], start: float) -> SampledMotion:
    """Drive 2 alone, q2 = s and q3 = -s: runs of constant speed over some way, one after the other."""
    parts = []
    for speed, way in runs:
        ramp, a = abs(speed) / 3.0, np.copysign(3.0, speed)
        parts += [(ramp, a), (abs(way / speed), 0.0), (ramp, -a), (0.02, 0.0)]
    time, s, v, a = pieces(parts, RATE)
    q, dq, ddq = (np.outer(x, [0.0, 1.0, -1.0]) for x in (start + s, v, a))
    return SampledMotion(Samples(time, q, dq, ddq, np.full_like(q, np.nan)))


def simulated(
    temperature: tuple[float, ...] | None, *runs: tuple[float, float], seed: int, start: float = -0.1
) -> Simulation:
    own = {"temperature": temperature, "seed": seed}
    settings = SimulationSettings(rate=RATE, torque_limits=False, torque_noise=(0.3,), **own)
    return simulate_motion(irp6(), ARM, motion(*runs, start=start), settings, friction=FrictionCurves({"z2": TRUTH}))


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    """Runs at constant speed at three temperatures."""
    runs = [(sign * speed, max(0.3, 0.4 * speed)) for speed in (0.15, 0.3, 0.6) for sign in (1, -1)]
    made = [simulated((warm,), *runs, seed=seed).log for seed, warm in enumerate((20.0, 32.0, 45.0))]
    return [replace(log, source=f"run{k}.csv", sha256=str(k)) for k, log in enumerate(made)]


@pytest.fixture(scope="module")
def fitted(logs: list[Log]) -> Characteristic:
    (one,) = characteristics(irp6(), logs, FitSettings(), described_model, ("z2",))
    return one


@pytest.fixture(scope="module")
def warm_log() -> Log:
    """At 40 deg C up slowly and down quickly, so that an error of friction is mistaken for gravity."""
    up_and_down = [(v, 0.35) for v in (0.1, -0.6, 0.15, -0.9, 0.12, -0.75)]
    return simulated((40.0,), *up_and_down, seed=7, start=0.1).log


def test_slopes_lie_in_their_intervals(fitted: Characteristic) -> None:
    assert fitted.fit.form.name == "coulomb-viscous, linear in temperature"
    assert "linear in temperature, 20 to 45 deg C; the file holds the curve at 32.3" in " ".join(fitted.notes)
    curve = fitted.curve
    assert isinstance(curve, Warm)
    assert curve.range == (20.0, 45.0)
    there = TRUTH.at(curve.reference)
    truth = {"coulomb_temperature": -0.5, "viscous_temperature": -0.4, **vars(there)}
    for name, value, half in zip(fitted.fit.form.parameters, fitted.fit.values, fitted.fit.halfwidth, strict=True):
        assert abs(value - truth[name]) <= half, name
        assert half < 0.1 * max(abs(truth[name]), 0.2)
    for temperature in (22.0, 45.0):
        np.testing.assert_allclose(
            curve.at(temperature).torque([-0.6, 0.3]), TRUTH.torque_at([-0.6, 0.3], temperature), atol=0.1
        )


def inertial(log: Log, curve: FrictionCurve, **recipe: object) -> Identification:
    return estimate_parameters(irp6(), ARM, [log], Recipe(rows="all", **recipe), friction=FrictionCurves({"z2": curve}))


def test_a_warm_log_gives_masses_without_bias(fitted: Characteristic, warm_log: Log) -> None:
    warm = inertial(warm_log, fitted.curve)
    low, high = warm.estimate.interval.T
    assert np.all((low <= described(warm)) & (described(warm) <= high))
    assert "friction of z2 is taken at 40 deg C" in warm.prepared[0].notes
    mean = inertial(warm_log, fitted.curve.at(None))
    errors = [np.abs(one.estimate.values - described(one)).max() for one in (warm, mean)]
    assert errors[1] > 10 * errors[0]
    bare = replace(warm_log, temperature=None)
    asked = inertial(bare, fitted.curve, temperature=(40.0,))
    np.testing.assert_array_equal(asked.estimate.values, warm.estimate.values)
    unknown = inertial(bare, fitted.curve)
    np.testing.assert_array_equal(unknown.estimate.values, mean.estimate.values)
    assert any("not known: taken at its reference, 32.3" in note for note in unknown.prepared[0].notes)
    constant = inertial(bare, TRUTH.at(30.0), temperature=(30.0,))
    assert any("no friction curve depends on temperature" in note for note in constant.prepared[0].notes)


def drifting(log: Log, warm: dict[str, Warm]) -> Log:
    """A log whose three joints warm up one by one, with what that does to friction, drive by drive."""
    C = irp6().transmission.coupling[:3, :3]
    dz = log.dq @ C.T
    temperature = np.linspace([20.0, 25.0, 30.0], [30.0, 45.0, 28.0], log.count)
    effort = log.effort.copy()
    for k, curve in enumerate(warm.values()):
        slope = curve.forward
        change = (temperature[:, k] - curve.reference) * (slope.coulomb * np.sign(dz[:, k]) + slope.viscous * dz[:, k])
        effort += np.outer(change, C[k])
    return replace(log, effort=effort, temperature=temperature)


@pytest.mark.parametrize("model", ["differential", "energy"])
def test_friction_is_subtracted_at_the_temperature_of_each_sample(model: str) -> None:
    three = list(curves().items())[:3]
    warm = {name: Warm(curve, 30.0 + k, Slope(-0.2 * k - 0.1, 0.3)) for k, (name, curve) in enumerate(three)}
    task, plain = TASK.changed(model=model), played(three_joints(), 3, 500.0)
    log = drifting(plain, warm)
    result = found(task, log, friction=FrictionCurves(warm))
    exact = found(task, plain, friction=FrictionCurves(curves()))
    np.testing.assert_allclose(result.estimate.values, exact.estimate.values, rtol=1e-6, atol=1e-5)
    if model == "differential":
        given = (result.target, result.prepared[0], result.recipe, result.estimate.coefficients)
        np.testing.assert_allclose(prediction(*given, FrictionCurves(warm)).predicted, log.effort, atol=1e-3)


def test_a_simulated_robot_has_the_friction_of_its_temperature() -> None:
    one = simulated((40.0, 30.0, 20.0), (0.3, 0.1), seed=0)
    np.testing.assert_array_equal(one.log.temperature, np.tile([40.0, 30.0, 20.0], (one.log.count, 1)))
    assert (one.truth["F2c"], one.truth["F2v"]) == pytest.approx((20.0 + 0.5 * 2.3, 26.0 + 0.4 * 2.3))
    assert "friction of z2 is taken at 30 deg C" in one.notes
    cold = simulated(None, (0.3, 0.1), seed=0)
    assert cold.log.temperature is None
    assert cold.truth["F2c"] == 20.0
    assert any("not known: taken at its reference, 32.3 deg C" in note for note in cold.notes)


@pytest.mark.parametrize("temperature", [None, (40.0,)])
def test_speeds_beyond_a_table_are_told(temperature: tuple[float, ...] | None) -> None:
    """In a simulation, at one temperature and under a load."""
    settings = SimulationSettings(rate=RATE, torque_limits=False, temperature=temperature)
    for fastest in (0.2, 0.5):
        table = Loaded(Warm(TableFriction([0.1, fastest], [15.0, 18.0]), 32.0, Slope(-0.1)), 0.02)
        course = motion((0.3, 0.1), start=-0.1)
        notes = simulate_motion(irp6(), ARM, course, settings, friction=FrictionCurves({"z2": table})).notes
        told = [note for note in notes if note.endswith("faster than its table; its last value was used")]
        assert len(told) == (fastest == 0.2)
        assert all(60 < int(note.removeprefix("friction of z2: ").split()[0]) < 110 for note in told)


def points(curve: Callable[[Array, Array], Array], noise: float = 0.05) -> list[Point]:
    rng = np.random.default_rng(3)
    v = np.tile(np.r_[0.1, 0.3, 0.6, -0.1, -0.3, -0.6], 9)
    temperature = np.repeat([20.0, 32.0, 45.0], 18)
    torque = curve(v, temperature) + rng.normal(0.0, noise, v.size)
    return [Point(*row, 0.05, 0.0, 0.3, 0, warm) for *row, warm in zip(v, torque, temperature, strict=True)]


def both_ways() -> tuple[Form, ...]:
    return tuple(form for T in (None, 32.0) for form in forms("coulomb-viscous", None, offset=True, temperature=T))


def test_temperature_that_does_not_matter_is_left_out_and_so_is_what_is_no_friction() -> None:
    best, others, _ = chosen_fit(points(lambda v, T: 20 * np.sign(v) + 26 * v), both_ways(), "bic")
    assert best.form.name == "coulomb-viscous"
    assert len(others) == 4
    assert isinstance(best.curve, CoulombViscous)
    warm = points(lambda v, T: (1.0 - 0.1 * (T - 32)) * np.sign(v) + 26 * v)
    best, _, failed = chosen_fit(warm, both_ways(), "bic")
    assert best.form.temperature is None
    assert "coulomb must be zero or more" in failed["coulomb-viscous, linear in temperature"]
    assert "at 45 deg C; it was measured from 20 to 45 deg C" in failed["coulomb-viscous, linear in temperature"]


IDENTIFY = ("identify", "irp6", "--drives", "2", "--rows", "all", "--out", "res", "--force")


@pytest.mark.slow
def test_the_commands_from_fit_to_verification(logs: list[Log], warm_log: Log, here: Here) -> None:
    for log in logs:
        write_log(log, here.cwd / log.source)
    np.testing.assert_array_equal(read_log(here.cwd / "run1.csv").temperature, np.full((logs[1].count, 3), 32.0))
    write_log(warm_log, here.cwd / "warm.csv")
    write_log(replace(warm_log, temperature=None), here.cwd / "bare.csv")
    ended = here.run("friction", "fit", "irp6", *(log.source for log in logs), "--drives", "z2", "-v", "--out", "fit")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "coulomb temperature" in ended.stdout
    curve = read_friction(here.cwd / "fit" / "friction.yaml").curve("z2")
    assert isinstance(curve, Warm)
    assert curve.forward.coulomb == pytest.approx(-0.5, abs=0.02)
    errors = []
    for more in (("warm.csv",), ("bare.csv", "--temperature", "40")):
        here.run(*IDENTIFY, "--friction-curves", "fit/friction.yaml", "--json", *more, status=0)
        content = json.loads((here.cwd / "res" / "result.json").read_text())
        assert content["recipe"]["temperature"] == ([40.0] if more[1:] else None)
        errors.append(content["prediction_error"])
    assert errors[1] == errors[0] < 0.1
    verify = ("verify", "res", "--training-too", "--out", "told", "--json")
    (told,) = json.loads(here.run(*verify, "run2.csv").stdout)
    assert "friction of z2 is taken at 45 deg C" in told["remarks"]
    assert told["motions"][1]["relative"] < 0.05
    assert "55 deg C, which is extrapolated" in here.run(*verify, "bare.csv", "--temperature", "55").stdout


def test_identify_refuses_temperatures(warm_log: Log, here: Here) -> None:
    write_log(replace(warm_log, temperature=None), here.cwd / "bare.csv")
    write_friction(FrictionCurves({"z2": TRUTH}), here.cwd / "f.yaml")
    for temperature, message in (
        ("40,41", "temperature needs one value, or 3, one per joint of q1, q2, q3; given 2"),
        ("140", "z2: friction: coulomb must be zero or more, given -33.85 at 140 deg C"),
    ):
        given = ("bare.csv", "--friction-curves", "f.yaml", "--temperature", temperature)
        assert message in here.refused(*IDENTIFY, *given)
    without = "--temperature is for known friction, but no friction curves are given; give --friction-curves"
    assert without in here.refused(*IDENTIFY, "bare.csv", "--temperature", "30")


def test_simulations_refuse() -> None:
    for temperature, message in (
        ((20.0, 30.0), "temperature needs one value, or 3, one per joint; given 2"),
        ((np.nan,), "`temperature` must be a number from -273.15 to 10000 deg C, given nan"),
        ((140.0,), "z2: friction: coulomb must be zero or more"),
    ):
        assert re.search(message, refusal(simulated, temperature, (0.3, 0.1), seed=0))


def test_one_temperature_column_is_that_of_all_joints(tmp_path: Path) -> None:
    path = text_file(tmp_path / "log.csv", "time,a.position,b.position,temperature\n0,1,2,20\n1,1,2,21\n")
    log = read_log(path)
    np.testing.assert_array_equal(log.temperature, [[20.0, 20.0], [21.0, 21.0]])
    assert log.left_out == ()
    path.write_text("time,a.position,b.position,a.temperature\n0,1,2,20\n1,1,2,21\n", encoding="utf-8")
    assert "but not b.temperature; give one column 'temperature' for all joints" in refusal(read_log, path)
    header = "time,temperature,a.position,a.temperature,b.position,b.temperature"
    path.write_text(f"{header}\n0,9,1,20,2,30\n1,9,1,20,2,30\n", encoding="utf-8")
    np.testing.assert_array_equal(read_log(path).temperature, [[20.0, 30.0]] * 2)
