"""A process forks its workers only where the copy works: on Linux, without threads that may hold a lock."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable

import pytest
from commands import ENVIRONMENT

from excite.operating_system import ForkSafeThread, can_fork

CODE = """
import sys, threading, numpy
from excite.operating_system import ForkSafeThread, can_fork
numpy.ones((300, 300)) @ numpy.ones((300, 300))
ended = threading.Event()
print(can_fork())
ForkSafeThread(target=ended.wait, daemon=True).start()
print(can_fork())
threading.Thread(target=ended.wait, daemon=True).start()
print(can_fork())
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux forks")
@pytest.mark.parametrize("threads", ["1", "2"])
def test_a_process_forks_unless_a_thread_may_hold_a_lock(threads: str) -> None:
    environment = {**ENVIRONMENT, "OPENBLAS_NUM_THREADS": threads}
    ended = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["True", "True", "False"]


def test_only_the_main_thread_forks() -> None:
    said: list[bool] = []
    thread = ForkSafeThread(target=lambda: said.append(can_fork()))
    thread.start()
    thread.join()
    assert said == [False]


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_other_systems_do_not_fork(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    assert not can_fork()


def test_a_thread_of_others_prevents_it() -> None:
    ended = threading.Event()
    wait: Callable[[], object] = ended.wait
    thread = threading.Thread(target=wait)
    thread.start()
    try:
        assert not can_fork()
    finally:
        ended.set()
        thread.join()
