"""The list of seeded mutations is of today's source and tests: each text is there once, each test exists."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ENTRY = re.compile(r"^- `(?P<file>[^`]+)`: `(?P<old>.+)` -> `(?P<new>.+)`; caught by `(?P<test>[^`]+)::(?P<name>\w+)`$")


def test_every_entry_is_of_today() -> None:
    lines = (ROOT / "tests" / "mutations.md").read_text(encoding="utf-8").splitlines()
    entries = [ENTRY.match(line) for line in lines if line.startswith("- ")]
    assert len(entries) >= 120
    stale = []
    for entry in entries:
        assert entry is not None
        source, test = ROOT / entry["file"], ROOT / entry["test"]
        if not source.is_file() or source.read_text(encoding="utf-8").count(entry["old"]) != 1:
            stale.append(f"{entry['file']}: {entry['old']}")
        if not test.is_file() or f"def {entry['name']}(" not in test.read_text(encoding="utf-8"):
            stale.append(f"{entry['test']}::{entry['name']}")
    assert stale == []
