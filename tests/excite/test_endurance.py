"""Long use of one process, in short: memory, open files and threads. The long version is benchmarks/endurance."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from commands import ENVIRONMENT

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "endurance" / "endurance.py"


@pytest.mark.slow
def test_thirty_designs_and_three_hundred_starts_leave_nothing(tmp_path: Path) -> None:
    command = [sys.executable, SCRIPT, "--designs", "30", "--starts", "300", "--out", tmp_path]
    subprocess.run(command, env=ENVIRONMENT, check=True, capture_output=True, timeout=600)
    measured = json.loads((tmp_path / "endurance.json").read_text(encoding="utf-8"))
    for part in measured.values():
        assert (part["files_gained"], part["threads_gained"]) == (0, 0)
    starts = measured["starts"]
    assert starts["last_bytes"] - starts["first_bytes"] < 300 * 10_000  # a start's own numbers are 10 kB
    designs = measured["designs"]
    assert designs["last_bytes"] - designs["first_bytes"] < 100e6  # of which one set of figures keeps 50 MB
