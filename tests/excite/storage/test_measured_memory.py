"""The cap on memory holds under a limit of the system, and a long log is held once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import ENVIRONMENT, MODULE, run_process

pytestmark = pytest.mark.slow
# not of getrusage, where a new process begins with the peak of the one that started it
PEAK = "int(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])"


def limited(arguments: list[str], cwd: Path, most: int) -> subprocess.CompletedProcess[str]:
    """Run ``excite ...`` with a limit on its address space [bytes]."""
    shell = ["sh", "-c", f'ulimit -v {most // 1024} && exec "$@"', "sh"]  # not preexec_fn: this process may be larger
    return run_process([*shell, *MODULE, *arguments], cwd, {**ENVIRONMENT, "EXCITE_MEMORY_CAP": "0.5"})


@pytest.mark.parametrize(("seconds", "status"), [("1200", 0), ("100000", 2)])
def test_a_cap_below_a_limit_of_the_system_is_never_passed(tmp_path: Path, seconds: str, status: int) -> None:
    arguments = ["friction", "plan", "irp6", "--drives", "1", "--warm-up", seconds, "--out", "out"]
    ended = limited(arguments, tmp_path, 3 * 10**9)
    assert ended.returncode == status, ended.stderr
    assert "not enough memory" not in ended.stderr


def test_a_long_log_is_held_once(tmp_path: Path) -> None:
    rows = 300_000
    names = ",".join(f"{k}.{what}" for k in range(6) for what in ("position", "velocity", "effort"))
    some = [",".join(f"{x:.15g}" for x in row) for row in np.random.default_rng(0).normal(size=(1000, 18))]
    with (tmp_path / "log.csv").open("w") as stream:
        stream.write(f"time,{names}\n")
        stream.writelines(f"{1e-3 * k:.6f},{some[k % 1000]}\n" for k in range(rows))
    script = f"from excite.logs.log_reading import read_log\nread_log('log.csv', drop=['truncated'])\nprint({PEAK})"
    ended = run_process([sys.executable, "-c", script], tmp_path, check=True)
    numbers = rows * 19 * 8
    assert 1e3 * int(ended.stdout) < 8e7 + 2.6 * numbers  # the file has 2.2 times the bytes of its numbers
