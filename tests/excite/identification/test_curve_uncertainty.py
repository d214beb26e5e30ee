"""Intervals of identified parameters that allow for the uncertainty of known friction curves."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.linalg
import scipy.stats
from commands import Here
from friction_curves import CURVES, KNOWN, uncertain
from friction_runs import run as friction_run
from played import EXACT, TASK, curves, found, noisy, played, three_joints

from excite.identification.allowances import curve_errors
from excite.identification.estimator import Context, Estimate
from excite.identification.estimators.least_squares import LeastSquares
from excite.identification.estimators.robust import huber
from excite.identification.identification import Identification
from excite.identification.observations import Observations
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.tasks.friction_file import friction_of
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import Loaded
from regressors.robot.friction.uncertainty import CurveUncertainty, changed
from regressors.samples import Array

DESCRIBED = {name: curve for name, curve in curves().items() if name in ("z1", "z2", "z3")}
OPEN = {name: uncertain(("coulomb", "viscous", "offset"), k, 0.4) for k, name in enumerate(DESCRIBED)}
PLAIN = replace(EXACT, sign_width=0.0, breakaway=0.0, covariance="white")


LEAST = replace(PLAIN, estimator="least-squares")


@cache
def log(seed: int = 3) -> Log:
    return noisy(played(three_joints(seed), 3), 0.5, 0.0, seed)


def identified(recipe: Recipe, known: dict | None = None) -> Identification:
    """Of one log, with the described curves, as uncertain as is said."""
    return found(TASK, log(), recipe=recipe, friction=FrictionCurves(DESCRIBED, OPEN if known is None else known))


def effect_of(result: Identification, friction: FrictionCurves, *logs: Log) -> tuple[Array, Array]:
    """Changes of the estimate per deviation, and their covariance."""
    measured = [replace(part, measured=log.effort) for part, log in zip(result.prepared, logs, strict=True)]
    context = Context(result.target, tuple(measured), result.recipe)
    changes, correlation = curve_errors(result.estimate, result.observations, context, friction.of(("z1", "z2", "z3")))
    return changes, changes @ correlation @ changes.T


def stepped(friction: FrictionCurves, step: Array) -> FrictionCurves:
    """Curves changed by so many deviations of each parameter, in the order of the effect."""
    found, first = {}, 0
    for name, known in friction.uncertainty.items():
        by = step[first : first + len(known.parameters)] * known.deviation
        first += len(by)
        found[name] = changed(friction.curve(name), dict(zip(known.parameters, by.tolist(), strict=True)))
    return FrictionCurves(found)


WARM, BOTH = replace(LEAST, temperature=(36.0,)), FrictionCurves(CURVES, KNOWN)


@pytest.mark.parametrize(
    ("model", "of", "friction", "tolerance"),
    [
        ("differential", WARM, BOTH, 1e-5),
        ("energy", WARM, BOTH, 1e-5),
        ("differential", replace(LEAST, low_pass=15.0, breakaway=0.001), BOTH, 1e-5),
        ("differential", replace(PLAIN, estimator="weighted"), FrictionCurves(DESCRIBED, OPEN), 0.02),
    ],
)
def test_changes_are_those_of_identifying_again(model, of, friction, tolerance) -> None:
    """Two logs, whose rows an error of the curves moves alike; tolerance in deviations by the curves."""
    task, logs = TASK.changed(model=model), (log(3), log(4))
    changes, covariance = effect_of(found(task, *logs, recipe=of, friction=friction), friction, *logs)
    step = 0.02 * np.random.default_rng(5).normal(size=changes.shape[1])
    ahead, behind = (found(task, *logs, recipe=of, friction=stepped(friction, way * step)) for way in (1, -1))
    difference = (ahead.estimate.values - behind.estimate.values) / 2
    assert np.all(np.abs(difference - changes @ step) < tolerance * 0.02 * np.sqrt(np.diag(covariance)))


def test_rows_beyond_the_threshold_of_huber_do_not_move_with_the_curves() -> None:
    """Oracle: estimates with the scale of the noise given; that of the median magnitude jumps from row to row."""
    friction, of = FrictionCurves(DESCRIBED, OPEN), replace(PLAIN, estimator="huber")
    result = found(TASK, log(), recipe=of, friction=friction)
    changes, covariance = effect_of(result, friction, log())
    step = 0.01 * np.random.default_rng(5).normal(size=changes.shape[1])
    ahead, behind = (
        huber(replace(again.observations, noise=result.estimate.noise)).values
        for again in (found(TASK, log(), recipe=of, friction=stepped(friction, way * step)) for way in (1, -1))
    )
    assert np.all(np.abs((ahead - behind) / 2 - changes @ step) < 0.05 * 0.01 * np.sqrt(np.diag(covariance)))


def test_the_added_covariance_is_that_of_the_curves() -> None:
    alone, result = identified(PLAIN, {}), identified(PLAIN)
    np.testing.assert_array_equal(result.estimate.values, alone.estimate.values)
    changes, added = effect_of(result, FrictionCurves(DESCRIBED, OPEN), log())
    slopes = changes / np.concatenate([known.deviation for known in OPEN.values()])
    of_curves = scipy.linalg.block_diag(*(known.covariance for known in OPEN.values()))
    np.testing.assert_allclose(added, slopes @ of_curves @ slopes.T, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(result.estimate.covariance - alone.estimate.covariance, added, atol=1e-10)
    ratio = result.estimate.deviation / alone.estimate.deviation
    assert ratio.max() > 2.0
    told = f"up to {ratio.max():.3g} times the deviation from the logs alone, of {result.names[ratio.argmax()]}"
    assert any(note.endswith(told) for note in result.estimate.notes)
    assert "intervals take the friction curves as exact" in alone.estimate.notes
    doubled = {n: CurveUncertainty(x.parameters, 4.0 * x.covariance) for n, x in OPEN.items()}
    np.testing.assert_allclose(effect_of(result, FrictionCurves(DESCRIBED, doubled), log())[1], 4 * added, rtol=1e-6)
    certain = {n: CurveUncertainty(x.parameters, 0.0 * x.covariance) for n, x in OPEN.items()}
    none = identified(PLAIN, certain).estimate
    np.testing.assert_array_equal(none.covariance, alone.estimate.covariance)
    assert any(note.endswith("uncertainty of the friction curves, which changes them little") for note in none.notes)


def test_what_is_at_a_bound_can_only_grow() -> None:
    bounded = {"z1": CoulombViscous(0.0, 26.0), "z2": Loaded(DESCRIBED["z2"], 0.0), "z3": DESCRIBED["z3"]}
    z1 = CurveUncertainty(("coulomb", "offset"), np.diag([0.04, 0.0]))
    z2 = CurveUncertainty(("load",), 1e-4 * np.eye(1))
    friction = FrictionCurves(bounded, {"z1": z1, "z2": z2})
    result = found(TASK, log(), recipe=LEAST, friction=friction)
    changes, _ = effect_of(result, friction, log())
    assert np.all(np.abs(changes[:, [0, 2]]).max(axis=0) > 1e-3)
    assert not np.any(changes[:, 1])
    assert any("those of z3 are taken as exact" in note for note in result.estimate.notes)


class Own(LeastSquares):
    """An estimator of the user's."""

    name = "own"

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        return replace(super().estimate(observations, context), method=self.name)


