"""Benchmarks: the judge of the public one against brute force and laws, and what degrades logs."""

from __future__ import annotations

import importlib
import json
import shutil
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest
from commands import module_of

from excite.information.target import target_of
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.readers.library import load_robot
from regressors.samples import Samples

# The judge of the public benchmark, against brute force and laws, and its resumption, with systems that do nothing.


BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def peers() -> Iterator[Any]:
    """Imports a module of the benchmark by its plain name; the names are free again afterwards."""
    before, paths = set(sys.modules), list(sys.path)
    sys.path[:0] = [str(BENCHMARKS / "peers"), str(BENCHMARKS)]
    yield importlib.import_module
    sys.path[:] = paths
    for name in set(sys.modules) - before:
        if str(BENCHMARKS) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


# --- precision ------------------------------------------------------------------------------------------------------

TRIALS = 20_000


@pytest.fixture
def experiment() -> dict[str, Any]:
    """Thirty instants of two torques with correlated noise, three parameters, one of them about zero."""
    rng = np.random.default_rng(3)
    S = np.array([[0.9, 0.3], [0.3, 0.4]])
    return {
        "W": rng.normal(size=(60, 3)) * (1.0, 2.0, 0.8),
        "S": S,
        "whitening": np.linalg.inv(np.linalg.cholesky(S)),
        "values": np.array([2.0, 4.0, 0.01]),
        "units": ("kg", "kg m", "kg"),
    }


