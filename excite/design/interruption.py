"""Ctrl-C (SIGINT), SIGTERM and SIGHUP: the first one interrupts, a second one ends the process at once.

The command line installs one `Interruption` for a whole command. What the first signal does changes with what is being
done: it raises `Interrupted`; or it is deferred to a safe point, since compiled computations swallow or spoil what is
raised inside them; or it is ignored, while a finished result is saved.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_DOUBLED = 0.5  # s within which a signal counts as the same: a terminal that closes, and its shell, both send one
_AGAIN = 0.2  # s after which a signal whose exception was lost is raised again
_SHOW_CURSOR = "\x1b[?25h"

Answer = Callable[[int], None]


class Interrupted(KeyboardInterrupt):
    """A signal that ends what is being done."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


class Interruption:
    """What signals do while a command runs."""

    def __init__(self) -> None:
        self.number: int | None = None
        self._since = 0.0
        self._answer: Answer = _raise
        self._ignored = False
        self._raised = False
        self._timer: threading.Timer | None = None
        self._repeated = False
        self.before_leaving: Callable[[], None] = lambda: None

    @property
    def status(self) -> int:
        """Exit status of a process that the first signal has ended, 130 for Ctrl-C."""
        return 128 + (signal.SIGINT if self.number is None else self.number)

    def handle(self, number: int, _: FrameType | None = None) -> None:
        """Answer the first signal; end the process at a second one."""
        if self._repeated:
            self._repeated = False
            self._again()
        elif self.number is None:
            self.number, self._since = number, time.monotonic()
            self._raised = self._answer is _raise
            self._watch()
            self._answer(number)
        elif time.monotonic() - self._since > _DOUBLED:
            self.before_leaving()
            _leave(128 + number)

    def ignore(self) -> None:
        """Ignore the first signal from now on: only saving remains."""
        self._answer = self._ignore

    def heed(self) -> None:
        """Heed the first signal again, and forget one that was ignored."""
        self._answer = _raise
        if self._ignored:
            self.number, self._ignored = None, False

    def _watch(self) -> None:
        """Have this process signalled once more, since compiled code may swallow what is raised in it."""
        if self._raised and self.number is not None and hasattr(signal, "pthread_kill"):
            self._timer = threading.Timer(_AGAIN, self._signal)
            self._timer.daemon = True
            self._timer.start()

    def _signal(self) -> None:
        if self._raised and self.number is not None:
            self._repeated = True
            signal.pthread_kill(threading.main_thread().ident or 0, self.number)

    def _again(self) -> None:
        """Raise the first signal again, unless it is being dealt with."""
        error = sys.exc_info()[1]
        while error is not None:
            if isinstance(error, KeyboardInterrupt):
                return
            error = error.__context__
        if self._answer is _raise and self._raised:
            self._watch()
            self.repeat()
        elif self._raised and self.number is not None and self._answer != self._ignore:
            self._answer(self.number)  # it is deferred by now

    def leave(self) -> None:
        """Answer no signal any more."""
        self._raised = False
        if self._timer is not None:
            self._timer.cancel()

    def repeat(self) -> None:
        """Raise the first signal again where it was raised, but the work goes on: compiled code has swallowed it."""
        if self._raised and self.number is not None:
            raise Interrupted(self.number)

    def caught(self) -> None:
        """State that the first signal has ended what it was to end, so that `repeat` does not raise it again."""
        self._raised = False

    def _ignore(self, _: int) -> None:
        self._ignored = True

    @contextmanager
    def answering(self, answer: Answer) -> Iterator[None]:
        """Answer the first signal otherwise in the block."""
        before, self._answer = self._answer, answer
        try:
            yield
        finally:
            if self._answer is answer:
                self._answer = before


_current: Interruption | None = None


def current_interruption() -> Interruption | None:
    """The one that is installed, if any."""
    return _current


def repeat_lost_signal() -> None:
    """Raise a signal again that compiled code has swallowed; to be called between two steps of a command.

    CasADi and NumPy call Python while they convert matrices; what a signal raises in there they may drop.
    """
    if _current is not None:
        _current.repeat()


def signal_answered() -> None:
    """State that the first signal has ended what it was to end, so that it is not raised again."""
    if _current is not None:
        _current.caught()


@contextmanager
def answered_signals() -> Iterator[Interruption]:
    """Answer signals in the block, except those that this process ignores, as below ``nohup``."""
    global _current
    answered = Interruption()
    before = {number: signal.getsignal(number) for number in SIGNALS} if _in_main_thread() else {}
    ours = {number for number, old in before.items() if old in (signal.SIG_DFL, signal.default_int_handler)}
    outer, _current = _current, answered if ours else _current
    for number in ours:
        signal.signal(number, answered.handle)
    try:
        yield answered
    finally:
        _current = outer
        answered.leave()
        for number in ours:
            signal.signal(number, before[number])


@contextmanager
def deferred_interruption(say: Callable[[], None] = lambda: None) -> Iterator[Callable[[], None]]:
    """Defer a signal in the block to a safe point."""
    noted: list[int] = []

    def note(number: int) -> None:
        if not noted:
            say()
        noted.append(number)

    def answer() -> None:
        if noted:
            raise Interrupted(noted[0])

    with _current.answering(note) if _current is not None else _noted_interrupt(note):
        yield answer


@contextmanager
def _noted_interrupt(note: Answer) -> Iterator[None]:
    """Note the first Ctrl-C where no command runs, and leave a second one to the handler that was there."""
    before = signal.getsignal(signal.SIGINT)
    if not _in_main_thread() or not callable(before):
        yield
        return
    noted = False

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal noted
        if noted:
            before(number, frame)
        noted = True
        note(number)

    signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def held_signals(numbers: tuple[int, ...] = SIGNALS) -> Iterator[None]:
    """Block signals until the block ends; processes started in it inherit that and never handle them."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _raise(number: int) -> NoReturn:
    raise Interrupted(number)


def _leave(status: int) -> NoReturn:
    """End this process at once; its worker processes end with it."""
    with suppress(OSError, ValueError, AttributeError):
        cursor = _SHOW_CURSOR if sys.stderr.isatty() else ""
        os.write(2, f"{cursor}excite: stopped at once; nothing more is saved\n".encode())
    os._exit(status)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
