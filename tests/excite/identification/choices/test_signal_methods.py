"""Choice of the method from positions to accelerations: another where it is right, the low-pass where it is not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from motions import Sines
from played import noisy, periodic, played, three_joints

import excite
from excite.identification.choices.left_out import Choice
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.identification.result_json import load_result
from excite.logs.log import Log
from excite.logs.signals.savitzky_golay import SavitzkyGolay
from excite.logs.signals.smoothing_spline import SmoothingSpline

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


@pytest.mark.parametrize("kind", ["repeated", "not repeated"])
@pytest.mark.parametrize("velocities", [False, True])
def test_the_low_pass_stays_where_nothing_is_clearly_better(kind: str, velocities: bool) -> None:
    result = found(kind, coarse=False, velocities=velocities)
    choice = choice_of(result)
    assert choice.value == "butterworth"
    assert result.recipe == replace(Recipe(), cutoff=result.recipe.cutoff, **timing_of(result))
    assert ("fourier" in [c.value for c in choice.candidates]) == (kind == "repeated")
    assert ("measured velocity" in [c.value for c in choice.candidates]) == velocities


def timing_of(result: Identification) -> dict[str, object]:
    return {name: getattr(result.recipe, name) for name in ("sign_width", "breakaway")}


def test_good_velocities_are_used_beside_coarse_positions() -> None:
    result = found("not repeated", coarse=True, velocities=True)
    assert choice_of(result).value == "measured velocity"
    assert result.recipe.measured_velocity
    assert "`measured_velocity`" in choice_of(result).reason
    unseen = log_of("not repeated", coarse=True, velocities=True, seed=2)
    plain = excite.identify(
        "irp6", log_of("not repeated", coarse=True, velocities=True), choose=("cutoff",), estimator="weighted"
    )
    assert excite.verify(result, unseen).relative_error < 0.8 * excite.verify(plain, unseen).relative_error


def test_velocities_that_lag_are_not_used() -> None:
    log = log_of("not repeated", coarse=False, velocities=True)
    assert log.dq is not None
    late = replace(log, dq=np.vstack([log.dq[:1]] * 6 + [log.dq[:-6]]), sha256="late")
    result = excite.identify("irp6", late, choose=("cutoff", "signals"))
    assert not result.recipe.measured_velocity


def test_what_repeats_itself_is_fitted_by_a_series(tmp_path) -> None:
    result = found("repeated", coarse=True)
    assert choice_of(result).value == result.recipe.signals == "fourier"
    assert [c.value for c in choice_of(result).candidates] == ["butterworth", "savitzky-golay", "spline", "fourier"]
    result.save(tmp_path / "out")
    stored = load_result(tmp_path / "out")
    assert stored.recipe == result.recipe
    unseen = log_of("not repeated", coarse=False, seed=3)
    judged = excite.verify(stored, unseen)  # the cutoff is kept for such logs
    assert any("does not repeat itself: positions are low-passed instead" in note for note in judged.log.notes)
    assert judged.relative_error < 0.05


def test_logs_without_velocities_are_low_passed() -> None:
    judged = excite.verify(
        found("not repeated", coarse=True, velocities=True), log_of("not repeated", coarse=True, seed=4)
    )
    assert any("no velocities were measured: positions are low-passed" in note for note in judged.log.notes)


@pytest.mark.parametrize(
    "given", [{"signals": "butterworth"}, {"measured_velocity": False}, {"harmonics": None}, {"period": None}]
)
def test_what_is_given_is_kept(given: dict[str, object]) -> None:
    result = excite.identify("irp6", log_of("repeated", coarse=True), choose=("cutoff", "signals"), **given)
    assert not [choice for choice in result.choices if choice.name == "signals"]
    assert result.recipe.signals == "butterworth"


@pytest.mark.parametrize("cutoff", [4.0, 10.0, 30.0])
def test_methods_have_the_bandwidth_that_is_given(cutoff: float) -> None:
    time = np.arange(2000) / 500.0
    for method in (SavitzkyGolay(cutoff=cutoff), SmoothingSpline(cutoff=cutoff)):
        kept = []
        for frequency in (0.5 * cutoff, 2 * cutoff):
            wave = np.sin(2 * np.pi * frequency * time)[:, None]
            kept.append(float(method.motion(time, wave).samples.q.std() / wave.std()))
        assert kept[0] == pytest.approx(1.0, abs=0.03)
        assert kept[1] < 0.3
