"""Whether every seeded mutation of ``tests/mutations.md`` is still caught by the test that it names.

In a copy of the last commit each mutation is put into the source alone, its test run, and the text put back. All named
tests pass in the copy as it is before; a test that fails at once would catch anything.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import record

ROOT = Path(__file__).resolve().parents[1]
ENTRY = re.compile(r"^- `(?P<file>[^`]+)`: `(?P<old>.+)` -> `(?P<new>.+)`; caught by `(?P<test>[^`]+)::(?P<name>\w+)`$")
LONGEST = 900.0  # of one test [s]
LIMITATIONS = ("a mutation counts as caught where its test ends red, also by an error or after 900 s",)


def run(folder: Path, tests: list[str]) -> int:
    """Exit status of pytest in a copy of the source."""
    command = [str(Path(sys.executable).parent / "pytest"), "-q", "-x", "-n0", "-m", "slow or not slow", *tests]
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "check": False, "timeout": LONGEST}
    try:
        return subprocess.run(command, cwd=folder, env=environment, **quiet).returncode
    except subprocess.TimeoutExpired:
        return -1


def survives(folder: Path, entry: re.Match[str]) -> bool:
    """Whether a test passes in spite of its mutation."""
    source = folder / entry["file"]
    text = source.read_text(encoding="utf-8")
    assert text.count(entry["old"]) == 1, f"{entry['file']}: not once in the source: {entry['old']}"
    source.write_text(text.replace(entry["old"], entry["new"]), encoding="utf-8")
    try:
        status = run(folder, [f"{entry['test']}::{entry['name']}"])
    finally:
        source.write_text(text, encoding="utf-8")
    return status == 0


def main() -> None:
    """Every mutation, and those that survive."""
    before, begin = record.load(), time.perf_counter()
    lines = (ROOT / "tests" / "mutations.md").read_text(encoding="utf-8").splitlines()
    entries = [found for line in lines if (found := ENTRY.match(line)) is not None]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "main"
        subprocess.run(["git", "clone", "-q", str(ROOT), str(folder)], check=True)
        (Path(name) / "shared").symlink_to(ROOT.parent / "shared")
        named = sorted({f"{entry['test']}::{entry['name']}" for entry in entries})
        red = [test for test in named if run(folder, [test]) != 0]
        alive = []
        for number, entry in enumerate(entries, 1):
            if survives(folder, entry):
                alive.append(f"{entry['file']}: {entry['old']}")
            print(f"{number} of {len(entries)}, {len(alive)} survive", end="\r", flush=True)
    rows = [["mutations", len(entries)], ["tests", len(named)], ["red before any", len(red)], ["survive", len(alive)]]
    text = record.table(("what", "number"), rows) + "".join(f"\n\n`{each}`" for each in (*red, *alive))
    minutes = (time.perf_counter() - begin) / 60
    record.save("mutations", before, {"survive": alive, "red": red, "minutes": minutes}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
