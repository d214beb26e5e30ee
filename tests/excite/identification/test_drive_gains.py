"""Drive gains from a load of known mass: planted gains come back, and what is identified with them is true."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from observed import observations_of
from played import EXACT, LOAD, irp6, noisy, periodic, played
from recordings import MAPPING, REAL

from excite.identification.drive_gains import drive_gains
from excite.identification.identification import Identification
from excite.identification.identify import identify as identify_by_choice
from excite.identification.observations import Observations
from excite.identification.preparation import correction
from excite.identification.result_json import load_result, result_content
from excite.logs.log import Log
from excite.logs.mapping import read_mapping
from excite.tasks.task import Task
from excite.verification.verify import verify
from regressors.errors import InputError, UnknownName
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.inertia import from_centre_of_mass
from regressors.samples import Array

R, P, INSTANTS = 3, 5, 120
MASS = 2.5
THREE_GAINS = np.array([1.1, 0.9, 1.25])
NOISE = np.array([0.05, 0.2, 0.02])


def experiment(gains: Array, noise: float, seed: int) -> tuple[Observations, Array]:
    """Half of the instants with the load; what is measured are torques over the gains, with noise."""
    truth = np.random.default_rng(99)
    W, K = truth.normal(size=(INSTANTS, R, P)), truth.normal(size=(INSTANTS, R, 10))
    K[: INSTANTS // 2] = 0.0
    beta, phi = truth.normal(size=P), np.concatenate([[MASS], 0.3 * truth.normal(size=9)])
    e = noise * NOISE * np.random.default_rng(seed).normal(size=(INSTANTS, R))
    y = (W @ beta + K @ phi) / gains + e
    observations = observations_of(W.reshape(-1, P), y.ravel(), equations=R)
    return observations, K.reshape(-1, 10)


@pytest.mark.parametrize("common", [False, True])
def test_planted_gains_come_back(common: bool) -> None:
    """A wrong mass scales everything alike."""
    gains = np.full(R, 1.3) if common else THREE_GAINS
    observations, K = experiment(gains, 1e-6, 0)
    for wrong in (1.0, 2.0):
        factor, deviation, _ = drive_gains(observations, K, wrong * MASS, common=common)
        np.testing.assert_allclose(factor, wrong * gains, rtol=1e-6)
    assert not common or np.ptp(factor) == np.ptp(deviation) == 0.0


@pytest.mark.parametrize("common", [False, True])
def test_the_stated_deviation_is_that_of_repeated_experiments(common: bool) -> None:
    gains = np.full(R, 2.0) if common else 2.0 * THREE_GAINS
    found = [drive_gains(*experiment(gains, 1.0, seed), MASS, common=common) for seed in range(200)]
    factors, stated, _ = map(np.array, zip(*found, strict=True))
    np.testing.assert_allclose(stated.mean(axis=0), factors.std(axis=0), rtol=0.2)
    # no bias beyond the square of the noise
    assert np.all(np.abs(factors.mean(axis=0) - gains) < 4 * stated.mean(axis=0) / np.sqrt(200) + 1e-4)


def test_what_does_not_show_the_gains_is_refused() -> None:
    observations, K = experiment(THREE_GAINS, 0.1, 0)
    for mass in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match=f"must be a positive number of kilograms, given {mass}"):
            drive_gains(observations, K, mass, common=True)
    with pytest.raises(InputError, match="no row is of a motion with the load"):
        drive_gains(observations, np.zeros_like(K), MASS, common=True)
    third = observations.equation == 2
    W, y = observations.W.copy(), observations.y.copy()
    W[third], K[third], y[third] = 0.0, 0.0, np.random.default_rng(0).normal(size=third.sum())
    with pytest.raises(InputError, match="the drive gains are not identifiable from the motion"):
        drive_gains(observations_of(W, y, equations=R), K, MASS, common=False)


identify = partial(identify_by_choice, choose=False)
RECIPE = replace(EXACT, sign_width=0.0, breakaway=0.0)
TASK = Task("irp6", joints=("1", "2", "3", "4", "5"))
GAINS = {"z1": 1.1, "z2": 0.9, "z3": 1.05, "z4": 1.2, "z5": 0.95}


HEAVY = from_centre_of_mass(5.0, [0.2, 0.15, 0.25], 0.05 * np.eye(3))  # beside the last axis


@cache
def truth(loaded: bool) -> Log:
    motion = periodic(np.eye(5), 1, size=0.3)
    return played(motion, 5, 100.0, 8.0, load=HEAVY if loaded else None, source="LOADED" if loaded else "BARE")


def stated(loaded: bool, gains: dict[str, float], noise: float, seed: int) -> Log:
    """What is recorded with the gains as stated: torques less their factors, with noise correlated in time."""
    log, rng = truth(loaded), np.random.default_rng([seed, loaded])
    e = rng.normal(size=log.effort.shape)
    for k in range(1, len(e)):
        e[k] = 0.9 * e[k - 1] + np.sqrt(1 - 0.9**2) * e[k]
    wrong = np.linalg.inv(correction(irp6(), gains))
    return replace(log, effort=log.effort @ wrong.T + noise * e, sha256=f"{log.sha256} {seed}")


def calibrated(
    gains: dict[str, float], noise: float = 0.0, seed: int = 0, kind: str = "each", **more: object
) -> Identification:
    bare, loaded = (stated(carries, gains, noise, seed) for carries in (False, True))
    options = {"known_mass": HEAVY[0], "recipe": RECIPE, **more}
    return identify(TASK, bare, loaded=loaded, gains=kind, **options)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["each", "common"])
def test_planted_gains_come_back_and_the_parameters_are_true(kind: str, tmp_path: Path) -> None:
    gains = GAINS if kind == "each" else dict.fromkeys(GAINS, 1.09)
    result = calibrated(gains, 1e-4, kind=kind)
    assert result.calibration.factors == pytest.approx(gains, rel=1e-4)
    right = identify(TASK, truth(False), recipe=RECIPE)
    np.testing.assert_allclose(result.estimate.values, right.estimate.values, rtol=1e-2, atol=1e-2)
    assert result_content(right)["drive_gains"] is None
    assert any(note.startswith("the stated drive gains are off; measured torques") for note in result.estimate.notes)
    result.save(tmp_path)
    content = json.loads((tmp_path / "result.json").read_text())["drive_gains"]
    assert content["drives"]["z2"]["factor"] == pytest.approx(gains["z2"], rel=1e-4)
    assert content["known_mass"] == 5.0
    other = replace(stated(False, gains, 1e-4, 5), source="OTHER")
    assert verify(load_result(tmp_path), other).relative_error < 1e-3  # its torques are corrected too


def test_intervals_allow_for_the_gains() -> None:
    with_gains, without = calibrated(GAINS, 0.5), identify(TASK, stated(False, GAINS, 0.5, 0), recipe=RECIPE)
    assert np.all(with_gains.estimate.deviation[:8] > 1.02 * without.estimate.deviation[:8])


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    """Under noise that is correlated in time."""
    hits = []
    for seed in range(50):
        calibration = calibrated(GAINS, 0.5, seed).calibration
        hits.append(np.abs(calibration.factor - list(GAINS.values())) <= calibration.half_width)
    assert np.mean(hits) > 0.97
    assert np.min(np.mean(hits, axis=0)) > 0.93


def test_what_cannot_be_calibrated_is_refused() -> None:
    for changes, message in (
        ({"known_mass": None}, "give `known_mass`"),
        ({"known_mass": -1.0}, "`known_mass` must be a number from 1e-09 to 1e.09 kg, given -1"),
        ({"loaded": ()}, "give them as `loaded`"),
        ({"loaded": truth(False)}, "the same log is given with and without the load"),
        ({"gains": "some"}, "no kind of gains named 'some'"),
        ({"friction_curves": FrictionCurves({"z1": CoulombViscous(1.0)})}, "leave out `friction_curves`"),
        ({"model": "energy"}, "differential model"),
    ):
        given = {"loaded": truth(True), "known_mass": 5.0, "recipe": RECIPE, **changes}
        with pytest.raises(InputError, match=message):
            identify(TASK.changed(model=given.pop("model", "differential")), truth(False), **given)
    for factors, error, message in (
        ({"z9": 1.1}, UnknownName, "no drive named 'z9'"),
        ({"z1": 0.0}, InputError, "that of z1 must be a number from 1e-06 to 1000000, given 0"),
    ):
        with pytest.raises(error, match=message):
            identify(TASK, truth(False), recipe=RECIPE, torque_factors=factors)
    motion = periodic(np.eye(5), 1)  # the load's centre is on the last axis, which is hardly accelerated
    loaded = noisy(played(motion, 5, 100.0, 8.0, load=LOAD, source="LOADED"), 0.3, 0.0, 0)
    bare = noisy(played(motion, 5, 100.0, 8.0), 0.3, 0.0, 1)
    with pytest.raises(InputError, match=r"the load hardly acts on z5: .*`gains='common'`"):
        identify(TASK, bare, loaded=loaded, known_mass=LOAD[0], recipe=RECIPE)


def test_factors_that_are_known_are_applied() -> None:
    """And are of drives: through the coupling, of drive torques."""
    result = identify(TASK, stated(False, GAINS, 0.0, 0), recipe=RECIPE, torque_factors=GAINS)
    right = identify(TASK, truth(False), recipe=RECIPE)
    np.testing.assert_allclose(result.estimate.values, right.estimate.values, rtol=1e-8, atol=1e-8)


@pytest.mark.slow
@pytest.mark.skipif(not REAL.exists(), reason="the logs of the UR10e are not here")
def test_the_gains_of_a_ur10e_are_nine_per_cent_off() -> None:
    logs = [REAL / f"ur-20_01_31-{name}.csv" for name in ("unload", "load")]
    result = identify(
        str(REAL / "ur10e.urdf"), logs[0], loaded=logs[1], known_mass=2.805, gains="common",
        mapping=read_mapping(MAPPING), joint_rotors=True, offset=True,
    )  # fmt: skip
    calibration = result.calibration
    assert calibration.stated_mass == pytest.approx(3.06, abs=0.03)
    assert calibration.factor[0] == pytest.approx(0.915, abs=0.01)
    assert 0.02 < calibration.half_width[0] < 0.06
