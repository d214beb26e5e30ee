"""Choice of the method from positions to accelerations, and of friction subtracted as given or scaled."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from motions import Sines
from played import curves, described, noisy, periodic, played, three_joints
from written_files import saved

import excite
from excite.identification.choices.left_out import Choice
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.identification.result_json import load_result
from excite.logs.log import Log
from excite.logs.signals.filters import SavitzkyGolay
from excite.logs.signals.series import SmoothingSpline
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.uncertainty import multiplied

COARSE = 1e-3  # steps of the positions [rad]


def uneven(seed: int) -> Sines:
    """A motion that does not repeat itself."""
    motion = three_joints(seed)
    frequency = motion.frequency * np.sqrt([1.0, 1.13, 1.27, 1.41, 1.59, 1.73])[: motion.frequency.shape[-1]]
    return Sines(motion.centre, motion.amplitude, frequency, motion.phase)


@cache
def log_of(kind: str, *, coarse: bool, velocities: bool = False, seed: int = 1) -> Log:
    """A log with positions in steps or nearly exact, with velocities that were measured on their own or none."""
    motion = periodic(np.eye(5)[:3], seed) if kind == "repeated" else uneven(seed)
    true = played(motion, 3, 200.0, 8.0)
    rng = np.random.default_rng(seed)
    q = true.q + (COARSE * rng.standard_normal(true.q.shape) if coarse else 0.0)
    dq = None if not velocities or true.dq is None else true.dq + 1e-4 * rng.standard_normal(true.q.shape)
    return replace(noisy(true, 0.2, 0.0, seed), q=q, dq=dq, sha256=f"{kind} {coarse} {velocities} {seed}")


@cache
def found(kind: str, *, coarse: bool, velocities: bool = False) -> Identification:
    return excite.identify("irp6", log_of(kind, coarse=coarse, velocities=velocities), choose=("cutoff", "signals"))


def choice_of(result: Identification) -> Choice:
    (choice,) = [choice for choice in result.choices if choice.name == "signals"]
    return choice


@pytest.mark.parametrize(("kind", "velocities"), [("repeated", False), ("not repeated", True)])
def test_the_low_pass_stays_where_nothing_is_clearly_better(kind: str, velocities: bool) -> None:
    result = found(kind, coarse=False, velocities=velocities)
    choice = choice_of(result)
    assert choice.value == "butterworth"
    timing = {name: getattr(result.recipe, name) for name in ("sign_width", "breakaway")}
    assert result.recipe == replace(Recipe(), cutoff=result.recipe.cutoff, **timing)
    candidates = [c.value for c in choice.candidates]
    assert ("fourier" in candidates) == (kind == "repeated")
    assert ("measured velocity" in candidates) == velocities


def test_good_velocities_are_used_beside_coarse_positions() -> None:
    result = found("not repeated", coarse=True, velocities=True)
    assert choice_of(result).value == "measured velocity"
    assert result.recipe.measured_velocity
    assert "`measured_velocity`" in choice_of(result).reason
    unseen = log_of("not repeated", coarse=True, velocities=True, seed=2)
    log = log_of("not repeated", coarse=True, velocities=True)
    plain = excite.identify("irp6", log, choose=("cutoff",), estimator="weighted")
    assert excite.verify(result, unseen).relative_error < 0.8 * excite.verify(plain, unseen).relative_error
    judged = excite.verify(result, log_of("not repeated", coarse=True, seed=4))
    assert any("no velocities were measured: positions are low-passed" in note for note in judged.log.notes)


def test_velocities_that_lag_are_not_used() -> None:
    log = log_of("not repeated", coarse=False, velocities=True)
    late = replace(log, dq=np.vstack([log.dq[:1]] * 6 + [log.dq[:-6]]), sha256="late")
    result = excite.identify("irp6", late, choose=("cutoff", "signals"))
    assert not result.recipe.measured_velocity


def test_what_repeats_itself_is_fitted_by_a_series(tmp_path) -> None:
    result = found("repeated", coarse=True)
    assert choice_of(result).value == result.recipe.signals == "fourier"
    assert [c.value for c in choice_of(result).candidates] == ["butterworth", "savitzky-golay", "spline", "fourier"]
    stored = load_result(saved(tmp_path / "out", result))
    assert stored.recipe == result.recipe
    unseen = log_of("not repeated", coarse=False, seed=3)
    judged = excite.verify(stored, unseen)  # the cutoff is kept for such logs
    assert any("does not repeat itself: positions are low-passed instead" in note for note in judged.log.notes)
    assert judged.relative_error < 0.05


def test_methods_have_the_bandwidth_that_is_given() -> None:
    time = np.arange(2000) / 500.0
    for cutoff in (4.0, 10.0, 30.0):
        for method in (SavitzkyGolay(cutoff=cutoff), SmoothingSpline(cutoff=cutoff)):
            waves = [np.sin(2 * np.pi * frequency * time)[:, None] for frequency in (0.5 * cutoff, 2 * cutoff)]
            low, high = (float(method.motion(time, wave).samples.q.std() / wave.std()) for wave in waves)
            assert low == pytest.approx(1.0, abs=0.03)
            assert high < 0.3


CHOOSE = ("cutoff", "friction_scale")


@cache
def clean_log() -> Log:
    return noisy(played(three_joints(), 3, 200.0, 8.0), 0.2, 1e-6, 1)


def stated(**factors: float) -> FrictionCurves:
    """The curves of the robot, some times a factor."""
    return FrictionCurves({name: multiplied(curve, factors.get(name, 1.0)) for name, curve in curves().items()})


@cache
def right() -> Identification:
    return with_curves(stated())


def with_curves(friction: FrictionCurves, **options: object) -> Identification:
    return excite.identify("irp6", clean_log(), friction_curves=friction, **{"choose": CHOOSE, **options})


def scaling_of(result: Identification) -> Choice:
    (choice,) = [choice for choice in result.choices if choice.name == "friction_scale"]
    return choice


def test_curves_that_are_right_are_subtracted_as_given() -> None:
    assert scaling_of(right()).value is right().recipe.friction_scale is False
    assert right().friction_scale is None
    assert "subtracted as given" in scaling_of(right()).reason
    some = {"joints": ("1", "2", "3"), "friction_curves": stated(), "choose": CHOOSE}
    assert excite.identify("irp6", clean_log().of(["q1", "q2", "q3"]), **some).friction_scale is None


@pytest.mark.parametrize("factor", [pytest.param(0.5, marks=pytest.mark.slow), 1.25])
def test_curves_of_another_day_are_scaled(factor: float) -> None:
    """Not those of drives at rest."""
    result = with_curves(stated(z1=factor, z3=factor, z4=2.0))
    assert scaling_of(result).value is result.recipe.friction_scale is True
    assert [candidate.value for candidate in scaling_of(result).candidates] == [False, True]
    expected = {"z1": 1 / factor, "z2": 1.0, "z3": 1 / factor}
    assert result.friction_scale.factors == pytest.approx(expected, rel=0.01)
    beta = right().coefficients
    np.testing.assert_allclose(result.coefficients, beta, atol=0.01 * np.abs(beta).max())


def test_curves_a_little_wrong_are_scaled_where_that_brings_the_parameters_nearer() -> None:
    wrong = stated(z1=1.02, z3=1.02)
    chosen, kept = with_curves(wrong), with_curves(wrong, friction_scale=False)
    assert chosen.recipe.friction_scale is True
    off, off_as_given = (np.abs(result.coefficients / described(result) - 1).max() for result in (chosen, kept))
    assert off < 0.2 * off_as_given
