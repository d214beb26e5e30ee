"""Payloads by the commands: motions, gains and loads from simulated logs, and what cannot be."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_chains import chain_model, inertia, tool_motion
from played import LOAD
from recordings import MAPPING, REAL
from refused import refusal
from written_files import assert_alike

import excite
from excite.payload.known_gains import read_gains, write_gains
from excite.payload.load_estimate import estimate_load
from excite.tasks.payload import Payload
from regressors.errors import InputError, TakenError
from regressors.models.load import PayloadModel
from regressors.readers.library import load_robot
from regressors.robot.inertia import from_centre_of_mass
from regressors.samples import Samples

POSE = (0.0, -0.4, 0.0, -2.0, 0.0, 1.8, 0.785)
PHI = from_centre_of_mass(1.5, [0.02, -0.01, 0.15], 1.5 * np.diag([0.003, 0.004, 0.002]))


@pytest.fixture(scope="module")
def played() -> SimpleNamespace:
    """One motion, played without and with a load, exact."""
    motion = excite.design_payload_motion("panda", 0.2, pose=POSE, period=3.0, harmonics=2)
    bare = excite.simulate(motion.design, rate=100.0)
    held = excite.simulate(motion.design, rate=100.0, load=Payload(PHI))
    return SimpleNamespace(motion=motion, bare=bare, held=held)


def noisy(simulation: Any, seed: int, gain: float = 1.0) -> excite.Log:
    log = simulation.measured
    sigma = 0.002 * load_robot("panda").limits.torque
    noise = sigma * np.random.default_rng(seed).normal(size=log.effort.shape)
    return replace(log, effort=log.effort / gain + noise, sha256=f"{seed}{log.sha256}")


@pytest.mark.parametrize("name", ["irp6", "panda", "ur10e"])
def test_the_payload_model_is_what_a_body_adds_to_the_inverse_dynamics(name: str) -> None:
    robot = load_robot(name)
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 5, robot.n))
    K = PayloadModel(robot).instants(Samples(np.arange(5.0), q, dq, ddq, np.zeros_like(q)))
    bare, loaded = chain_model(robot), chain_model(robot)
    loaded.appendBodyToJoint(loaded.njoints - 1, inertia(LOAD), pin.SE3.Identity())
    extra = [
        pin.rnea(loaded, loaded.createData(), *x) - pin.rnea(bare, bare.createData(), *x)
        for x in zip(q, dq, ddq, strict=True)
    ]
    np.testing.assert_allclose((K @ LOAD).reshape(-1, robot.n), extra, atol=1e-11)


@pytest.mark.slow
def test_the_motion_stays_in_its_box_and_is_at_rest_at_both_ends(played: Any) -> None:
    design, box = played.motion.design, played.motion.box
    assert design.feasible
    sides = np.array(box, dtype=float)
    np.testing.assert_allclose(np.diff(sides, axis=1), 0.2)
    samples = design.trajectory.samples(np.linspace(0.0, 3.0, 301))
    np.testing.assert_allclose(samples.dq[[0, -1]], 0.0, atol=1e-9)
    at, _ = tool_motion(load_robot("panda"), np.zeros(3), samples)
    assert np.all((at >= sides[:, 0] - 1e-9) & (at <= sides[:, 1] + 1e-9))


def test_the_load_is_found_from_a_pair_of_logs_and_read_back_as_written(played: Any, tmp_path: Path) -> None:
    pair = {"without": noisy(played.bare, 2), "gain_deviation": 0.0}
    result = excite.identify_payload("panda", noisy(played.held, 1), **pair, rated=1.0)
    assert result.mass == pytest.approx(1.5, rel=0.02)
    np.testing.assert_allclose(result.body.centre, [0.02, -0.01, 0.15], atol=0.005)
    low, high = result.intervals.T
    assert low[0] <= 1.5 <= high[0] < low[0] + 0.2  # drifts of gains and offsets between the logs
    assert result.doubts == ()
    assert any("warning: the load" in note for note in result.notes)
    files = result.save(tmp_path / "out")
    content = json.loads((tmp_path / "out" / "payload.json").read_text())["payload"]
    for name, shape in (("mass", ()), ("centre", (3,)), ("inertia", (3, 3))):
        assert np.shape(content[name]["value"]) == shape
        low, high = np.moveaxis(np.array(content[name]["interval"]), -1, 0)
        assert np.all(low <= content[name]["value"])
        assert np.all(content[name]["value"] <= high)
    names = {path.name for path in (tmp_path / "out").iterdir() if path.name[0] != "."}
    assert {path.name for path in files} == names - {"manifest.json"}
    with pytest.raises(TakenError):
        result.save(tmp_path / "out")
    read = excite.load(tmp_path / "out" / "payload.json")
    assert_alike(read, result)
    np.testing.assert_array_equal(read.intervals, result.intervals)


@pytest.mark.slow
def test_gains_from_a_known_mass_correct_another_load(played: Any, tmp_path: Path) -> None:
    pair = noisy(played.held, 3, gain=0.9), noisy(played.bare, 4, gain=0.9)
    found = excite.calibrate_gains("panda", *pair, 1.5, kind="common")
    np.testing.assert_allclose(found.gains.factor, 0.9, rtol=0.02)
    assert found.stated_mass == pytest.approx(1.5 / 0.9, rel=0.03)
    write_gains(found.gains, tmp_path / "gains.yaml", robot="panda", mass=1.5)
    known = read_gains(tmp_path / "gains.yaml")
    np.testing.assert_allclose(known.factor, found.gains.factor)
    np.testing.assert_allclose(known.covariance, found.gains.covariance, atol=1e-9)
    other = noisy(played.held, 5, gain=0.9), noisy(played.bare, 6, gain=0.9)
    result = excite.identify_payload("panda", other[0], without=other[1], gains=tmp_path / "gains.yaml")
    assert result.mass == pytest.approx(1.5, rel=0.03)
    with pytest.raises(TakenError):
        write_gains(found.gains, tmp_path / "gains.yaml", robot="panda", mass=1.5)


@pytest.mark.slow
def test_a_wrench_gives_the_load_and_the_frame_turns_it(played: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    wrench = played.held.wrench_log
    found = excite.identify_payload("panda", wrench, wrench=True)
    np.testing.assert_allclose(found.estimate.phi, PHI, atol=1e-5)
    there = excite.identify_payload("panda", played.held, without=played.bare, frame=(0, 0, 0.107), frame_name="flange")
    np.testing.assert_allclose(there.body.centre, [0.02, -0.01, 0.15 - 0.107], atol=1e-3)
    assert there.stated["frame"]["name"] == "flange"
    as_stated = lambda equations: replace(estimate_load(equations), covariance=np.eye(10))  # noqa: E731
    monkeypatch.setattr("excite.payload.identify_payload.estimate_load", as_stated)
    at_sensor = excite.identify_payload("panda", wrench, wrench=True, frame=(0, 0, 0.107))
    T = at_sensor.frame.to_link
    np.testing.assert_allclose(at_sensor.estimate.covariance, T @ T.T)


@pytest.mark.slow
def test_the_model_of_a_result_replaces_the_log_without_the_load(played: Any, tmp_path: Path) -> None:
    robot = excite.identify("panda", [noisy(played.bare, seed) for seed in (7, 9, 10, 11)], choose=False, offset=True)
    robot.save(tmp_path / "robot")
    for given in (robot, tmp_path / "robot"):
        held = [noisy(played.held, seed) for seed in (8, 12, 13, 14)]
        result = excite.identify_payload("panda", held, result=given, gain_deviation=0.0)
        low, high = result.intervals[0]
        assert 0.0 < low <= 1.5 <= high  # it shows that there is a load
    with pytest.raises(InputError, match=r"is of panda .*, not of ur10e"):
        excite.identify_payload("ur10e", noisy(played.held, 8), result=robot)


def test_what_does_not_fit_is_refused(played: Any) -> None:
    held, bare = noisy(played.held, 1), noisy(played.bare, 2)
    for change, message in (
        ({"without": ()}, "give a log `without` the load, or the `result`"),
        ({"without": held}, "the same log is given with and without"),
        ({"gain_deviation": 2.0}, "`gain_deviation` must be a number from 0 to 1"),
        ({"gains": "missing.yaml"}, "cannot read gains missing.yaml"),
        ({"frame": (0.0, 1.0)}, "`frame` needs x, y, z"),
        ({"gains": "missing.yaml", "gain_deviation": 0.1}, "give one of them"),
        ({"wrench": True, "gain_deviation": 0.1}, "leave out `gain_deviation`"),
        ({"result": "somewhere"}, "`without` and `result` both"),
    ):
        assert re.search(message, refusal(excite.identify_payload, "panda", held, **{"without": bare, **change}))
    wrong_way_round = excite.identify_payload("panda", bare, without=held)
    assert "which no load has" in wrong_way_round.doubts[0]


def test_motions_that_cannot_be_are_refused() -> None:
    for change, message in (
        ({"pose": (0.0,)}, "`pose` needs 7 finite numbers"),
        ({"pose": (9.0, *POSE[1:])}, "joint panda_joint1 at 9 is beyond its limits"),
        ({"pose": POSE, "box": ((2.0, 3.0), (None, None), (None, None))}, "the tool point has x = 0.4254 m"),
        ({"box": (1.0, 2.0)}, "`box` needs one side, or three"),
        ({"box": -1.0}, "lengths greater than zero"),
        ({"swing": (0.1, 0.2)}, "`swing` needs one number"),
        ({"centre": (0.0,)}, "`centre` needs three finite numbers"),
        ({"sensor": "camera"}, "sensor"),
    ):
        assert re.search(message, refusal(excite.design_payload_motion, "panda", change.pop("box", 0.2), **change))


def test_files_that_are_no_gains_are_refused(tmp_path: Path) -> None:
    one, file = "{a: {factor: 1, deviation: 1}}", tmp_path / "gains.yaml"
    for text in (
        "", "[]", f"schema: excite.gains/2\ndrives: {one}\n", "schema: excite.gains/1\ndrives: {}\n",
        *(f"schema: excite.gains/1\ndrives: {{a: {{factor: {factor}, deviation: {deviation}}}}}\n"
          for factor, deviation in ((-1, 0), (1, "1e300"), (1, -1), (".nan", 0))),
        f"schema: excite.gains/1\ndrives: {one}\ncorrelation: [[1, 2], [3]]\n",
        f"schema: excite.gains/1\ndrives: {one[:-1]}, b: {one[4:]}\ncorrelation: [[1, 5], [5, 1]]\n",
    ):  # fmt: skip
        file.write_text(text)
        assert "gains.yaml" in refusal(read_gains, file)


BARE, LOADED = REAL / "ur-20_01_31-unload.csv", REAL / "ur-20_01_31-load.csv"
recorded = pytest.mark.skipif(not REAL.exists(), reason="the logs of the UR10e are not here")


@pytest.mark.slow
@recorded
def test_the_mass_of_a_real_load_by_gains_from_the_other_half() -> None:
    rows = (("486:1558", "339:1412"), ("1558:2630", "1412:2485"))
    own, other = (excite.LogChoice(MAPPING, (), *each) for each in rows)
    gains = excite.calibrate_gains("ur10e", LOADED, BARE, 2.805, logs=own)
    result = excite.identify_payload("ur10e", LOADED, without=BARE, gains=gains.gains, logs=other)
    assert result.mass == pytest.approx(2.805, rel=0.04)
    low, high = result.intervals[0]
    assert low <= 2.805 <= high < low + 0.4


@pytest.mark.slow
@recorded
def test_gains_as_stated_leave_room_for_the_true_mass() -> None:
    result = excite.identify_payload("ur10e", LOADED, without=BARE, logs=excite.LogChoice(MAPPING))
    low, high = result.intervals[0]
    assert low <= 2.805 <= high
    assert any("stated drive gains are taken as known to 11 %" in note for note in result.notes)
