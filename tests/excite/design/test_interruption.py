"""The first signal interrupts, a second one ends the process at once."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest

import excite
from excite.cli.main import main
from excite.cli.streams import tell
from excite.design import interruption, multistart, optimisation
from excite.design.interruption import (
    SIGNALS,
    Interrupted,
    Interruption,
    answered_signals,
    current_interruption,
    deferred_interruption,
    repeat_lost_signal,
)
from excite.design.optimisation import design_trajectory
from regressors.errors import InputError


class Left(BaseException):
    """Stands for the end of the process."""


@pytest.fixture
def answered(monkeypatch: pytest.MonkeyPatch) -> Iterator[Interruption]:
    def leave(status: int) -> None:
        raise Left(status)

    monkeypatch.setattr(os, "_exit", leave)
    monkeypatch.setattr(interruption, "_DOUBLED", -1.0)
    monkeypatch.setattr(interruption, "_AGAIN", 60.0)
    before = [signal.getsignal(number) for number in SIGNALS]
    with answered_signals() as answers:
        assert current_interruption() is answers
        yield answers
    assert [signal.getsignal(number) for number in SIGNALS] == before
    assert current_interruption() is None


@pytest.fixture
def soon(answered: Interruption, monkeypatch: pytest.MonkeyPatch) -> Interruption:
    """What is swallowed is raised again after a moment."""
    monkeypatch.setattr(interruption, "_AGAIN", 0.05)
    return answered


@pytest.mark.parametrize("number", SIGNALS)
def test_the_first_signal_interrupts_and_the_second_leaves(number: int, answered: Interruption) -> None:
    assert answered.status == 130
    with pytest.raises(Interrupted):
        signal.raise_signal(number)
    assert answered.status == 128 + number
    with pytest.raises(Left) as left:
        signal.raise_signal(signal.SIGTERM)
    assert left.value.args == (143,)


def interrupted(number: int) -> None:
    with pytest.raises(Interrupted):
        signal.raise_signal(number)


def swallowed(number: int) -> None:
    with suppress(Interrupted):  # as compiled code does that calls Python
        signal.raise_signal(number)


def test_a_signal_sent_twice_at_once_counts_once(answered: Interruption, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interruption, "_DOUBLED", 60.0)
    interrupted(signal.SIGHUP)
    signal.raise_signal(signal.SIGHUP)


def test_a_deferred_signal_is_raised_where_it_is_asked_for(answered: Interruption) -> None:
    said: list[int] = []
    with deferred_interruption(lambda: said.append(1)) as answer:
        answer()
        signal.raise_signal(signal.SIGTERM)
        assert said == [1]
        with pytest.raises(Interrupted):
            answer()
        repeat_lost_signal()  # it is not raised again
        with pytest.raises(Left):
            signal.raise_signal(signal.SIGINT)
    repeat_lost_signal()
    assert answered.status == 143


def test_an_ignored_signal_is_forgotten_afterwards(answered: Interruption) -> None:
    answered.ignore()
    signal.raise_signal(signal.SIGINT)
    answered.heed()
    interrupted(signal.SIGTERM)
    assert answered.status == 143


def test_what_a_process_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as below nohup
    try:
        with answered_signals():
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_signal_that_is_swallowed_is_raised_at_the_next_step(answered: Interruption) -> None:
    repeat_lost_signal()
    swallowed(signal.SIGTERM)
    with pytest.raises(Interrupted) as again:
        tell("drawing")
    assert again.value.number == signal.SIGTERM
    answered.caught()
    tell("drawing")


def test_an_interrupted_search_saves_its_best(answered: Interruption, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any) -> None:
        multistart.serial(*arguments)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(optimisation, "part", lambda *_: interrupted)
    assert design_trajectory("irp6", harmonics=3, starts=1, executor="serial").interrupted
    tell("drawing")


@pytest.mark.parametrize("lost", [SystemError("<function DM.__array__> returned a result with an exception set"), None])
def test_what_compiled_code_makes_of_a_signal_is_that_signal(
    lost: Exception | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(*_: object) -> object:
        with suppress(Interrupted):
            signal.raise_signal(signal.SIGTERM)
        if lost is not None:
            raise lost
        raise InputError("what is wrong with half of an input")

    monkeypatch.setattr(excite, "plan_campaign", work)
    monkeypatch.setattr(sys, "argv", ["excite", "plan", "irp6"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 143
    assert capsys.readouterr().err == "excite: interrupted before any result\n"


def test_a_signal_that_is_swallowed_is_raised_again_soon(soon: Interruption) -> None:
    swallowed(signal.SIGTERM)
    with pytest.raises(Interrupted):
        time.sleep(5.0)
    assert soon.status == 143


@pytest.mark.usefixtures("soon")
def test_a_signal_that_is_swallowed_before_signals_are_deferred_is_deferred() -> None:
    swallowed(signal.SIGINT)
    with deferred_interruption() as answer:
        time.sleep(0.3)
        with pytest.raises(Interrupted):
            answer()


def _cleaned_up_for_long() -> None:
    try:
        signal.raise_signal(signal.SIGINT)
    finally:
        time.sleep(0.3)


@pytest.mark.usefixtures("soon")
def test_a_signal_is_not_raised_again_while_it_is_dealt_with() -> None:
    with pytest.raises(Interrupted) as ended:
        _cleaned_up_for_long()
    assert ended.value.__context__ is None


def test_a_signal_is_not_raised_again_once_it_was_dealt_with(soon: Interruption) -> None:
    swallowed(signal.SIGINT)
    soon.caught()
    time.sleep(0.3)