def estimates(experiment: dict[str, Any], runs: int, rng: np.random.Generator) -> np.ndarray:
    """Errors of generalised least squares over so many runs, the covariance written out, shape (TRIALS, 3)."""
    W = experiment["W"]
    weight = np.kron(np.eye(len(W) // 2), np.linalg.inv(experiment["S"]))
    gain = np.linalg.solve(runs * W.T @ weight @ W, W.T @ weight)
    total = np.zeros((TRIALS, 3))
    for _ in range(runs):
        noise = rng.multivariate_normal(np.zeros(2), experiment["S"], size=(TRIALS, len(W) // 2))
        total += noise.reshape(TRIALS, -1) @ gain.T
    return total


def test_intervals_hold_the_errors_of_simulated_runs(peers: Any, experiment: dict[str, Any]) -> None:
    robot_time = peers("robot_time")
    deviation = robot_time.deviations(experiment["W"], experiment["whitening"])
    scale = robot_time.scales(experiment["values"], experiment["units"])
    errors = np.abs(estimates(experiment, 3, np.random.default_rng(0))) / scale
    inside = np.mean(errors <= robot_time.relative_half_widths(deviation, scale, 3), axis=0)
    assert inside == pytest.approx(robot_time.CONFIDENCE, abs=4 * np.sqrt(0.99 * 0.01 / TRIALS))


def test_as_many_runs_are_enough_and_one_less_is_not(peers: Any, experiment: dict[str, Any]) -> None:
    robot_time = peers("robot_time")
    deviation = robot_time.deviations(experiment["W"], experiment["whitening"])
    scale = robot_time.scales(experiment["values"], experiment["units"])
    smallest = np.min(scale / deviation) * robot_time.SHARE / robot_time.Z  # so that 3.5 runs are wanted
    experiment = {**experiment, "S": experiment["S"] * 3.5 * smallest**2}
    whitening = np.linalg.inv(np.linalg.cholesky(experiment["S"]))
    deviation = robot_time.deviations(experiment["W"], whitening)
    runs = robot_time.runs_needed(deviation, scale)
    assert runs == 4
    for count, enough in ((runs, True), (runs - 1, False)):
        errors = np.abs(estimates(experiment, count, np.random.default_rng(count))) / scale
        assert (np.quantile(errors, robot_time.CONFIDENCE, axis=0).max() <= robot_time.SHARE) == enough
        assert (robot_time.share_reached(deviation, scale, count) == 1.0) == enough


def test_a_parameter_about_zero_is_measured_by_the_largest_of_its_unit(peers: Any) -> None:
    robot_time = peers("robot_time")
    scale = robot_time.scales(np.array([-2.0, 4.0, 0.01]), ("kg", "kg m", "kg"))
    assert scale == pytest.approx([2.0, 4.0, 2.0 * robot_time.FLOOR])


# --- limits and models ------------------------------------------------------------------------------------------------


def case_of(peers: Any, limits: Any) -> Any:
    size = limits[0][0].shape[1]
    nothing = {"columns": None, "whitening": np.eye(size), "names": (), "units": (), "values": np.zeros(0)}
    return peers("cases").Case(name="", title="", limits=limits, **nothing)


def quintic(peers: Any, way: np.ndarray, duration: float) -> Any:
    """From rest to rest: q = way (10 s^3 - 15 s^4 + 6 s^5)."""
    powers = np.array([6 / duration**5, -15 / duration**4, 10 / duration**3, 0.0, 0.0, 0.0])
    return peers("motion_forms").Pieces(np.array([0.0, duration]), powers[:, None, None] * way)


def test_use_of_limits_is_that_of_the_peaks_of_a_quintic(peers: Any) -> None:
    verdict, way, T = peers("verdict"), np.array([1.0, -0.6]), 2.0
    speed, acceleration = 15 / 8 / T, 10 / np.sqrt(3) / T**2  # peaks for a way of one
    coupled, far = np.array([[1.0, 1.0]]), np.full(2, 100.0)
    limits = (
        (np.eye(2), -far, far),
        (np.eye(2), -far, far),
        (coupled, -np.array([0.4 * acceleration / 0.8]), np.array([0.4 * acceleration / 0.8])),
    )
    motion = quintic(peers, way, T)
    assert verdict.limit_use(case_of(peers, limits), motion) == pytest.approx(0.8)
    tight = (limits[0], (np.eye(2), -far, np.array([speed / 1.25, 100.0])), limits[2])
    assert verdict.limit_use(case_of(peers, tight), motion) == pytest.approx(1.25)
    smaller = peers("motion_forms").drawn_together(motion, np.zeros(2), 1.25)
    assert verdict.limit_use(case_of(peers, tight), smaller) == pytest.approx(1.0)


def test_a_series_is_used_and_drawn_together_alike(peers: Any) -> None:
    verdict, motions = peers("verdict"), peers("motion_forms")
    plain = {"period": 10.0, "offset": [0.5], "cosine": [[0.3, -0.1]], "sine": [[0.2, 0.4]]}
    motion = motions.motion_of(plain)
    wide = np.array([100.0])
    limits = ((np.eye(1), np.array([-1.0]), np.array([0.6])), *[(np.eye(1), -wide, wide)] * 2)
    case = case_of(peers, limits)
    dense = motion.values(np.linspace(0, 10, 100_001), 0) + 0.2  # about the middle
    use = verdict.limit_use(case, motion)
    assert use == pytest.approx(np.abs(dense).max() / 0.8, rel=1e-8)
    assert verdict.limit_use(case, motions.drawn_together(motion, case.middle, use)) == pytest.approx(1.0)


def test_the_irp6_of_the_judge_is_that_of_the_description(peers: Any) -> None:
    target = target_of(load_robot("irp6"), Task("irp6"))
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 40, 3))
    ours = target.model.selected(Samples(np.arange(40.0), q, dq, ddq, ddq), target.base.index)
    names, values = peers("irp6_model").parameters()
    assert names == [target.model.columns[k].name for k in target.base.index]
    assert peers("irp6_model").regressor(q, dq, ddq) == pytest.approx(ours, abs=1e-12)
    described = dict(zip(names, values, strict=True))
    assert described["X7"] == pytest.approx(8.125, abs=2e-3)  # measured by [KD96], as is the next one
    assert described["F2v"] == 26.0


@pytest.mark.skipif(shutil.which("gcc") is None, reason="the rivals compile their regressors")
def test_exact_gradients_are_those_of_the_columns_of_the_judge(peers: Any, monkeypatch: Any, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)  # where CasADi compiles
    rivals, steps = peers("exact_gradients"), peers("baseline_slsqp").bases(100)
    x, G = rivals.information("P2")
    point, step = np.random.default_rng(0).normal(size=(2, x.numel()))
    W = peers("cases").case("P2").columns(*(basis @ point.reshape(6, -1).T for basis in steps))
    assert np.array(casadi.Function("G", [x], [G])(point)) == pytest.approx(W.T @ W / 100, abs=1e-12 * np.sum(W**2))
    value = rivals.stand_in(G, 32)
    both = casadi.Function("both", [x], [value, casadi.jtimes(value, x, casadi.DM(step))])
    exact = np.log(np.linalg.cond(W))
    assert exact - 1e-9 <= float(both(point)[0]) <= exact + np.log(W.shape[1]) / 32
    ends = [float(both(point + h * step)[0]) for h in (1e-6, -1e-6)]
    assert float(both(point)[1]) == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)


# --- resumption -------------------------------------------------------------------------------------------------------

WANTED = [{"case": "P1", "system": system, "seed": seed, "budget": 1.0} for system in "ab" for seed in (0, 1)]


def test_an_interrupted_benchmark_goes_on_where_it_stopped(peers: Any, tmp_path: Path) -> None:
    complete, file, made = peers("runs").complete, tmp_path / "runs.json", []

    def make(run: dict[str, Any]) -> dict[str, Any]:
        if len(made) == 3:
            made.append(None)
            raise KeyboardInterrupt
        made.append((run["system"], run["seed"]))
        return {"value": len(made)}

    def save(runs: list[dict[str, Any]]) -> None:
        file.write_text(json.dumps(runs))

    with pytest.raises(KeyboardInterrupt):
        complete(WANTED, [], make, save)
    first = json.loads(file.read_text())
    assert [run["value"] for run in first] == [1, 2, 3]
    complete(WANTED, first, make, save)
    runs = json.loads(file.read_text())
    assert runs[:3] == first
    assert [each for each in made if each] == [(run["system"], run["seed"]) for run in WANTED]


def test_a_run_that_failed_is_made_again_and_one_of_another_budget_is_another(peers: Any) -> None:
    failed, other = {**WANTED[0], "failure": "exit status 1"}, {**WANTED[0], "budget": 2.0, "value": 0}
    runs = peers("runs").complete(WANTED[:1], [failed, other], lambda run: {"value": 1}, lambda runs: None)
    assert sorted(run["value"] for run in runs) == [0, 1]


def test_no_module_of_the_peers_shadows_or_is_shadowed() -> None:
    names = [{path.name for path in folder.glob("*.py")} for folder in (BENCHMARKS, BENCHMARKS / "peers")]
    assert set.intersection(*names) == set()


def test_a_system_that_fails_is_told_and_stops_nothing(peers: Any) -> None:
    found = peers("runs").motion({**WANTED[0], "system": "none of these"}, sys.executable)
    assert found == {"failure": "exit status 1"}


# Logs that a benchmark degrades: what each degradation does to a log, and what it leaves alone.


SPOIL = module_of(BENCHMARKS / "degradation" / "spoil.py")
Degradation, degrade = SPOIL.Degradation, SPOIL.degrade
RATE = 1000.0
FRICTION = np.tile([2.0, -3.0], (2001, 1))


@cache
def clean() -> Log:
    """Two joints for 2 s at 1 kHz; every number of a channel is another one."""
    time = np.arange(2001) / RATE
    q = np.column_stack([np.sin(3 * time), np.cos(2 * time)])
    return Log("LOG", "", ("a", "b"), time, q, 2 * q, 10 * q + time[:, None], temperature=30 + q)


def degraded(seed: int = 0, **options: Any) -> Log:
    return degrade(clean(), Degradation(**options), seed, FRICTION)


def channels(log: Log) -> np.ndarray:
    return np.column_stack([log.q, log.dq, log.effort, log.temperature])


def test_nothing_is_done_by_default() -> None:
    assert degraded().identity == clean().identity


@pytest.mark.parametrize("share", [0.001, 0.06, 0.5])
def test_held_rows_repeat_the_row_before_under_their_own_stamps(share: float) -> None:
    log = degraded(hold=share)
    np.testing.assert_array_equal(log.time, clean().time)
    true, seen = channels(clean()), channels(log)
    held = np.any(seen != true, axis=1)
    assert np.count_nonzero(held) == round(share * 2000)
    assert not held[0]
    np.testing.assert_array_equal(seen[held], seen[np.flatnonzero(held) - 1])


@pytest.mark.parametrize("share", [0.01, 0.3])
def test_dropped_rows_are_missing_and_the_others_stay(share: float) -> None:
    log = degraded(drop_rows=share)
    assert log.count == 2001 - round(share * 1999)
    kept = np.searchsorted(clean().time, log.time)
    np.testing.assert_array_equal(log.time, clean().time[kept])
    np.testing.assert_array_equal(channels(log), channels(clean())[kept])
    assert log.time[[0, -1]].tolist() == [0.0, 2.0]


def test_late_stamps_follow_from_the_recursion() -> None:
    """Row by row: a host that waits, then reads as fast as it can."""
    rng, waits = np.random.default_rng([4, 4]), []
    share = 0.5 * 0.0003 / (0.0003 + 0.0075 / 2)
    long = rng.random(2001) < share
    drawn = rng.uniform(0, 0.0075, 2001), rng.uniform(0, 0.0003, 2001)
    for k in range(2001):
        before = waits[-1] - 0.0003 if waits else 0.0
        waits.append(max(before, drawn[0][k] if long[k] else drawn[1][k]))
    late = degraded(seed=4, clock_jitter=(0.0007, 0.0085)).time - clean().time
    np.testing.assert_allclose(late, waits, atol=1e-12)


@pytest.mark.parametrize(("delay", "rows"), [((0.004,), (4, 4)), ((0.0, 0.007), (0, 7)), ((-0.003,), (-3, -3))])
def test_torques_are_those_of_earlier_rows(delay: tuple[float, ...], rows: tuple[int, int]) -> None:
    log = degraded(delay=delay)
    np.testing.assert_array_equal(log.q, clean().q)
    for k, shift in enumerate(rows):
        np.testing.assert_allclose(log.effort[20:-20, k], clean().effort[20 - shift : 2001 - 20 - shift, k], atol=1e-12)
