"""Settings of the tests: property tests draw the same examples every time, untimed; commands run in empty folders."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import Here
from hypothesis import settings

# `pytest --hypothesis-profile=default --hypothesis-seed=N` looks elsewhere.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    """An empty folder in which commands run."""
    return Here(tmp_path, monkeypatch, capfd)
