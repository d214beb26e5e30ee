"""SIGTERM ends every long command with 143, leaves no process behind, and no file that is not complete."""

from __future__ import annotations

import os
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest
from commands import ENVIRONMENT, MODULE, files_below
from processes import alive, until
from recorded import link_files, write_files

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes through /proc"),
]
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


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    write_files(folder)
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_sigterm(command: str, files: Path, tmp_path: Path) -> None:
    link_files(files, tmp_path)
    words, at_work, last = COMMANDS[command]
    with (tmp_path / "stderr").open("w") as err, (tmp_path / "stdout").open("w") as out:
        process = subprocess.Popen(
            [*MODULE, *words.split()], cwd=tmp_path, env=ENVIRONMENT, stdout=out, stderr=err, start_new_session=True
        )
    try:
        until(lambda: at_work in (tmp_path / "stderr").read_text() or process.poll() is not None)
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 143
        until(lambda: not alive(process.pid), 5)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    stderr = (tmp_path / "stderr").read_text()
    assert "Traceback" not in stderr
    assert stderr.splitlines()[-1].startswith(last)
    left = files_below(tmp_path / "out") if (tmp_path / "out").exists() else set()
    assert not [name for name in left if Path(name).name.startswith(".")]
    assert ("result.json" in left) is (command == "identify")
