"""Settings of the tests: property tests draw the same examples every time, untimed; commands run in empty folders."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from commands import Here
from hypothesis import settings
from processes import DaskProcesses
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

# `pytest --hypothesis-profile=default --hypothesis-seed=N` looks elsewhere.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

os.environ.pop("COLUMNS", None)  # readline, which pytest imports, states a terminal of 80 columns to worker processes


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling | None:
    """One process runs all quick tests of a file: what they share is made once; slow ones go where there is room."""
    return None if config.option.markexpr == "slow" else LoadFileScheduling(config, log)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Here:
    """An empty folder in which commands run."""
    return Here(tmp_path, monkeypatch, capfd)


@pytest.fixture(scope="session")
def recorded_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A design, logs of its motion and of others, and friction curves; see `recorded.write_files`."""
    from played import write_files

    folder = tmp_path_factory.mktemp("recorded")
    write_files(folder)
    return folder


@pytest.fixture
def recorded(recorded_files: Path, here: Here) -> Here:
    """A folder in which commands run, with these files."""
    from played import link_files

    link_files(recorded_files, here.cwd)
    return here


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskProcesses]:
    """A Dask scheduler and its workers."""
    pytest.importorskip("distributed")
    with DaskProcesses(tmp_path_factory.mktemp("dask")) as processes:
        yield processes
