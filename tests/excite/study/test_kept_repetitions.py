"""Repetitions that were computed before a run ended are not computed again, and the whole is what one run gives."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from multiprocessing import Process
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from repeated_experiments import OneByOne, chains, plain, same

from excite.design.problem_identity import NotComparable
from excite.errors import LostWorkersError
from excite.study import repetitions as units_file
from excite.study.repetitions import repeat_experiment
from regressors.errors import InputError

COUNT = 12


@pytest.fixture(autouse=True)
def in_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Units of two repetitions, each written at once."""
    monkeypatch.setattr(units_file, "repetition_seconds", lambda _, count: count * units_file._UNIT / 2)
    monkeypatch.setattr(units_file, "_EVERY", 0.0)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "so-far.npz"


def lose(file: Path, experiment: Any = None, seed: int = 0) -> None:
    """Lose the executor after three units of two repetitions."""
    with pytest.raises(LostWorkersError) as lost:
        repeat_experiment(experiment or plain(), COUNT, seed, executor=OneByOne(ends_after=3), kept=file)
    assert str(lost.value) == (
        f"the scheduler went away; 6 of 12 repetitions are kept in {file}, and the same call computes the rest"
    )


@pytest.mark.parametrize("name", chains())
def test_the_same_call_computes_the_rest(name: str, file: Path, caplog: pytest.LogCaptureFixture) -> None:
    experiment = chains()[name]
    lose(file, experiment)
    rest, seen = OneByOne(), list[int]()
    with caplog.at_level(logging.INFO, "excite.study"):
        found = repeat_experiment(
            experiment, COUNT, 0, executor=rest, kept=file, progress=lambda done, _: seen.append(done)
        )
    assert rest.numbers == list(range(6, COUNT))
    assert seen == [8, 10, 12]
    assert caplog.messages == [f"6 of 12 repetitions are already done in {file}"]
    same(found, repeat_experiment(experiment, COUNT, 0, executor="serial"))
    assert not file.exists()


def test_other_numbers_of_repetitions(file: Path) -> None:
    lose(file)
    content, fewer = file.read_bytes(), OneByOne()
    same(repeat_experiment(plain(), 4, 0, executor=fewer, kept=file), repeat_experiment(plain(), 4, 0))
    assert fewer.numbers == []
    file.write_bytes(content)
    more = OneByOne()
    same(repeat_experiment(plain(), 15, 0, executor=more, kept=file), repeat_experiment(plain(), 15, 0))
    assert more.numbers == list(range(6, 15))


def test_gaps_are_filled(file: Path) -> None:
    def stop(done: int, _: int) -> None:
        if done == 6:
            raise KeyboardInterrupt

    found = repeat_experiment(plain(), COUNT, 0, executor=OneByOne(lost=(1, 2)), kept=file, progress=stop)
    assert (found.count, found.interrupted) == (6, True)
    rest = OneByOne()
    same(repeat_experiment(plain(), COUNT, 0, executor=rest, kept=file), repeat_experiment(plain(), COUNT, 0))
    assert rest.numbers == [2, 3, 4, 5, 10, 11]


def _killed(file: Path) -> None:
    repeat_experiment(plain(), COUNT, 0, executor=OneByOne(), kept=file, progress=lambda done, _: _end_at(done, 8))


def _end_at(done: int, last: int) -> None:
    if done == last:
        os._exit(9)


def test_a_process_that_ends_at_once_has_kept_what_it_computed(file: Path) -> None:
    process = Process(target=_killed, args=(file,))
    process.start()
    process.join()
    assert process.exitcode == 9
    rest = OneByOne()
    same(repeat_experiment(plain(), COUNT, 0, executor=rest, kept=file), repeat_experiment(plain(), COUNT, 0))
    assert rest.numbers == [8, 9, 10, 11]


def _other_motion() -> Any:
    samples = plain().samples
    return replace(plain(), samples=replace(samples, q=samples.q + 1e-12))


@pytest.mark.parametrize(
    ("other", "seed"),
    [
        (plain, 1),
        (_other_motion, 0),
        (lambda: replace(plain(), beta=np.nextafter(plain().beta, 9.0)), 0),
        (lambda: replace(plain(), noise=replace(plain().noise, effort=0.31)), 0),
        (lambda: replace(plain(), estimator="least-squares"), 0),
        (lambda: replace(plain(), every=2), 0),
        (lambda: chains()["differential"], 0),
    ],
)
def test_repetitions_of_another_experiment_are_not_taken(
    file: Path, other: Callable[[], Any], seed: int, caplog: pytest.LogCaptureFixture
) -> None:
    lose(file, other(), seed)
    whole = OneByOne()
    found = repeat_experiment(plain(), COUNT, 0, executor=whole, kept=file)
    assert caplog.messages == [f"{file} is of another experiment, and is replaced"]
    assert whole.numbers == list(range(COUNT))
    same(found, repeat_experiment(plain(), COUNT, 0))


@pytest.mark.parametrize("spoil", [lambda b: b"", lambda b: b[:-100], lambda _: b"PK\x03\x04", lambda _: b"[1]"])
def test_a_file_that_cannot_be_read_is_said(
    file: Path, spoil: Callable[[bytes], bytes], caplog: pytest.LogCaptureFixture
) -> None:
    lose(file)
    file.write_bytes(spoil(file.read_bytes()))
    same(repeat_experiment(plain(), COUNT, 0, executor=OneByOne(), kept=file), repeat_experiment(plain(), COUNT, 0))
    assert caplog.messages == [f"{file} cannot be read; its repetitions are computed again"]


def test_what_cannot_be_compared_is_not_kept(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: Any) -> None:
        raise NotComparable("its source is not accessible")

    monkeypatch.setattr(units_file, "plain_value", refused)
    with pytest.raises(LostWorkersError, match=r"^the scheduler went away; repeat with fewer `workers`"):
        repeat_experiment(plain(), COUNT, 0, executor=OneByOne(ends_after=3), kept=file)
    assert not file.exists()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot write .*: No such file or directory"):
        repeat_experiment(plain(), COUNT, 0, executor=OneByOne(), kept=tmp_path / "none" / "so-far.npz")
