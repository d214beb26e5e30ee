"""Forks, systems without what POSIX has, and long use of one process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from commands import ENVIRONMENT, MODULE
from processes import environment_of

from excite import operating_system
from excite.operating_system import (
    ForkSafeThread,
    can_fork,
    is_running,
    replace_file,
    sync_folder,
)

# A process forks its workers only where the copy works: on Linux, without threads that may hold a lock.


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


def test_only_the_main_thread_forks_and_a_thread_of_others_prevents_it() -> None:
    said: list[bool] = []
    ours, ended = ForkSafeThread(target=lambda: said.append(can_fork())), threading.Event()
    ours.start()
    ours.join()
    theirs = threading.Thread(target=ended.wait)
    theirs.start()
    said.append(can_fork())
    ended.set()
    theirs.join()
    assert said == [False, False]


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_other_systems_do_not_fork(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    assert not can_fork()


# The commands on a system without fork, signal masks, file locks and UTF-8 consoles: simulated, by processes.


def ended(*command: str, cwd: Path) -> tuple[str, str]:
    """What a command prints that goes well, read as such a console shows it."""
    site = cwd / "site"
    site.mkdir(exist_ok=True)
    environment = {**ENVIRONMENT, **environment_of(site)}
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, timeout=300, check=False)
    out, err = (text.decode("cp1252") for text in (done.stdout, done.stderr))
    assert done.returncode == 0, f"{command}\n{err}"
    assert "Traceback" not in err
    return out, err


@pytest.mark.slow
def test_import_robots_design_simulate_identify_and_verify(tmp_path: Path) -> None:
    code = "import os, excite, excite.cli.main; [getattr(excite, name) for name in excite.__all__]"
    assert ended(sys.executable, "-c", f"{code}; print(hasattr(os, 'fork'))", cwd=tmp_path)[0].strip() == "False"
    _, err = ended(*MODULE, "robots", "irp6", cwd=tmp_path)
    assert [line for line in err.splitlines() if not line.endswith(" ...")] == []  # progress, on a slow machine
    design = ("design", "irp6", "--starts", "2", "--harmonics", "3", "--workers", "2", "--out", "d")
    simulate = ("simulate", "d", "--rate", "500", "--torque-noise", "0.5", "--out")
    for arguments in (
        design,
        (*design, "--force"),
        (*simulate, "run.csv", "--seed", "1"),
        (*simulate, "other.csv", "--seed", "2"),
        ("identify", "irp6", "run.csv", "--design", "d", "--out", "r"),
        ("identify", "irp6", "run.csv", "--design", "d", "--out", "r", "--force"),
        ("verify", "r", "other.csv"),
        ("compare", "d"),
        ("friction", "plan", "irp6", "--out", "f"),
    ):
        ended(*MODULE, *arguments, cwd=tmp_path)
    assert not [path.name for path in tmp_path.rglob(".*")]


def test_a_file_that_another_program_has_open_is_replaced_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "new").write_text("new", encoding="utf-8")
    (tmp_path / "old").write_text("old", encoding="utf-8")
    real, tries = os.replace, []

    def refused(source: Path, destination: Path) -> None:
        tries.append(source)
        if len(tries) < 3:
            raise PermissionError(13, "Permission denied")
        real(source, destination)

    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(PermissionError):  # where that does not help, at once
        replace_file(tmp_path / "new", tmp_path / "old")
    monkeypatch.setattr(operating_system, "_refuses_open_files", lambda: True)
    replace_file(tmp_path / "new", tmp_path / "old")
    assert ((tmp_path / "old").read_text(encoding="utf-8"), len(tries)) == ("new", 3)


def test_processes_and_folders(tmp_path: Path) -> None:
    assert is_running(os.getpid())
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    assert not is_running(gone.pid)
    sync_folder(tmp_path)
    with pytest.raises(FileNotFoundError):
        sync_folder(tmp_path / "none")


# Long use of one process, in short: memory, open files and threads. The long version is benchmarks/endurance.


SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "endurance" / "endurance.py"


@pytest.mark.slow
def test_eight_designs_and_fifty_starts_leave_nothing(tmp_path: Path) -> None:
    command = [sys.executable, SCRIPT, "--designs", "8", "--starts", "50", "--out", tmp_path]
    subprocess.run(command, env=ENVIRONMENT, check=True, capture_output=True, timeout=600)
    measured = json.loads((tmp_path / "endurance.json").read_text(encoding="utf-8"))
    for part in measured.values():
        assert (part["files_gained"], part["threads_gained"]) == (0, 0)
    starts = measured["starts"]
    assert starts["last_bytes"] - starts["first_bytes"] < 50 * 10_000  # a start's own numbers are 10 kB
    designs = measured["designs"]
    assert designs["last_bytes"] - designs["first_bytes"] < 100e6  # of which one set of figures keeps 50 MB
