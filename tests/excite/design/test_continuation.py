"""The number of harmonics chosen by a search: where it ends, what it records, and that it can be run again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import excite
from excite.design import optimisation, search_rounds as continuation
from excite.design.formulation import Formulation
from excite.design.solvers.descent import SqpOptions
from excite.design.solvers.sqp import SequentialQuadratic
from excite.design.start_results import read_starts
from excite.tasks.task import Task
from excite.trajectories.fourier import Fourier
from regressors.errors import InputError

SMALL = Task("irp6", starts=1, seed=3, executor="serial", harmonics="auto")
QUICK = SMALL.changed(solver=SequentialQuadratic(SqpOptions(iterations=3)))


def designed(least: float, numbers: tuple[int, ...], monkeypatch: pytest.MonkeyPatch, task: Task = QUICK,
             folder: Path | None = None) -> excite.Design:  # fmt: skip
    monkeypatch.setattr(continuation, "_LEAST", least)
    monkeypatch.setattr(continuation, "_NUMBERS", numbers)
    return excite.design_trajectory(task, folder=folder)


@pytest.mark.slow
def test_harmonics_are_added_while_they_pay(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The motion is never worse than that of fewer; the design states its number and runs again to the same motion."""
    design = designed(0.0, (5, 6, 7), monkeypatch, SMALL)
    values = [trial.value for trial in design.harmonics_trials]
    assert [trial.harmonics for trial in design.harmonics_trials] == [5, 6, 7]
    assert values == sorted(values, reverse=True)
    assert design.task.trajectory.harmonics == 7
    assert design.trajectory.family.harmonics == 7
    assert design.notes[-1] == "7 harmonics: 7 are the most that are tried"
    design.save(tmp_path / "design")
    content = json.loads((tmp_path / "design" / "design.json").read_text(encoding="utf-8"))
    assert [trial["harmonics"] for trial in content["solver"]["harmonics"]] == [5, 6, 7]
    stored = excite.load_design(tmp_path / "design").task
    again = excite.design_trajectory(stored)
    np.testing.assert_array_equal(again.trajectory.x, design.trajectory.x)
    assert again.harmonics_trials == ()


def test_what_does_not_pay_is_not_taken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The folder holds the starts of the motion that was taken, of its problem."""
    design = designed(0.99, (5, 6, 7), monkeypatch, folder=tmp_path)
    assert [trial.harmonics for trial in design.harmonics_trials] == [5, 6]
    assert design.task.trajectory.harmonics == 5
    assert design.notes[-1].startswith("5 harmonics: 6 brought ")
    spent = sum(trial.cpu_seconds for trial in design.harmonics_trials)
    assert design.provenance["cpu_seconds"] == pytest.approx(spent)
    (start,) = read_starts(tmp_path)
    np.testing.assert_array_equal(start.coefficients, design.trajectory.x)
    again = excite.design_trajectory(design.task, folder=tmp_path)  # finds it, and computes nothing
    assert again.starts[0].cpu == start.cpu


def test_the_bandwidth_of_the_controller_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    design = designed(0.0, (5, 7, 10), monkeypatch, up_to(0.6))
    assert [trial.harmonics for trial in design.harmonics_trials] == [5, 6]  # 0.6 Hz * 10 s
    assert design.notes[-1] == "6 harmonics: more are beyond the bandwidth of 0.6 Hz"
    numbers, _ = continuation._numbers(up_to(100.0))
    assert numbers == [5, 7, 10]
    assert continuation._numbers(up_to(0.3))[0] == [3]
    with pytest.raises(InputError, match="leaves 1 harmonics of a period of 10 s"):
        continuation._numbers(up_to(0.1))


def up_to(hz: float) -> Task:
    return QUICK.changed(bandwidth=hz)


@pytest.mark.parametrize("interrupted", ["result", "raised"])
def test_an_interruption_ends_it_with_the_best_so_far(interrupted: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = optimisation.solve

    def solve(robot: object, made: Formulation, *given: object) -> excite.Design:
        further = made.task.trajectory.harmonics > 5
        if further and interrupted == "raised":
            raise KeyboardInterrupt
        return replace(real(robot, made, *given), interrupted=further)

    monkeypatch.setattr(optimisation, "solve", solve)
    design = designed(0.0, (5, 6, 7), monkeypatch)
    assert design.interrupted
    assert design.notes[-1].endswith(" harmonics: interrupted")
    assert [trial.harmonics for trial in design.harmonics_trials] == ([5] if interrupted == "raised" else [5, 6])


def test_what_cannot_be_continued_is_refused() -> None:
    for options, message in (
        ({"trajectory": "bspline"}, "not for bspline; give `intervals`"),
        ({"trajectory": "sines"}, "not for sines; give a number"),
        ({"harmonics": "many"}, "harmonics: expected a whole number, or auto, given"),
        ({"harmonics": 5, "bandwidth": 1.0}, "give both, or neither"),
        ({"bandwidth": -1.0}, "bandwidth"),
    ):
        with pytest.raises(InputError, match=message):
            SMALL.changed(**options)
    with pytest.raises(InputError, match="expected a whole number"):
        SMALL.trajectory.family()
    assert SMALL.changed(trajectory=Fourier(8.0, 6)).trajectory.harmonics == 6


@pytest.mark.parametrize("family", ["fourier", "cosine", "fourier-quintic"])
def test_motions_are_among_those_of_more_harmonics(family: str) -> None:
    """What the continuation relies on, by least squares on instants."""
    rng, time = np.random.default_rng(2), np.linspace(0.0, 10.0, 1001)
    few, more = (SMALL.changed(trajectory=family, harmonics=n).trajectory.family() for n in (5, 7))
    x = rng.normal(size=(3, few.size))
    q = few.motion(x, time, 0)
    np.testing.assert_allclose(more.motion(more.nearest(time, q), time, 0), q, atol=1e-9)