def test_a_method_for_which_it_is_not_known_says_so() -> None:
    result, exact = (identified(replace(PLAIN, estimator=Own()), known) for known in (OPEN, {}))
    np.testing.assert_array_equal(result.estimate.covariance, exact.estimate.covariance)
    assert any("leave out the uncertainty of the friction curves" in note for note in result.estimate.notes)


def test_it_is_added_to_a_covariance_of_correlated_residuals() -> None:
    wrong, added = {**DESCRIBED, "z1": CoulombViscous(20.0, 40.0)}, []
    for kind in ("white", "robust"):
        wide, alone = (
            found(TASK, log(), recipe=replace(PLAIN, covariance=kind), friction=FrictionCurves(wrong, known)).estimate
            for known in (OPEN, {})
        )
        added.append(wide.covariance - alone.covariance)
    assert any("Newey" in note for note in wide.notes)
    assert any("include the uncertainty" in note for note in wide.notes)
    np.testing.assert_allclose(added[0], added[1], atol=1e-9)


@pytest.mark.slow
def test_a_fit_s_file_widens_the_intervals_of_what_is_identified_with_it(here: Here) -> None:
    tmp_path = here.cwd
    write_log(friction_run(), tmp_path / "run.csv")
    fitted = here.run("friction", "fit", "irp6", "run.csv", "--out", "fit", "--json")
    (drive,) = json.loads(fitted.stdout)["characteristics"]
    text = (tmp_path / "fit" / "friction.yaml").read_text()
    known = friction_of(text, "fit").uncertainty["z2"]
    halves = [drive["fit"]["parameters"][name]["interval99"] for name in known.parameters]
    np.testing.assert_allclose(scipy.stats.norm.ppf(0.995) * known.deviation, halves, rtol=1e-9)
    (tmp_path / "exact.yaml").write_text(text[: text.index("    uncertainty:")])
    results = []
    for file in ("fit/friction.yaml", "exact.yaml"):
        arguments = ("identify", "irp6", "run.csv", "--drives", "2", "--rows", "all", "--force", "--out", "res")
        here.run(*arguments, "--friction-curves", file, status=0)
        results.append(json.loads((tmp_path / "res" / "result.json").read_text()))
    assert "exact" not in "".join(results[0]["notes"])
    assert "intervals include the uncertainty of the friction curves" in "".join(results[0]["notes"])
    for wide, narrow in zip(results[0]["parameters"], results[1]["parameters"], strict=True):
        assert wide["value"] == narrow["value"]
        assert wide["standard_deviation"] > narrow["standard_deviation"]
