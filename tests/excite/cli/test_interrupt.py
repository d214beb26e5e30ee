"""Ctrl-C and other signals, and processes that are killed: the best so far is saved, and nothing is left running."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path

import pytest
from commands import Here, content_of, files_below, run, table_of
from processes import alive, running, stderr_of, until, workers

from excite.design.start_results import RUNNING, read_starts

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes through /proc")
SAVED = "excite: interrupted; the best feasible motion so far is saved"
FIGURES = {"motion.png", "phase.png", "spectrum.png", "workspace.png", "convergence.png"}
COMPLETE = {"design.json", "trajectory.csv", "manifest.json", *FIGURES, "starts"}
NOTHING = "excite: interrupted before any result"
COMMANDS = {
    "plan": ("plan panda --model differential --at-once 7", " ...", NOTHING),
    "study": ("study irp6 --design design --repeats 2000 --out out", "repetition 10 of", NOTHING),
    "friction plan": ("friction plan panda --speeds 5,10,20,50,100 --repeats 300 --out out", " ...", NOTHING),
    "identify": (
        "identify irp6 run.csv --choose none --repeat 400000 --out out",
        "about",
        "excite: interrupted; the result is saved, with",
    ),
}
LONG = ("irp6", "--starts", "200")
SERIAL = ("--executor", "serial")
LARGE = ("--joints", "1,2,3,4,5", "--harmonics", "15")


def designing(cwd: Path, *arguments: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """``excite design ARGUMENTS --out out`` at work."""
    return running(cwd, "design", *arguments, "--out", "out")


def interrupted(cwd: Path, *arguments: str, when: Callable[[int], object]) -> str:
    """Last line on stderr of a design that Ctrl-C interrupts when its process, of this number, is so far."""
    with designing(cwd, *arguments) as process:
        until(lambda: when(process.pid))
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(60) == 130
        until(lambda: not alive(process.pid), 10)
    return stderr_of(cwd).splitlines()[-1]


def finished(cwd: Path) -> int:
    """Number of starts on disk that have ended."""
    folder = cwd / "out" / "starts"
    return sum(start.status != RUNNING for start in read_starts(folder)) if folder.exists() else 0


def saved(cwd: Path) -> dict[str, object]:
    """Content of a design that was saved after an interruption, looked at from all sides."""
    assert stderr_of(cwd).splitlines()[-1] == SAVED
    assert "condition number " in (cwd / "stdout").read_text()
    assert {path.name for path in (cwd / "out").iterdir()} == COMPLETE
    assert not [name for name in files_below(cwd / "out") if Path(name).name.startswith(".")]
    content = content_of(cwd / "out")
    assert (content["interrupted"], content["feasible"]) == (True, True)
    assert all(limit["holds"] for limit in content["limits"])
    on_disk = {start.index: start.status for start in read_starts(cwd / "out" / "starts")}
    assert on_disk == {start["index"]: start["status"] for start in content["solver"]["starts"]}
    assert content["solver"]["best_start"] in on_disk
    ended = sum(status != RUNNING for status in on_disk.values())
    note = f"interrupted: best of {ended} finished and {len(on_disk) - ended} unfinished starts"
    assert note in content["notes"]
    assert "the search was interrupted" in " ".join((cwd / "stdout").read_text().split())  # the note may be cut
    header, table = table_of(cwd / "out" / "trajectory.csv")
    assert (len(header), len(table)) == (16, 1001)
    return content


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "whom", "number"),
    [
        ((), "group", signal.SIGINT),
        (SERIAL, "parent", signal.SIGINT),
        ((), "parent", signal.SIGTERM),
        (SERIAL, "group", signal.SIGTERM),
        ((), "group", signal.SIGHUP),
    ],
)
def test_a_signal_saves_the_best_so_far(
    options: tuple[str, ...], whom: str, number: signal.Signals, tmp_path: Path
) -> None:
    with designing(tmp_path, *LONG, *options) as process:
        until(lambda: finished(tmp_path))
        (os.killpg if whom == "group" else os.kill)(process.pid, number)
        assert process.wait(60) == 128 + number
        until(lambda: not alive(process.pid), 10)
    content = saved(tmp_path)
    best = min(start.value for start in read_starts(tmp_path / "out" / "starts") if start.status != RUNNING)
    assert content["criteria"]["condition_number"] <= 1.001 * best


@pytest.mark.slow
def test_interrupt_before_a_start_has_finished_saves_its_best_point(tmp_path: Path) -> None:
    # Points of an unfinished start are on disk after a second; one of 40 harmonics takes far longer than that.
    def at_work(_: int) -> bool:
        folder = tmp_path / "out" / "starts"
        return folder.exists() and bool(read_starts(folder))

    interrupted(tmp_path, "irp6", "--joints", "1,2,3,4,5", "--harmonics", "40", *SERIAL, when=at_work)
    assert re.search(r"best of 0 finished and [1-9] unfinished starts", saved(tmp_path)["notes"][-1])


@pytest.mark.slow
def test_interrupt_before_any_point_says_so(tmp_path: Path) -> None:
    starts = tmp_path / "out" / "starts"
    assert interrupted(tmp_path, "irp6", *LARGE, when=lambda _: starts.exists()) == NOTHING
    assert (tmp_path / "stdout").read_text() == ""
    assert files_below(tmp_path / "out") == {"starts"}


@pytest.mark.slow
def test_interrupt_while_processes_start(tmp_path: Path) -> None:
    def importing(pid: int) -> bool:
        with suppress(OSError):
            return b"numpy" in Path(f"/proc/{pid}/maps").read_bytes()
        return False

    at_work = lambda pid: any(map(importing, workers(pid)))  # noqa: E731
    assert interrupted(tmp_path, *LONG, "--workers", "2", when=at_work) == NOTHING


def test_interrupt_of_a_replacement_keeps_the_old_design(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    old = {"design.json": b"{}", "trajectory.csv": b"time\n", "motion.png": b"png"}
    for name, content in old.items():
        (tmp_path / "out" / name).write_bytes(content)
    starts = tmp_path / "out" / ".next" / "starts"
    assert interrupted(tmp_path, *LONG, *LARGE, "--force", when=lambda _: starts.exists()) == NOTHING
    assert {name: (tmp_path / "out" / name).read_bytes() for name in old} == old


@pytest.mark.slow
def test_a_second_interrupt_leaves_at_once_and_spoils_nothing(tmp_path: Path) -> None:
    with designing(tmp_path, *LONG) as process:
        until(lambda: finished(tmp_path))
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.6)  # within half a second it counts as the same
        os.killpg(process.pid, signal.SIGTERM)
        assert process.wait(2) == 143
        until(lambda: not alive(process.pid), 5)
    assert stderr_of(tmp_path).splitlines()[-1] == "excite: stopped at once; nothing more is saved"
    ended = run("compare", "out", cwd=tmp_path)
    whole = (tmp_path / "out" / "design.json").exists()
    assert (ended.returncode == 0) == whole, ended.stderr
    assert finished(tmp_path)


@pytest.mark.slow
def test_an_interrupt_while_a_finished_search_is_saved_is_ignored(tmp_path: Path) -> None:
    with designing(tmp_path, "irp6", "--starts", "1", *SERIAL) as process:
        until((tmp_path / "out" / "design.json").exists)  # figures are still to be drawn
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(60) == 0
    stderr_of(tmp_path)
    assert content_of(tmp_path / "out")["interrupted"] is False
    assert {path.name for path in (tmp_path / "out").iterdir()} == COMPLETE


@pytest.mark.slow
def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    with designing(tmp_path, *LONG, "--workers", "2") as process:
        until(lambda: finished(tmp_path))
        assert len(workers(process.pid)) == 2
        os.kill(process.pid, signal.SIGKILL)
        process.wait(10)
        until(lambda: not alive(process.pid), 5)
    assert not (tmp_path / "out" / "design.json").exists()


@pytest.mark.parametrize(
    ("command", "work"),
    [
        ("identify irp6 run.csv", "excite.identification.identify.identify"),
        ("simulate design", "excite.simulation.simulate.simulate"),
        ("verify any run.csv", "excite.verification.verify.verify"),
    ],
)
def test_an_interrupt_leaves_nothing(command: str, work: str, recorded: Here) -> None:
    recorded.monkeypatch.setattr("excite.load_result", lambda *_, **__: None)
    recorded.monkeypatch.setattr(work, lambda *_, **__: signal.raise_signal(signal.SIGINT))
    before = files_below(recorded.cwd)
    recorded.run(*command.split(), "--out", "new/run.csv", status=130, stderr=f"\n{NOTHING}\n")
    assert files_below(recorded.cwd) == before
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_sigterm_ends_every_long_command(command: str, recorded: Here) -> None:
    tmp_path = recorded.cwd
    words, at_work, last = COMMANDS[command]
    with running(tmp_path, *words.split()) as process:
        until(lambda: at_work in (tmp_path / "stderr").read_text() or process.poll() is not None)
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 143
        until(lambda: not alive(process.pid), 5)
    assert stderr_of(tmp_path).splitlines()[-1].startswith(last)
    left = files_below(tmp_path / "out") if (tmp_path / "out").exists() else set()
    assert not [name for name in left if Path(name).name.startswith(".")]
    assert ("result.json" in left) is (command == "identify")
